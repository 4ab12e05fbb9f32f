"""Which equilibria does a scene have, all of them?"""

from .continuation import (
    DIFFERENCE as DIFFERENCE,
    END as END,
    ON as ON,
    SHORTER as SHORTER,
    AtRest as AtRest,
    Equations as Equations,
    Steps as Steps,
    directions as directions,
    follow as follow,
    stepped as stepped,
)
from .effect_sizes import (
    growth_by_floater as growth_by_floater,
    growth_by_rotor as growth_by_rotor,
    shift_by_answers as shift_by_answers,
)
from .fixed_points import scattered as scattered
from .found import Found as Found, cached_found as cached_found, found_key as found_key
from .full_search import (
    field_doubts as field_doubts,
    find_equilibria as find_equilibria,
    free_of_bodies as free_of_bodies,
    own_spin as own_spin,
    survey as survey,
    told as told,
    turning as turning,
    with_plate as with_plate,
)
from .nearby_scene import carried as carried
from .periodic_equilibrium import OrbitCurve as OrbitCurve
from .perturbed import PerturbedBalance as PerturbedBalance, Shift as Shift
from .plate_effect import plate_action as plate_action
from .search import SAME as SAME, Search as Search, SearchRange as SearchRange
from .tracing import near_curve as near_curve, whole_curves as whole_curves
