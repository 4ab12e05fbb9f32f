from .common import MU_0 as MU_0, InputError as InputError
from .magnets import Magnet as Magnet, horizontal as horizontal, tilt as tilt, vertical as vertical
from .scene.contents import (
    AbsoluteStart as AbsoluteStart,
    Drag as Drag,
    Lowering as Lowering,
    OffsetStart as OffsetStart,
    Plate as Plate,
    Scene as Scene,
)
from .scene.files import load_scene as load_scene, parse_scene as parse_scene
from .scene.floater import Floater as Floater, FloaterPart as FloaterPart
from .scene.messages import SceneError as SceneError
from .shapes import Box as Box, rotation_matrix as rotation_matrix
