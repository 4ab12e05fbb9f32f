"""Which equilibria does a scene have, all of them?"""

from .continuation import END, ON, SHORTER, AtRest, Equations, Steps, directions, follow, stepped
from .fixed_points import scattered
from .full_search import find_equilibria, survey, with_plate
from .perturbed import PerturbedBalance, Shift
from .plate_effect import plate_action
from .search import SearchRange
from .tracing import near_curve, whole_curves

__all__ = [
    "END",
    "ON",
    "SHORTER",
    "AtRest",
    "Equations",
    "PerturbedBalance",
    "SearchRange",
    "Shift",
    "Steps",
    "directions",
    "find_equilibria",
    "follow",
    "near_curve",
    "plate_action",
    "scattered",
    "stepped",
    "survey",
    "whole_curves",
    "with_plate",
]
