"""Which currents does an alternating field drive in a conductor?"""

from .fields import current_density as current_density
from .solver import EddyResponse as EddyResponse, FrequencySystem as FrequencySystem, solve_eddy as solve_eddy
from .space import EddySpace as EddySpace, Source as Source
