"""Which currents does an alternating field drive in a conductor?"""

from .field_rows import FieldRows
from .fields import current_density
from .mirrored_dipoles import dipole_images
from .solver import ClassFactor, EddyResponse, ShiftedSystem, solve_eddy
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
]
