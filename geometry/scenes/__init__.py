"""What is in the scene file, and is it a scene that can exist?"""

from .assembly import assemble as assemble
from .building import scene as scene
from .contents import (
    AIR_VISCOSITY as AIR_VISCOSITY,
    AbsoluteStart as AbsoluteStart,
    Drag as Drag,
    Lowering as Lowering,
    MapReading as MapReading,
    OffsetStart as OffsetStart,
    Plate as Plate,
    Scene as Scene,
)
from .faults import SceneError as SceneError
from .file import (
    changed as changed,
    check_files as check_files,
    load_scene as load_scene,
    parse_scene as parse_scene,
)
from .floater import Floater as Floater
from .parts import (
    horizontal as horizontal,
    magnets as magnets,
    plate as plate,
    sphere as sphere,
    tilt as tilt,
    vertical as vertical,
)
from .writing import (
    map_digest as map_digest,
    scene_digest as scene_digest,
    scene_keys as scene_keys,
    scene_text as scene_text,
    startless_text as startless_text,
)
