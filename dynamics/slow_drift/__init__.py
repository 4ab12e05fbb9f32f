"""What becomes of a flight in minutes and hours?"""

from .averaged import E_FOLDS as E_FOLDS, Drift as Drift
from .lasting import Lasting as Lasting, lasting_frequencies as lasting_frequencies
from .slow_torque import SlowTorque as SlowTorque
from .spin_drift import drift as drift
