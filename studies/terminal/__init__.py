"""What does a user ask for, and what does the program say?"""

from .console import (
    answers_only as answers_only,
    detail as detail,
    heard as heard,
    note as note,
    progress as progress,
    silence as silence,
    stages as stages,
    to_json as to_json,
)
from .numbers import (
    COLUMNS as COLUMNS,
    finite as finite,
    map_extent as map_extent,
    positive as positive,
    read_points as read_points,
    three_numbers as three_numbers,
)
from .options import (
    Answer as Answer,
    Beside as Beside,
    FieldModel as FieldModel,
    InteractionModel as InteractionModel,
    Models as Models,
    Output as Output,
    PlateModel as PlateModel,
    Quantity as Quantity,
    Workers as Workers,
    default_scene as default_scene,
    shipped_scene as shipped_scene,
)
from .plain_text import make_readable as make_readable
from .scene_file import KINDS as KINDS, new_scene as new_scene
from .system_libraries import (
    DRAWING as DRAWING,
    FORTRAN as FORTRAN,
    is_missing_library as is_missing_library,
    lend_quadmath as lend_quadmath,
    way_out as way_out,
)
from .vary import checked_values as checked_values, combinations as combinations, parse_vary as parse_vary
