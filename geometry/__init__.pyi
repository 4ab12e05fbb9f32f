from .basics import MU_0 as MU_0, Box as Box, InputError as InputError, rotation_matrix as rotation_matrix
from .bodies import Magnet as Magnet, horizontal as horizontal, tilt as tilt, vertical as vertical
from .scenes import (
    AbsoluteStart as AbsoluteStart,
    Drag as Drag,
    Floater as Floater,
    Lowering as Lowering,
    OffsetStart as OffsetStart,
    Plate as Plate,
    Scene as Scene,
    SceneError as SceneError,
    load_scene as load_scene,
    parse_scene as parse_scene,
)
