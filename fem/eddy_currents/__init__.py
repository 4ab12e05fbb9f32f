"""Which currents does an alternating field drive in a conductor?"""

from .field_rows import FieldRows as FieldRows
from .fields import current_density as current_density
from .mirrored_dipoles import dipole_images as dipole_images
from .shifted_system import ClassFactor as ClassFactor, ShiftedSystem as ShiftedSystem
from .solver import EddyResponse as EddyResponse, solve_eddy as solve_eddy, solve_shifted as solve_shifted
from .space import EddySpace as EddySpace, Source as Source
