"""On-axis and off-axis field at several places of the floater against the parameter of each of the article's rotors."""

import numpy as np
import xarray as xr

from ..one_scene import sources
from ..results import Point, Study, by_case, one_case, variable
from .article import CONFIGURATIONS, article_scene, levitation_of
from .article_formulas import field
from .field_components_figure import FIGURES, components_lines

DISTANCES = (15e-3, 20e-3, 25e-3, 30e-3, 40e-3)
"""Places of the floater on the axis below the rotor, m; the article's text does not give its own."""
MODELS = ("article", "dipole", "cuboid", "fem")


def field_points(quick: bool) -> list[Point]:
    """Every rotor of the article; `quick` takes the first, the middle and the last of each configuration."""
    return [
        {"configuration": name, "value": value, "model": model}
        for name, kind in CONFIGURATIONS.items()
        for value in (kind.tested[:: (len(kind.tested) - 1) // 2] if quick else kind.tested)
        for model in MODELS
    ]


def field_components(point: Point) -> xr.Dataset:
    """Field of one rotor by one model.

    Returns
    -------
    Dataset over `distance`: |B⊥| and B_z, in tesla, and the model's own estimate of the error of either (0 for the
    article's formula, which states none).
    """
    distance = np.array(DISTANCES)
    if point["model"] == "article":
        across, along = field(point["configuration"], point["value"], distance)
        error = np.zeros_like(distance)
    else:
        scene = article_scene(point["configuration"], point["value"])
        table = sources(levitation_of(scene, point["model"]).table)
        places = distance[:, None] * np.array([0.0, 0.0, -1.0])
        b, _ = table.evaluate(places)
        across, along, error = np.hypot(b[:, 0], b[:, 1]), b[:, 2], table.absolute_error(places)[0]
    return one_case(
        point,
        xr.Dataset(
            {
                "off_axis": variable(("distance",), across, "T", "field across the axis"),
                "on_axis": variable(("distance",), along, "T", "field along the axis"),
                "field_error": variable(("distance",), error, "T", "estimated error of the field"),
            },
            {"distance": variable(("distance",), distance, "m", "distance below the rotor's origin")},
        ),
    )


STUDY = Study(
    name="field-components",
    summary="off-axis and on-axis field against the parameter of each rotor of the article, by four models",
    points=field_points,
    compute=field_components,
    gather=by_case,
    figures=FIGURES,
    report=components_lines,
)
