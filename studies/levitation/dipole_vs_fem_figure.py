"""Figures of the study that compares the point dipole with true fields, from its dataset alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..article import TITLES, by_configuration, rotor_label, rotor_panels
from ..results import PAGE, PALETTE, panels, styled

CAUSES = {
    "floater's permeability": ("article", "dipole"),
    "shape": ("dipole", "cuboid"),
    "rotor's permeability": ("cuboid", "fem"),
    "mutual magnetisation": ("fem", "mutual"),
}
"""What lies between two models."""
TOTAL = ("article", "mutual")
ENDS = {"contact": ("v", "ends at the rotor"), "border": ("^", "goes on beyond")}
"""Upper ends that are no loss of stability."""


def change(result: xr.Dataset, name: str, models: tuple[str, str]) -> tuple[xr.DataArray, xr.DataArray]:
    """By how much a quantity is larger in the second model than in the first, and the estimated error."""
    first, second = models
    value = result[name].sel(model=second) - result[name].sel(model=first)
    return value, result[f"{name}_error"].sel(model=second) + result[f"{name}_error"].sel(model=first)


@styled
def distances_figure(result: xr.Dataset) -> Figure:
    """The levitation distance by point dipoles and by true fields."""
    figure, (axes,) = panels(1, 3, (PAGE, 2.8), sharey=True)
    for panel, (configuration, part) in zip(axes, by_configuration(result), strict=False):
        _distances(panel, part)
        panel.set(xlabel="frequency of the rotor (Hz)", title=TITLES[configuration])
    axes[0].set_ylabel("levitation distance (mm)")
    return figure


@styled
def causes_figure(result: xr.Dataset) -> Figure:
    """By how much each cause changes the distance: mean and range over the frequencies."""
    figure, axes = _one_panel_each(result, _causes)
    axes[0].set_ylabel("change of the distance (mm)")
    axes[2].legend(loc="lower right")
    return figure


@styled
def ranges_figure(result: xr.Dataset) -> Figure:
    """The frequencies of stable levitation by point dipoles and by true fields."""
    figure, axes = _one_panel_each(result, _ranges)
    axes[0].set_ylabel("frequencies of stable levitation (Hz)")
    axes[1].legend(loc="upper right")
    return figure


FIGURES = {
    "dipole-vs-fem-distance": distances_figure,
    "dipole-vs-fem-causes": causes_figure,
    "dipole-vs-fem-ranges": ranges_figure,
}


def _one_panel_each(result: xr.Dataset, draw: Callable[[Axes, xr.Dataset], None]) -> tuple[Figure, Any]:
    """A panel for each configuration, drawn by `draw`."""
    figure, axes = rotor_panels(result, 2.8, sharey=True)
    for panel, (_, part) in zip(axes, by_configuration(result), strict=False):
        draw(panel, part)
    return figure, axes


def _distances(axes: Axes, part: xr.Dataset) -> None:
    kind = str(part["configuration"].values[0])
    for k, color in zip(range(part.sizes["case"]), PALETTE, strict=False):
        one = part.isel(case=k)
        for model, style in (("article", "--"), ("mutual", "-")):
            frequency, distance = one["frequency"], 1e3 * one["distance"].sel(model=model)
            text = rotor_label(kind, float(one["measure"])) if model == "mutual" else None
            fill = color if text else "white"
            axes.plot(frequency, distance, f"o{style}", ms=2.5, mfc=fill, color=color, label=text)
    axes.plot([], [], "--", color="0.3", label="point dipoles")
    axes.plot([], [], "-", color="0.3", label="true fields")
    axes.legend()


def _causes(axes: Axes, part: xr.Dataset) -> None:
    width = 0.8 / (len(CAUSES) + 1)
    for k, (cause, models) in enumerate([*CAUSES.items(), ("all together", TOTAL)]):
        value, error = (1e3 * values.values for values in change(part, "distance", models))
        places = np.arange(len(value)) + (k - len(CAUSES) / 2) * width
        mean = value.mean(axis=1)
        spread = np.array([mean - (value - error).min(axis=1), (value + error).max(axis=1) - mean])
        color = "0.3" if models == TOTAL else PALETTE[k]
        axes.bar(places, mean, width, color=color, label=cause, yerr=spread, error_kw={"lw": 0.7, "capsize": 1.5})
    axes.axhline(0.0, color="0.3", lw=0.8)


def _ranges(axes: Axes, part: xr.Dataset) -> None:
    for model, offset, color, name in (
        ("article", -0.2, PALETTE[5], "point dipoles"),
        ("mutual", 0.2, PALETTE[0], "true fields"),
    ):
        low, high = (part[name].sel(model=model).values for name in ("lowest", "highest"))
        places = np.arange(len(low)) + offset
        axes.bar(places, high - low, 0.35, bottom=low, color=color, label=name)
        for end, values in (("lowest", low), ("highest", high)):
            error = part[f"{end}_error"].sel(model=model).values
            axes.errorbar(places, values, error, fmt="none", ecolor="0.1", lw=1)
        axes.use_sticky_edges = False
        for kind, (marker, words) in ENDS.items():
            ends = part["high_kind"].sel(model=model).values == kind
            axes.plot(places[ends], high[ends], marker, color="k", ms=4, label=words if model == "article" else None)
    axes.margins(y=0.08)
