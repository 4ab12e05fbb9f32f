"""What is the rotor's field anywhere outside of it, and how well is it known?"""

from .accuracy import (
    Accuracy as Accuracy,
    AccuracyError as AccuracyError,
    points_around as points_around,
    typical_field as typical_field,
)
from .anywhere import (
    NearField as NearField,
    field_anywhere as field_anywhere,
    near_field as near_field,
    refuse_edges as refuse_edges,
)
from .cache import cached_rotor_table as cached_rotor_table, rotor_key as rotor_key
from .choice import resolve_model as resolve_model, rotor_table as rotor_table
from .fem_model import AccuracyWarning as AccuracyWarning, fem_table as fem_table
from .home import at_home as at_home
from .lowest_field import (
    EasyField as EasyField,
    WorkingPoint as WorkingPoint,
    easy_axis as easy_axis,
    working_points as working_points,
)
from .near_elements import NearElements as NearElements
from .shortened import shortened_table as shortened_table
from .table import (
    ROUND_OFF as ROUND_OFF,
    FieldFormula as FieldFormula,
    FieldTable as FieldTable,
    RangeError as RangeError,
    RotorTable as RotorTable,
    error_below as error_below,
)
from .table_file import from_dataset as from_dataset, to_dataset as to_dataset
