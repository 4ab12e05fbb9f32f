"""What does a user ask for, and what does the program say?"""

from .console import answers_only, heard, note, progress, silence, stages, to_json
from .models import FieldModel, Models, PlateModel, Quantity
from .numbers import finite, positive, three_numbers
from .output import Answer, Output
from .plain_text import make_readable
from .points_file import COLUMNS, read_points
from .shipped_scenes import default_scene
from .system_libraries import DRAWING, FORTRAN, is_missing_library, lend_quadmath, way_out
from .vary import checked_values, combinations, parse_vary
from .workers import Workers

__all__ = [
    "COLUMNS",
    "DRAWING",
    "FORTRAN",
    "Answer",
    "FieldModel",
    "Models",
    "Output",
    "PlateModel",
    "Quantity",
    "Workers",
    "answers_only",
    "checked_values",
    "combinations",
    "default_scene",
    "finite",
    "heard",
    "is_missing_library",
    "lend_quadmath",
    "make_readable",
    "note",
    "parse_vary",
    "positive",
    "progress",
    "read_points",
    "silence",
    "stages",
    "three_numbers",
    "to_json",
    "way_out",
]
