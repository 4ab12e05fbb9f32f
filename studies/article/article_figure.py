"""What the figures after the article have in common: a colour for each value of a rotor's parameter, and branches."""

from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ...geometry.basics import Array
from .article import CONFIGURATIONS, rotor_label

TITLES = {
    "horizontal": "Cube displaced by δx",
    "vertical": "Two cubes, δz apart",
    "tilt": "Cube tilted by δθ",
}


def rotor_color(configuration: str, value: float) -> tuple[float, ...]:
    """Colour of a rotor: dark to bright along viridis, which all kinds of colour vision tell apart."""
    tested = CONFIGURATIONS[configuration].tested
    place = (value - tested[0]) / (tested[-1] - tested[0])
    return tuple(mpl.colormaps["viridis"](0.92 * float(np.clip(place, 0, 1))))


def legend_name(configuration: str, value: float) -> str:
    """A rotor in a legend; with a star if it levitated in the experiment."""
    return rotor_label(configuration, value) + ("*" if value in CONFIGURATIONS[configuration].levitated else "")


def values_of(result: xr.Dataset, configuration: str) -> list[float]:
    """The values of a configuration's parameter that a result holds, ascending."""
    return sorted(set(result["value"].values[result["configuration"].values == configuration].tolist()))


def plot_branch(axes: Axes, x: Array, y: Array, solid: NDArray[np.bool_], **style: Any) -> None:
    """A curve, solid where `solid`, else dashed, without a gap between."""
    inside = solid & np.append(solid[1:], True) & np.append(True, solid[:-1])
    axes.plot(x, np.where(inside, np.nan, y), "--", **{**style, "label": None})
    axes.plot(x, np.where(solid, y, np.nan), "-", **style)
