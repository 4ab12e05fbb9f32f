"""What acts on the floater beyond the rotor's field on a rigid dipole?"""

from .catalogue import with_effects as with_effects
from .floater_currents import FLOATER_CURRENTS as FLOATER_CURRENTS, FloaterCurrents as FloaterCurrents
from .mutual import MUTUAL as MUTUAL, Mutual as Mutual
from .rough_answer import rough_force as rough_force
