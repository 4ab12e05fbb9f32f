"""Which equations does the floater obey?"""

from .effect import (
    NOTHING as NOTHING,
    ZERO as ZERO,
    Added as Added,
    Effect as Effect,
    Fittable as Fittable,
    InBall as InBall,
    Motion as Motion,
    Placeable as Placeable,
    Placed as Placed,
    Unsure as Unsure,
    conservative as conservative,
    dissipative as dissipative,
)
from .equations import (
    FORCE_ALONE as FORCE_ALONE,
    Equations as Equations,
    equations_of_motion as equations_of_motion,
    parameters as parameters,
)
from .events import (
    BEYOND as BEYOND,
    CONTACT as CONTACT,
    LOST as LOST,
    clearance as clearance,
    flight_events as flight_events,
    lost_distance as lost_distance,
    plate_depth as plate_depth,
    plate_legs as plate_legs,
    plate_places as plate_places,
    range_events as range_events,
    rotor_gap as rotor_gap,
)
from .interaction import Interaction as Interaction, interaction_of as interaction_of
from .likeness import has_likes as has_likes, like as like
from .plate_force import PlateForce as PlateForce
from .plate_terms import (
    Felt as Felt,
    PlateFormula as PlateFormula,
    PlateMemory as PlateMemory,
    decay_numbers as decay_numbers,
    pushed as pushed,
    rotor_numbers as rotor_numbers,
    seen_by_plate as seen_by_plate,
)
from .rates import Rates as Rates
from .state import Scales as Scales, State as State, turned_about_z as turned_about_z
from .symbols import (
    Parameter as Parameter,
    Vector as Vector,
    cross as cross,
    dot as dot,
    dotted as dotted,
    subtract as subtract,
)
