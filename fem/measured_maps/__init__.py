"""How does a measured or foreign map of B become a table?"""

from .field_map import FieldMap as FieldMap, FieldMapError as FieldMapError
from .file import map_table as map_table
from .fit import fit_field_map as fit_field_map
from .fitted_table import GriddedTable as GriddedTable
