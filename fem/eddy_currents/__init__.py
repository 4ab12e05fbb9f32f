"""Which currents does an alternating field drive in a conductor?"""

from .field_rows import FieldRows
from .fields import current_density
from .mirrored_dipoles import dipole_images
from .shifted_system import ClassFactor, ShiftedSystem
from .solver import EddyResponse, solve_eddy, solve_shifted
from .space import EddySpace, Source

__all__ = [
    "ClassFactor",
    "EddyResponse",
    "EddySpace",
    "FieldRows",
    "ShiftedSystem",
    "Source",
    "current_density",
    "dipole_images",
    "solve_eddy",
    "solve_shifted",
]
