"""Which equilibria does a scene have, all of them?"""

from .advice import way_out
from .full_search import find_equilibria, survey, with_plate
from .perturbed import PerturbedBalance, Shift
from .plate_effect import plate_action
from .search import SearchRange

__all__ = [
    "PerturbedBalance",
    "SearchRange",
    "Shift",
    "find_equilibria",
    "plate_action",
    "survey",
    "way_out",
    "with_plate",
]
