"""What is the rotor's field anywhere outside of it, and how well is it known?"""

from .accuracy import Accuracy, places, shell, typical_field
from .accuracy_error import AccuracyError
from .cache import cached_rotor_table
from .choice import resolve_model, rotor_table
from .fem_model import AccuracyWarning, fem_table, provenance, tail, used
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
    "fem_table",
    "from_dataset",
    "places",
    "provenance",
    "resolve_model",
    "rotor_table",
    "shell",
    "tail",
    "to_dataset",
    "typical_field",
    "used",
]
