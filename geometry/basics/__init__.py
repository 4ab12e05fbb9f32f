"""What is everything made of: arrays, boxes, constants, and the errors that a user reads?"""

from .arrays import Array, frozen_array
from .box import Box, rotation_matrix
from .constants import MU_0
from .errors import ComputationError, InputError, SpinlevError
from .materials import MAGNET_CONDUCTIVITY
from .text import counted, listed, millimetres

__all__ = [
    "MAGNET_CONDUCTIVITY",
    "MU_0",
    "Array",
    "Box",
    "ComputationError",
    "InputError",
    "SpinlevError",
    "counted",
    "frozen_array",
    "listed",
    "millimetres",
    "rotation_matrix",
]
