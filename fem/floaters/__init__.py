"""What does the rotor's field do to a floater that is no sphere?"""

from .forces import force_and_torque as force_and_torque
from .sources import FloaterSources as FloaterSources, floater_sources as floater_sources
