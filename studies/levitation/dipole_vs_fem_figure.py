"""Figure of the study that compares the point dipole with true fields, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..article import axis_label, by_configuration, rotor_label
from ..results import PALETTE, panels, styled

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
def dipole_figure(result: xr.Dataset) -> Figure:
    """Distance by point dipoles and by true fields; the change of distance by cause; ranges of stable levitation."""
    figure, axes = panels(3, 3, (10.0, 9.0))
    for column, (configuration, part) in enumerate(by_configuration(result)):
        _distances(axes[0, column], part)
        _causes(axes[1, column], part)
        _ranges(axes[2, column], part)
        axes[0, column].set_title(configuration)
        for row in (1, 2):
            axes[row, column].set_xticks(range(part.sizes["case"]), [f"{m:g}" for m in part["measure"].values])
            axes[row, column].set_xlabel(axis_label(configuration))
            axes[row, column].set_xlim(-0.6, part.sizes["case"] - 0.4)
    handles = [*axes[1, 0].get_legend_handles_labels()[0], *axes[2, 0].get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


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
    axes.set(xlabel="frequency of the rotor (Hz)", ylabel="levitation distance (mm)")
    axes.legend(fontsize=6)


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
    axes.set(ylabel="change of the distance (mm):\nmean and range over the frequencies")


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
    axes.set(ylabel="frequencies of stable levitation (Hz)")
