from .harmonics import MultipoleExpansion as MultipoleExpansion, uniform_moments as uniform_moments
from .measured_maps import (
    FieldMap as FieldMap,
    FieldMapError as FieldMapError,
    GriddedTable as GriddedTable,
    fit_field_map as fit_field_map,
)
from .rotor_tables import FieldTable as FieldTable, RangeError as RangeError, RotorTable as RotorTable
