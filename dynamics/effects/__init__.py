"""What acts on the floater beyond the rotor's field on a rigid dipole?"""

from .air import (
    REAL_AIR as REAL_AIR,
    RealAir as RealAir,
    moving as moving,
    reynolds as reynolds,
    spinning as spinning,
    swinging as swinging,
)
from .catalogue import (
    BESIDE_METAL as BESIDE_METAL,
    WITHOUT_METAL as WITHOUT_METAL,
    with_effects as with_effects,
)
from .floater_currents import (
    FLOATER_CURRENTS as FLOATER_CURRENTS,
    SLOW_ENOUGH as SLOW_ENOUGH,
    FloaterCurrents as FloaterCurrents,
    check_floater_metal as check_floater_metal,
    slow_error as slow_error,
    too_slow as too_slow,
)
from .floater_shape import FLOATER_SHAPE as FLOATER_SHAPE, FloaterShape as FloaterShape
from .mutual import MUTUAL as MUTUAL, Mutual as Mutual
from .rigid_or_mutual import NOTHING_ANSWERS as NOTHING_ANSWERS, mutual_choice as mutual_choice
from .rotor_losses import (
    ROTOR_CURRENTS as ROTOR_CURRENTS,
    Dissipation as Dissipation,
    RotorCurrents as RotorCurrents,
    brake_slope as brake_slope,
)
from .rough_answer import rough_force as rough_force
