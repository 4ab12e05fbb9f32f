"""What acts on the floater beyond the rotor's field on a rigid dipole?"""

from .air import (
    RealAir as RealAir,
    moving as moving,
    reynolds as reynolds,
    spinning as spinning,
    swinging as swinging,
)
from .catalogue import with_effects as with_effects
from .floater_currents import FloaterCurrents as FloaterCurrents
from .rotor_losses import RotorCurrents as RotorCurrents
