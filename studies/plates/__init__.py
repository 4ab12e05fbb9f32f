"""What does a plate do, and are its currents right?"""

from .plate_damping import STUDY as PLATE_DAMPING
from .team7 import STUDY as TEAM7

STUDIES = (PLATE_DAMPING, TEAM7)
