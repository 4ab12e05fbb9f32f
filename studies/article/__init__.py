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
    label,
    levitated,
    stable,
)
from .article_figure import TITLES, branch, name, shade, values_of
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
    "branch",
    "by_configuration",
    "label",
    "levitated",
    "name",
    "shade",
    "side_radius",
    "stable",
    "values_of",
]
