"""Which currents can sources around a plate drive in it, at all frequencies?"""

from .current_space import CurrentSpace as CurrentSpace, space_couplings as space_couplings
from .current_training import unit_power as unit_power
from .limits import OPTION as OPTION
from .other_sources_error import error_of as error_of
from .reaction import plate_reaction as plate_reaction
from .region import Region as Region
from .solution import STRICT as STRICT, PlateSolution as PlateSolution, solve_currents as solve_currents
from .solution_file import cached_solver as cached_solver, digest as digest
from .sources import OtherSources as OtherSources, grid_counts as grid_counts, probe_places as probe_places
