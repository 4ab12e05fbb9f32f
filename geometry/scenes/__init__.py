"""What is in the scene file, and is it a scene that can exist?"""

from .faults import SceneError
from .file import load_scene, parse_scene
from .scene import AIR_VISCOSITY, AbsoluteStart, Drag, Floater, Lowering, OffsetStart, Plate, Scene

__all__ = [
    "AIR_VISCOSITY",
    "AbsoluteStart",
    "Drag",
    "Floater",
    "Lowering",
    "OffsetStart",
    "Plate",
    "Scene",
    "SceneError",
    "load_scene",
    "parse_scene",
]
