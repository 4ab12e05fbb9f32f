"""What the figures after the article have in common: a colour for each value of a rotor's parameter, and branches."""

from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..results import PAGE, panels
from .article import CONFIGURATIONS, axis_label, by_configuration, rotor_label

TITLES = {
    "horizontal": "Cube displaced by δx",
    "vertical": "Two cubes, δz apart",
    "tilt": "Cube tilted by δθ",
}


def one_panel_each(height: float, **shared: Any) -> tuple[Figure, Any]:
    """A panel (3,) side by side for each configuration, `height` inches high; `shared` are options of `panels`."""
    figure, (axes,) = panels(1, len(CONFIGURATIONS), (PAGE, height), **shared)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        panel.set_title(TITLES[configuration])
    return figure, axes


def rotor_panels(result: xr.Dataset, height: float, **shared: Any) -> tuple[Figure, Any]:
    """A panel (3,) for each configuration of a joined result, with a numbered place for each of its rotors."""
    figure, (axes,) = panels(1, len(CONFIGURATIONS), (PAGE, height), **shared)
    for panel, (configuration, part) in zip(axes, by_configuration(result), strict=False):
        panel.set_xticks(range(part.sizes["case"]), [f"{m:g}" for m in part["measure"].values])
        panel.set(xlabel=axis_label(configuration), xlim=(-0.6, part.sizes["case"] - 0.4), title=TITLES[configuration])
    return figure, axes


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
