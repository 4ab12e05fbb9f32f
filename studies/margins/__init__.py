"""How far is levitation from its limits?"""

from .design import STUDY as DESIGN
from .sensitivity import STUDY as SENSITIVITY
from .stability_map import STUDY as STABILITY_MAP

STUDIES = (SENSITIVITY, DESIGN, STABILITY_MAP)
