"""What field each body makes: closed forms, finite elements, tables."""

from .code_cache import keep_code
from .field_map import FieldMap, FieldMapError
from .gridded import GriddedTable
from .gridded_fit import fit_field_map
from .multipole import MultipoleExpansion, uniform_moments
from .table import FieldTable, RangeError, RotorTable

keep_code()

__all__ = [
    "FieldMap",
    "FieldMapError",
    "FieldTable",
    "GriddedTable",
    "MultipoleExpansion",
    "RangeError",
    "RotorTable",
    "fit_field_map",
    "uniform_moments",
]
