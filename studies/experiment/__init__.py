"""What must be true for all reported facts at once?"""

from .experiment import STUDY as EXPERIMENT

STUDIES = (EXPERIMENT,)
