from .harmonics.expansion import MultipoleExpansion as MultipoleExpansion, uniform_moments as uniform_moments
from .maps_of_B.columns import FieldMap as FieldMap, FieldMapError as FieldMapError
from .maps_of_B.table import GriddedTable as GriddedTable, fit_field_map as fit_field_map
from .rotor.table import FieldTable as FieldTable, RangeError as RangeError, RotorTable as RotorTable
