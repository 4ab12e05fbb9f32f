"""Figure of the study of the plate's damping, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from ...geometry.basics import Array
from ..article import rotor_label
from ..results import PALETTE, cases_with, panels, styled
from .plate_cases import ROTORS

SWEEPS = {
    "below": ("Plate below", "distance of the face from the floater's centre (mm)", 1e3),
    "beside": ("Plate standing beside", "distance of the face from the floater's centre (mm)", 1e3),
    "frequency": ("Frequency, plate 18 mm below", "frequency of the rotor (Hz)", 1.0),
    "conductivity": ("Conductivity, plate 18 mm below", "conductivity (MS/m)", 1e-6),
    "thickness": ("Thickness, plate 18 mm below", "thickness (mm)", 1e3),
}
DISTANCES = (10, 15, 20, 30, 40, 60)
MODELS = {"": ("infinite slab", "o-", 3.0), ", real plate": ("real plate", "s", 6.0)}
"""By the ending of a sweep's name: what the plate is, its marks and their size."""
LINEAR = 0.1
"""Growth rates below this are drawn on a linear scale, 1/s."""
MEANS = (
    ("Equilibrium moved by", "displacement (mm)"),
    ("Mean force along the axis", "up, of the weight (%)"),
    ("Braking torque (filled) and loss (open)", "torque on the floater (µN m)"),
)
"""Titles and labels of what `means` gives."""


def means(part: xr.Dataset) -> tuple[Array, Array, Array]:
    """What a plate does on average: displacement (mm), force up (% of the weight) and braking torque (µN m)."""
    moved = 1e3 * np.linalg.norm(part["shift"].values, axis=-1)
    lift = 100 * part["force"].sel(axis="z").values / float(part.attrs["weight_N"])
    return np.asarray(moved), lift, -1e6 * part["torque"].sel(axis="z").values


@styled
def damping_figure(result: xr.Dataset) -> Figure:
    """Growth of each small motion against place and material of the plate and over rotors; what it does on average."""
    figure, axes = panels(3, 3, (11.5, 9.0))
    places = (*axes[0], *axes[1, :2])
    for (sweep, (title, words, scale)), place in zip(SWEEPS.items(), places, strict=True):
        _growth(place, result, sweep, scale)
        place.set(title=title, xlabel=words, ylabel="growth rate (1/s)")
    for ending, (name, style, size) in MODELS.items():
        if part_of(result, f"below{ending}").sizes["case"]:
            axes[0, 1].plot([], [], style, ms=size, mfc="none" if ending else "0.3", color="0.3", label=name)
    axes[0, 0].legend(loc="lower right")
    axes[0, 1].legend(loc="lower right")
    _rotors(axes[1, 2], result)
    for number, (place, (title, words)) in enumerate(zip(axes[2], MEANS, strict=True)):
        _mean(place, result, number)
        place.set(title=title, xlabel="distance of the face (mm)", ylabel=words)
    _loss_beside(axes[2, 2], result)
    axes[2, 0].set_yscale("log")
    for place in (axes[0, 0], axes[0, 1], *axes[2]):
        place.set_xscale("log")
        place.set_xticks(DISTANCES, [f"{d:g}" for d in DISTANCES])
        place.xaxis.set_minor_locator(NullLocator())
    axes[2, 0].legend(loc="upper right")
    return figure


def part_of(result: xr.Dataset, sweep: str) -> xr.Dataset:
    """The cases of one sweep, in ascending order of what is varied."""
    part = cases_with(result, sweep=sweep)
    return part if sweep in ROTORS else part.sortby("value")


def _growth(axes: Axes, result: xr.Dataset, sweep: str, scale: float) -> None:
    for ending, (_, style, size) in MODELS.items():
        part = part_of(result, sweep + ending)
        varied = part["rotor_frequency" if sweep == "frequency" else "value"].values * scale
        for mode, color in zip(result["mode"].values, PALETTE, strict=False):
            growth, error = part["growth"].sel(mode=mode).values, part["error"].values
            axes.errorbar(
                varied, growth, yerr=np.abs(growth) * error, fmt=style, ms=size,
                mfc="none" if ending else color, color=color, label=None if ending or sweep != "below" else str(mode),
            )  # fmt: skip
    axes.set_xscale("linear" if sweep == "frequency" else "log")
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.margins(y=0.12)
    axes.axhline(0.0, color="0.3", lw=0.8)


def _rotors(axes: Axes, result: xr.Dataset) -> None:
    """Growth of the least damped motion of each rotor, plate below and beside."""
    for sweep, marker, color in zip(ROTORS, "os", PALETTE, strict=False):
        part = part_of(result, sweep)
        worst, error = part["growth"].max("mode").values, part["error"].values
        places = np.arange(part.sizes["case"])
        axes.errorbar(places, worst, np.abs(worst) * error, fmt=marker, ms=4, color=color, label=sweep.split(", ")[1])
        gone = places[np.isnan(worst)]
        axes.plot(gone, 0 * gone, "x", color=color, label="no equilibrium is left" if len(gone) else None)
        rotors = zip(part["configuration"].values, part["value"].values, strict=True)
        names = [rotor_label(str(configuration), float(value)) for configuration, value in rotors]
        axes.set_xticks(places, names, rotation=90, fontsize=7)
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.axhline(0.0, color="0.3", lw=0.8)
    axes.set(title="Rotors of the article, plate at 18 mm", ylabel="growth of the least damped motion (1/s)")
    axes.margins(x=0.08, y=0.12)
    axes.legend()


def _mean(axes: Axes, result: xr.Dataset, number: int) -> None:
    for sweep, style, color in (("below", "o-", PALETTE[0]), ("beside", "s--", PALETTE[1])):
        for ending, fill, line in (("", color, style), (", real plate", "none", style[0])):
            part = part_of(result, sweep + ending)
            if part.sizes["case"]:
                values, error = means(part)[number], part["error"].values
                axes.errorbar(
                    part["value"].values * 1e3, values, np.abs(values) * error, fmt=line, ms=6 if ending else 3,
                    color=color, mfc=fill, label=f"{sweep}{ending}",
                )  # fmt: skip


def _loss_beside(axes: Axes, result: xr.Dataset) -> None:
    """The loss on an axis of its own."""
    twin = axes.twinx()
    for sweep, style, color in (("below", "o:", PALETTE[2]), ("beside", "s:", PALETTE[3])):
        part = part_of(result, sweep)
        distance, loss = part["value"].values * 1e3, 1e3 * part["loss"].values
        twin.plot(distance, loss, style, ms=3, mfc="white", color=color, label=f"loss, {sweep}")
    twin.set(yscale="log", ylabel="loss in the plate (mW)")
    axes.set_yscale("log")
    twin.grid(False)
    found = [each.get_legend_handles_labels() for each in (axes, twin)]
    axes.legend([*found[0][0], *found[1][0]], [*found[0][1], *found[1][1]], loc="lower left")
