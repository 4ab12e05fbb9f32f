"""What does a user ask for, and what does the program say?"""

from .console import answers_only, note, progress, silence, to_json
from .numbers import positive, three_numbers
from .output import Answer, Output
from .shipped_scenes import default_scene
from .tables import FieldModel, PlateModel, Quantity, Tables

__all__ = [
    "Answer",
    "FieldModel",
    "Output",
    "PlateModel",
    "Quantity",
    "Tables",
    "answers_only",
    "default_scene",
    "note",
    "positive",
    "progress",
    "silence",
    "three_numbers",
    "to_json",
]
