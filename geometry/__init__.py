"""What is in the scene: magnets, rotor, floater, plate, scene file, meshes."""

from .box import Box, rotation_matrix
from .input_error import InputError
from .magnet import MU_0, Magnet
from .rotor import horizontal, tilt, vertical
from .scene import AbsoluteStart, Drag, Floater, Lowering, OffsetStart, Plate, Scene
from .scene_faults import SceneError
from .scene_file import load_scene, parse_scene

__all__ = [
    "MU_0",
    "AbsoluteStart",
    "Box",
    "Drag",
    "Floater",
    "InputError",
    "Lowering",
    "Magnet",
    "OffsetStart",
    "Plate",
    "Scene",
    "SceneError",
    "horizontal",
    "load_scene",
    "parse_scene",
    "rotation_matrix",
    "tilt",
    "vertical",
]
