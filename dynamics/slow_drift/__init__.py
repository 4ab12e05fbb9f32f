"""What becomes of a flight in minutes and hours?"""

from .averaged import E_FOLDS, Drift
from .spin_drift import drift

__all__ = ["E_FOLDS", "Drift", "drift"]
