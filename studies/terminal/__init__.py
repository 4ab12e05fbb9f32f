"""What does a user ask for, and what does the program say?"""

from .console import answers_only, heard, note, progress, silence, to_json
from .models import FieldModel, Models, PlateModel, Quantity
from .numbers import finite, positive, three_numbers
from .output import Answer, Output
from .shipped_scenes import default_scene

__all__ = [
    "Answer",
    "FieldModel",
    "Models",
    "Output",
    "PlateModel",
    "Quantity",
    "answers_only",
    "default_scene",
    "finite",
    "heard",
    "note",
    "positive",
    "progress",
    "silence",
    "three_numbers",
    "to_json",
]
