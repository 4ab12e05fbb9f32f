"""What does a user ask for, and what does the program say?"""

from .console import (
    answers_only as answers_only,
    heard as heard,
    note as note,
    progress as progress,
    silence as silence,
    to_json as to_json,
)
from .models import FieldModel as FieldModel, Models as Models, PlateModel as PlateModel, Quantity as Quantity
from .numbers import finite as finite, positive as positive, three_numbers as three_numbers
from .output import Answer as Answer, Output as Output
from .plain_text import make_readable as make_readable
from .points_file import COLUMNS as COLUMNS, read_points as read_points
from .shipped_scenes import default_scene as default_scene
from .system_libraries import (
    DRAWING as DRAWING,
    FORTRAN as FORTRAN,
    is_missing_library as is_missing_library,
    lend_quadmath as lend_quadmath,
    way_out as way_out,
)
from .vary import checked_values as checked_values, combinations as combinations, parse_vary as parse_vary
from .workers import Workers as Workers
