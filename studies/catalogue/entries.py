"""The studies that the program knows, in the order in which they are listed."""

from ..study import Study
from .capture import STUDY as CAPTURE
from .design import STUDY as DESIGN
from .dipole_validity import STUDY as DIPOLE_VALIDITY
from .dipole_vs_fem import STUDY as DIPOLE_VS_FEM
from .experiment import STUDY as EXPERIMENT
from .field_components import STUDY as FIELD_COMPONENTS
from .floater_permeability import STUDY as FLOATER_PERMEABILITY
from .force_curve import STUDY as FORCE_CURVE
from .hard_cases import STUDY as FIELD_HARD_CASES
from .levitation_distance import STUDY as LEVITATION_DISTANCE
from .levitation_time import STUDY as LEVITATION_TIME
from .plate_damping import STUDY as PLATE_DAMPING
from .sensitivity import STUDY as SENSITIVITY
from .side_mode import STUDY as SIDE_MODE
from .speed_accuracy import STUDY as SPEED_ACCURACY
from .stability_map import STUDY as STABILITY_MAP
from .team7 import STUDY as TEAM7
from .trajectories import STUDY as TRAJECTORIES
from .upper_limit import STUDY as UPPER_LIMIT

LISTED = (
    *(FIELD_COMPONENTS, FORCE_CURVE, LEVITATION_DISTANCE, DIPOLE_VALIDITY, SPEED_ACCURACY, FIELD_HARD_CASES),
    *(SIDE_MODE, TRAJECTORIES, FLOATER_PERMEABILITY, LEVITATION_TIME, DIPOLE_VS_FEM),
    *(SENSITIVITY, DESIGN, STABILITY_MAP, PLATE_DAMPING, TEAM7, CAPTURE, UPPER_LIMIT, EXPERIMENT),
)
CATALOGUE: dict[str, Study] = {study.name: study for study in LISTED}  # By name
