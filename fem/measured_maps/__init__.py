"""How does a measured or foreign map of B become a table?"""

from .field_map import FieldMap, FieldMapError
from .fit import fit_field_map
from .fitted_table import GriddedTable
from .from_file import map_table

__all__ = ["FieldMap", "FieldMapError", "GriddedTable", "fit_field_map", "map_table"]
