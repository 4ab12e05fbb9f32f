"""The studies that the program knows, in the order in which they are listed."""

from __future__ import annotations

from ..article import STUDIES as ARTICLE
from ..field_quality import STUDIES as FIELD_QUALITY
from ..levitation import STUDIES as LEVITATION
from ..margins import STUDIES as MARGINS
from ..plates import STUDIES as PLATES
from ..results import Study

side_mode, trajectories, floater_permeability, levitation_time, dipole_vs_fem = LEVITATION
plate_damping, team7 = PLATES
LISTED = (
    *ARTICLE,
    side_mode,
    trajectories,
    *FIELD_QUALITY,
    floater_permeability,
    plate_damping,
    levitation_time,
    dipole_vs_fem,
    *MARGINS,
    team7,
)
CATALOGUE: dict[str, Study] = {study.name: study for study in LISTED}
"""By name."""
