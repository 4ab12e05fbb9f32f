"""What does a plate do to a floater, as a table for the motion?"""

from .driven_plate import SHARE_PART as SHARE_PART, reachable_region as reachable_region, turning_rotor as turning_rotor
from .field_functions import Multipoles as Multipoles
from .file import (
    cached_driven_plate as cached_driven_plate,
    cached_plate_table as cached_plate_table,
    cached_with_share as cached_with_share,
    driven_plate_key as driven_plate_key,
)
from .multipole_fit import Fit as Fit, fit_multipoles as fit_multipoles
from .plate_table import PlateErrors as PlateErrors, PlateTable as PlateTable
from .rotor_source import (
    DOWN as DOWN,
    ExpansionSource as ExpansionSource,
    RotorSource as RotorSource,
    posed_rotor as posed_rotor,
    rotor_parts as rotor_parts,
)
from .sampled_share import rotor_share as rotor_share
from .share import RotorShare as RotorShare
from .shorter_share import MISSED as MISSED, without_high_harmonics as without_high_harmonics
from .tabulate import FUNCTION_SHARE as FUNCTION_SHARE, tensor_error as tensor_error
