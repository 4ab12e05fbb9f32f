"""What becomes of a flight in minutes and hours?"""

from .averaged import E_FOLDS as E_FOLDS, Drift as Drift
from .spin_drift import drift as drift
