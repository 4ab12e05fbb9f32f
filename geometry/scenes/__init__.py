"""What is in the scene file, and is it a scene that can exist?"""

from .building import horizontal, magnets, plate, scene, sphere, tilt, vertical
from .contents import AIR_VISCOSITY, AbsoluteStart, Drag, Floater, Lowering, OffsetStart, Plate, Scene
from .faults import SceneError
from .file import changed, load_scene, parse_scene
from .writing import scene_text

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
    "changed",
    "horizontal",
    "load_scene",
    "magnets",
    "parse_scene",
    "plate",
    "scene",
    "scene_text",
    "sphere",
    "tilt",
    "vertical",
]
