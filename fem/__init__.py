"""What field each body makes: closed forms, finite elements, tables."""

from .field_map import FieldMap, FieldMapError
from .gridded import GriddedTable
from .gridded_fit import fit_field_map
from .multipole import MultipoleExpansion, uniform_moments
from .table import FieldTable, RangeError, RotorTable

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
