"""What does a plate do to a floater, as a table for the motion?"""

from .driven_plate import SHARE_PART, reachable_region, turning_rotor
from .field_functions import Multipoles
from .file import cached_driven_plate, cached_plate_table
from .multipole_fit import Fit, fit_multipoles
from .plate_table import PlateErrors, PlateTable
from .rotor_source import DOWN, ExpansionSource, RotorSource, posed_rotor, rotor_parts
from .sampled_share import rotor_share
from .share import RotorShare
from .share_trim import MISSED, trimmed
from .tabulate import FUNCTION_SHARE, tensor_error

__all__ = [
    "DOWN",
    "FUNCTION_SHARE",
    "MISSED",
    "SHARE_PART",
    "ExpansionSource",
    "Fit",
    "Multipoles",
    "PlateErrors",
    "PlateTable",
    "RotorShare",
    "RotorSource",
    "cached_driven_plate",
    "cached_plate_table",
    "fit_multipoles",
    "posed_rotor",
    "reachable_region",
    "rotor_parts",
    "rotor_share",
    "tensor_error",
    "trimmed",
    "turning_rotor",
]
