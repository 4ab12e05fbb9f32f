"""What did the article compute, and what do true fields say?"""

from .article import (
    CONFIGURATIONS as CONFIGURATIONS,
    EDGE as EDGE,
    FLIGHT as FLIGHT,
    FLOATER as FLOATER,
    HIGHEST as HIGHEST,
    LOWEST as LOWEST,
    PLATE_CONDUCTIVITY as PLATE_CONDUCTIVITY,
    PLATE_SIZE as PLATE_SIZE,
    QUICK as QUICK,
    REMANENCE as REMANENCE,
    article_scene as article_scene,
    axis_label as axis_label,
    by_configuration as by_configuration,
    conducting as conducting,
    levitated_rotors as levitated_rotors,
    levitation_of as levitation_of,
    rotor_label as rotor_label,
    stable_in_flight as stable_in_flight,
)
from .article_figure import (
    TITLES as TITLES,
    legend_name as legend_name,
    plot_branch as plot_branch,
    rotor_color as rotor_color,
    rotor_panels as rotor_panels,
    values_of as values_of,
)
from .article_formulas import side_radius as side_radius
from .field_components import STUDY as FIELD_COMPONENTS
from .force_curve import STUDY as FORCE_CURVE
from .levitation_distance import STUDY as LEVITATION_DISTANCE

STUDIES = (FIELD_COMPONENTS, FORCE_CURVE, LEVITATION_DISTANCE)
