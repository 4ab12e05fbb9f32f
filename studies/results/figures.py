"""Figures of a run, drawn from its result file alone."""

import io
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import matplotlib as mpl
import numpy as np
import xarray as xr
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...fem.storage import write_whole

PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
"""Colours of M. Okabe and K. Ito, which all kinds of colour vision tell apart."""
STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 10,
    "legend.fontsize": 7,
    "lines.linewidth": 1.2,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.prop_cycle": cycler(color=PALETTE),
    "legend.frameon": False,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}
NAMES = {
    "dipole": "point dipole",
    "cuboid": "cuboid, closed form (μr = 1)",
    "fem": "finite elements",
    "moments": "moments",
    "map": "map",
}
COLORS = dict(zip(NAMES, PALETTE, strict=False))
DASHES = {"dipole": "--", "cuboid": "-.", "fem": "-", "moments": ":", "map": "-"}
Draw = TypeVar("Draw", bound=Callable[..., Figure])


def styled(draw: Draw) -> Draw:
    """Let a function draw in the project's style."""

    @wraps(draw)
    def inside(*arguments: Any, **options: Any) -> Figure:
        with mpl.rc_context(STYLE):
            return draw(*arguments, **options)

    return cast("Draw", inside)


def panels(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, Any]:
    """A figure without a window and its axes (rows, columns); `size` in inches."""
    figure = Figure(figsize=size)
    return figure, figure.subplots(rows, columns, squeeze=False)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure; the format follows the suffix."""
    write_whole(path, figure_bytes(figure, path.suffix[1:]))


def figure_bytes(figure: Figure, kind: str) -> bytes:
    """The figure as the content of a file of the kind `png` or `pdf`."""
    stream = io.BytesIO()
    with mpl.rc_context(STYLE):
        figure.savefig(stream, format=kind)
    return stream.getvalue()


@styled
def field_figure(result: xr.Dataset) -> Figure:
    """Field components on the axis below the rotor for every model, and how far the models are apart."""
    figure, ((left, right),) = panels(1, 2, (8.0, 3.4))
    distance = -1e3 * result["axis_height"].values
    reference = str(result.attrs["best_model"])
    true = result["axis_field"].sel(model=reference).values
    for model in result["model"].values.tolist():
        field, color = result["axis_field"].sel(model=model).values, COLORS[model]
        left.semilogy(
            distance, 1e3 * np.hypot(field[:, 0], field[:, 1]), DASHES[model], color=color, label=NAMES[model]
        )
        left.semilogy(distance, 1e3 * np.abs(field[:, 2]), DASHES[model], color=color)
        if model != reference:
            apart = np.linalg.norm(field - true, axis=1) / np.linalg.norm(true, axis=1)
            right.semilogy(distance, apart, DASHES[model], color=color, label=NAMES[model])
    error = result["axis_error"].sel(model=reference).values
    right.fill_between(distance, np.nanmin(error) / 3, error, color="0.85", label=f"error estimate, {NAMES[reference]}")
    for column, name in ((0, "off-axis $B_\\perp$"), (2, "on-axis $|B_z|$")):
        place = (distance[-1], 1e3 * np.abs(true[-1, column]))
        left.annotate(name, place, ha="right", va="bottom", xytext=(0, 6), textcoords="offset points")
    left.set(xlabel="distance below the rotor (mm)", ylabel="B (mT)", title="Field on the axis")
    right.set(xlabel="distance below the rotor (mm)", ylabel="|ΔB| / |B|", title=f"Difference from {NAMES[reference]}")
    left.legend()
    right.legend()
    return figure


@styled
def force_figure(result: xr.Dataset) -> Figure:
    """Axial force against distance with its equilibria marked, for every model that has them."""
    figure, ((axes,),) = panels(1, 1, (5.5, 3.8))
    weight = -1e3 * float(result.attrs["weight_N"])
    axes.axhline(weight, color="0.3", lw=0.8, label="weight of the floater")
    for model in dict.fromkeys(result["curve_model"].values.tolist()):
        on_model = result["curve_model"] == model
        for number in np.unique(result["curve_number"].where(on_model, drop=True)):
            points = result.where(on_model & (result["curve_number"] == number), drop=True)
            distance = -1e3 * points["curve_position"].sel(axis="z")
            axes.plot(distance, 1e3 * points["curve_force"], DASHES[model], color=COLORS[model])
        axes.plot([], [], DASHES[model], color=COLORS[model], label=NAMES[model])
        _mark_equilibria(axes, result, model, weight)
    axes.plot([], [], "o", color="0.3", label="stable equilibrium")
    axes.plot([], [], "o", color="0.3", mfc="white", label="unstable equilibrium")
    axes.set(xlabel="distance below the rotor (mm)", ylabel="axial magnetic force (mN), up positive")
    axes.set(xlim=(5, 60), title="Force where everything else is balanced")
    if weight > 0:
        axes.set_ylim(-2.5 * weight, 3.5 * weight)
    axes.legend(loc="upper right")
    return figure


def _mark_equilibria(axes: Axes, result: xr.Dataset, model: str, weight: float) -> None:
    here = result["equilibrium_model"] == model
    for stable, fill in ((1, COLORS[model]), (0, "white")):
        chosen = result["equilibrium_position"].sel(axis="z").where(here & (result["equilibrium_stable"] == stable))
        distance = -1e3 * chosen.dropna("equilibrium").values
        axes.plot(distance, np.full(distance.shape, weight), "o", color=COLORS[model], mfc=fill, ms=5)


@styled
def trajectory_figure(result: xr.Dataset) -> Figure:
    """Height, side orbit in the rotor's frame and in the laboratory's, and polar angle of a flight."""
    figure, axes = panels(2, 2, (8.0, 5.6))
    time = result["time"].values
    position = 1e3 * result["position"].values
    turned = 1e3 * result["position_rotor_frame"].values
    moment = result["moment"].values
    axes[0, 0].plot(time, -position[:, 2], lw=0.6)
    axes[0, 0].set(xlabel="time (s)", ylabel="distance below the rotor (mm)", title="Height")
    axes[0, 1].plot(time, np.degrees(np.arctan2(np.hypot(moment[:, 0], moment[:, 1]), moment[:, 2])), lw=0.6)
    axes[0, 1].set(xlabel="time (s)", ylabel="polar angle of the moment (°)", title="Polar angle")
    frames = ((axes[1, 0], position, "laboratory frame"), (axes[1, 1], turned, "rotor's frame"))
    for panel, orbit, name in frames:
        panel.plot(orbit[:, 0], orbit[:, 1], lw=0.4)
        panel.set(xlabel="x (mm)", ylabel="y (mm)", title=f"Side orbit, {name}", aspect="equal", adjustable="datalim")
    return figure
