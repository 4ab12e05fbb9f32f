"""The studies that the program knows, in the order in which they are listed."""

from ..study import Study
from .article_figures import FIELD_COMPONENTS, FORCE_CURVE, SIDE_MODE
from .article_flights import LEVITATION_DISTANCE, TRAJECTORIES
from .capture import STUDY as CAPTURE
from .experiment import STUDY as EXPERIMENT
from .field_quality import DIPOLE_VALIDITY, FIELD_HARD_CASES
from .finite_magnets import DIPOLE_VS_FEM, FLOATER_PERMEABILITY
from .floater_shape import STUDY as FLOATER_SHAPE
from .levitation_time import STUDY as LEVITATION_TIME
from .margins import DESIGN, SENSITIVITY
from .measured import MEASURED
from .plates import PLATE_DAMPING, TEAM7
from .ramps import STUDY as RAMPS
from .regions import STABILITY_MAP, UPPER_LIMIT
from .speed_accuracy import STUDY as SPEED_ACCURACY

LISTED = (
    *(FIELD_COMPONENTS, FORCE_CURVE, LEVITATION_DISTANCE, DIPOLE_VALIDITY, SPEED_ACCURACY, FIELD_HARD_CASES),
    *(SIDE_MODE, TRAJECTORIES, FLOATER_PERMEABILITY, LEVITATION_TIME, DIPOLE_VS_FEM),
    *(SENSITIVITY, DESIGN, STABILITY_MAP, PLATE_DAMPING, TEAM7, MEASURED, CAPTURE),
    *(UPPER_LIMIT, FLOATER_SHAPE, RAMPS, EXPERIMENT),
)
CATALOGUE: dict[str, Study] = {study.name: study for study in LISTED}  # By name
