"""Which currents can sources around a plate drive in it, at all frequencies?"""

from .current_space import CurrentSpace, space_couplings
from .current_training import unit_power
from .other_sources_error import error_of
from .reaction import plate_reaction
from .region import Region
from .solution import STRICT, PlateSolution, solve_currents
from .solution_file import cached_solver, digest
from .sources import OtherSources, grid_counts, probe_places
from .watch import Watch, unwatched

__all__ = [
    "STRICT",
    "CurrentSpace",
    "OtherSources",
    "PlateSolution",
    "Region",
    "Watch",
    "cached_solver",
    "digest",
    "error_of",
    "grid_counts",
    "plate_reaction",
    "probe_places",
    "solve_currents",
    "space_couplings",
    "unit_power",
    "unwatched",
]
