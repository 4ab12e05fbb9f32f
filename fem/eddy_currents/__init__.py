"""Which currents does an alternating field drive in a conductor?"""

from .fields import current_density
from .solver import EddyResponse, FrequencySystem, solve_eddy
from .space import EddySpace, Source

__all__ = ["EddyResponse", "EddySpace", "FrequencySystem", "Source", "current_density", "solve_eddy"]
