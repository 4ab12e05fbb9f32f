"""What is the rotor's field anywhere outside of it, and how well is it known?"""

from .accuracy import Accuracy, error_points, points_around, typical_field
from .accuracy_error import AccuracyError
from .cache import cached_rotor_table
from .choice import resolve_model, rotor_table
from .fem_model import AccuracyWarning, extrapolated_tail, fem_table, nonzero, provenance
from .shortened import distant
from .table import FieldFormula, FieldTable, RangeError, RotorTable, error_below
from .table_file import from_dataset, to_dataset

__all__ = [
    "Accuracy",
    "AccuracyError",
    "AccuracyWarning",
    "FieldFormula",
    "FieldTable",
    "RangeError",
    "RotorTable",
    "cached_rotor_table",
    "distant",
    "error_below",
    "error_points",
    "extrapolated_tail",
    "fem_table",
    "from_dataset",
    "nonzero",
    "points_around",
    "provenance",
    "resolve_model",
    "rotor_table",
    "to_dataset",
    "typical_field",
]
