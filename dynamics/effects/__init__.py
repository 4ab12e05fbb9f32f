"""What acts on the floater beyond the rotor's field on a rigid dipole?"""

from .catalogue import with_effects as with_effects
from .floater_currents import FloaterCurrents as FloaterCurrents
from .mutual import Mutual as Mutual
