"""How do true fields and slow effects change where and how long the floater levitates?"""

from .dipole_vs_fem import STUDY as DIPOLE_VS_FEM
from .dipole_vs_fem_report import range_text as range_text
from .floater_permeability import STUDY as FLOATER_PERMEABILITY
from .levitation_time import STUDY as LEVITATION_TIME
from .side_mode import STUDY as SIDE_MODE
from .trajectories import STUDY as TRAJECTORIES

STUDIES = (SIDE_MODE, TRAJECTORIES, FLOATER_PERMEABILITY, LEVITATION_TIME, DIPOLE_VS_FEM)
