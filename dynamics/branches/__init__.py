"""How does an equilibrium go with one or two parameters, and where does it end?"""

from .advice import way_out
from .arclength import follow_branch
from .boundary import follow_boundary
from .boundary_equations import BoundaryPoint, Plane
from .branch import FOLD, Family, Point, Problem, frequencies, spins
from .levitation_branch import by_frequency, distance_error, kicked, levitating_branch
from .mutual_levitation import with_answers
from .stable_frequencies import (
    HIGHEST,
    LONG_STEPS,
    LOWEST,
    StableRange,
    at_frequency,
    is_stable,
    levitating_ranges,
    reference_state,
    stability_end,
    stable_range,
)

__all__ = [
    "FOLD",
    "HIGHEST",
    "LONG_STEPS",
    "LOWEST",
    "BoundaryPoint",
    "Family",
    "Plane",
    "Point",
    "Problem",
    "StableRange",
    "at_frequency",
    "by_frequency",
    "distance_error",
    "follow_boundary",
    "follow_branch",
    "frequencies",
    "is_stable",
    "kicked",
    "levitating_branch",
    "levitating_ranges",
    "reference_state",
    "spins",
    "stability_end",
    "stable_range",
    "way_out",
    "with_answers",
]
