"""How does an equilibrium go with one or two parameters, and where does it end?"""

from .advice import way_out as way_out
from .arclength import follow_branch as follow_branch
from .boundary import follow_boundary as follow_boundary
from .boundary_equations import BoundaryPoint as BoundaryPoint, Plane as Plane
from .branch import (
    FOLD as FOLD,
    BranchPoint as BranchPoint,
    Family as Family,
    Problem as Problem,
    frequencies as frequencies,
    spins as spins,
)
from .levitation_branch import (
    by_frequency as by_frequency,
    distance_error as distance_error,
    kicked as kicked,
    levitating_branch as levitating_branch,
)
from .stable_frequencies import (
    HIGHEST as HIGHEST,
    LONG_STEPS as LONG_STEPS,
    LOWEST as LOWEST,
    StableRange as StableRange,
    at_frequency as at_frequency,
    levitates as levitates,
    levitating_ranges as levitating_ranges,
    reference_state as reference_state,
    stability_end as stability_end,
    stable_range as stable_range,
)
