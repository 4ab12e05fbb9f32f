"""What field each body makes: closed forms, finite elements, tables."""

from .multipole import MultipoleExpansion, uniform_moments
from .table import FieldTable, RangeError, RotorTable

__all__ = ["FieldTable", "MultipoleExpansion", "RangeError", "RotorTable", "uniform_moments"]
