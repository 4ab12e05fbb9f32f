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
