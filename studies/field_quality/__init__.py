"""How good is each model of the rotor's field, and what does it cost?"""

from .dipole_validity import STUDY as DIPOLE_VALIDITY
from .field_hard_cases import STUDY as FIELD_HARD_CASES
from .speed_accuracy import STUDY as SPEED_ACCURACY

STUDIES = (DIPOLE_VALIDITY, SPEED_ACCURACY, FIELD_HARD_CASES)
