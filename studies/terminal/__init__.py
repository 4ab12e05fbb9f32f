"""What does a user ask for, and what does the program say?"""

from .console import answers_only, heard, note, progress, silence, to_json
from .models import FieldModel, Models, PlateModel, Quantity
from .numbers import finite, positive, three_numbers
from .output import Answer, Output
from .plain_text import make_readable
from .shipped_scenes import default_scene
from .system_libraries import DRAWING, FORTRAN, is_missing_library, lend_quadmath, way_out

__all__ = [
    "DRAWING",
    "FORTRAN",
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
    "is_missing_library",
    "lend_quadmath",
    "make_readable",
    "note",
    "positive",
    "progress",
    "silence",
    "three_numbers",
    "to_json",
    "way_out",
]
