"""Figures of the study of the plate's damping, from its dataset alone."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from ...geometry.basics import Array
from ..article import rotor_label
from ..results import PAGE, PALETTE, cases_with, legend_below, panels, styled
from .plate_cases import ROTORS

SWEEPS = {
    "below": ("Plate below", "distance of the face from the floater's centre (mm)", 1e3),
    "beside": ("Plate standing beside", "distance of the face from the floater's centre (mm)", 1e3),
    "frequency": ("Frequency", "frequency of the rotor (Hz)", 1.0),
    "conductivity": ("Conductivity", "conductivity (MS/m)", 1e-6),
    "thickness": ("Thickness", "thickness (mm)", 1e3),
}
DISTANCES = (10, 15, 20, 30, 40, 60)
LIMITS = (8.0, 66.0)
"""Of the axis of distances, mm."""
MODELS = {"": ("infinite slab", "o-", 3.0), ", real plate": ("real plate", "s", 6.0)}
"""By the ending of a sweep's name: what the plate is, its marks and their size."""
LINEAR = 0.1
"""Growth rates below this are drawn on a linear scale, 1/s."""
MEANS = (
    ("Equilibrium moved by", "displacement (mm)"),
    ("Mean force, up", "of the weight (%)"),
    ("Braking torque on the floater", "torque (µN m)"),
    ("Loss in the plate", "loss (mW)"),
)
"""Titles and labels of what `means` gives."""
LIFT = 1
"""Which of them has both signs."""


def means(part: xr.Dataset) -> tuple[Array, Array, Array, Array]:
    """What a plate does on average: displacement (mm), force up (% of the weight), braking torque (µN m), loss (mW)."""
    moved = 1e3 * np.linalg.norm(part["shift"].values, axis=-1)
    lift = 100 * part["force"].sel(axis="z").values / float(part.attrs["weight_N"])
    return np.asarray(moved), lift, -1e6 * part["torque"].sel(axis="z").values, 1e3 * part["loss"].values


@styled
def places_figure(result: xr.Dataset) -> Figure:
    """Growth of each small motion against the plate's distance, below the floater and beside it."""
    figure, axes = _growths(result, ("below", "beside"))
    for ending, (name, style, size) in MODELS.items():
        if part_of(result, f"below{ending}").sizes["case"]:
            axes[0].plot([], [], style, ms=size, mfc="none" if ending else "0.3", color="0.3", label=name)
    legend_below(figure, axes[0], columns=7)
    _mark_distances(axes)
    return figure


@styled
def materials_figure(result: xr.Dataset) -> Figure:
    """Growth of each small motion against frequency, conductivity and thickness, plate 18 mm below the floater."""
    figure, axes = _growths(result, ("frequency", "conductivity", "thickness"))
    legend_below(figure, axes[0])
    return figure


@styled
def rotors_figure(result: xr.Dataset) -> Figure:
    """Growth of the least damped motion of every rotor of the article, plate below and beside."""
    figure, ((axes,),) = panels(1, 1, (0.7 * PAGE, 3.0))
    _rotors(axes, result)
    return figure


@styled
def means_figure(result: xr.Dataset) -> Figure:
    """What the plate does on average: it moves the floater, pushes it, brakes it and is warmed."""
    figure, axes = panels(2, 2, (0.8 * PAGE, 4.4), sharex=True)
    for number, (panel, (title, words)) in enumerate(zip(axes.flat, MEANS, strict=True)):
        _mean(panel, result, number)
        panel.set(title=title, ylabel=words, yscale="linear" if number == LIFT else "log")
    _mark_distances(axes.ravel())
    for panel in axes[1]:
        panel.set_xlabel("distance of the face (mm)")
    legend_below(figure, axes[0, 0])
    return figure


FIGURES = {
    "plate-damping-distance": places_figure,
    "plate-damping-material": materials_figure,
    "plate-damping-rotors": rotors_figure,
    "plate-damping-means": means_figure,
}


def _growths(result: xr.Dataset, sweeps: Sequence[str]) -> tuple[Figure, Any]:
    """A panel for each sweep."""
    figure, (axes,) = panels(1, len(sweeps), (PAGE, 3.2), sharey=True)
    for panel, sweep in zip(axes, sweeps, strict=True):
        title, words, scale = SWEEPS[sweep]
        _growth(panel, result, sweep, scale)
        panel.set(title=title, xlabel=words)
    axes[0].set_ylabel("growth rate (1/s)")
    return figure, axes


def _mark_distances(panels: Iterable[Axes]) -> None:
    """The same marks on each, whatever was drawn: first none may choose limits by itself."""
    for axes in panels:
        axes.autoscale(enable=False, axis="x")
    for axes in panels:
        axes.set(xlim=LIMITS, xscale="log")
        axes.set_xticks(DISTANCES, [f"{d:g}" for d in DISTANCES])
        axes.xaxis.set_minor_locator(NullLocator())


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
                mfc="none" if ending else color, color=color, label=None if ending else str(mode),
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
    axes.set(title="Rotors of the article, plate at 18 mm", ylabel="growth of the least\ndamped motion (1/s)")
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
