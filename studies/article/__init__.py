"""What did the article compute, and what do true fields say?"""

from .article import (
    CONFIGURATIONS,
    FLIGHT,
    FLOATER,
    HIGHEST,
    LOWEST,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    QUICK,
    REMANENCE,
    article_scene,
    article_table,
    axis_label,
    by_configuration,
    levitated_rotors,
    rotor_label,
    stable_in_flight,
)
from .article_figure import TITLES, legend_name, plot_branch, rotor_color, values_of
from .article_formulas import side_radius
from .field_components import STUDY as FIELD_COMPONENTS
from .force_curve import STUDY as FORCE_CURVE
from .levitation_distance import STUDY as LEVITATION_DISTANCE

STUDIES = (FIELD_COMPONENTS, FORCE_CURVE, LEVITATION_DISTANCE)

__all__ = [
    "CONFIGURATIONS",
    "FLIGHT",
    "FLOATER",
    "HIGHEST",
    "LOWEST",
    "PLATE_CONDUCTIVITY",
    "PLATE_SIZE",
    "QUICK",
    "REMANENCE",
    "STUDIES",
    "TITLES",
    "article_scene",
    "article_table",
    "axis_label",
    "by_configuration",
    "legend_name",
    "levitated_rotors",
    "plot_branch",
    "rotor_color",
    "rotor_label",
    "side_radius",
    "stable_in_flight",
    "values_of",
]
