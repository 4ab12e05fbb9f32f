"""Figures of a run, drawn from its result file alone."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..geometry.atomic import replacing

STYLE = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.prop_cycle": mpl.cycler(color=["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]),
    "legend.frameon": False,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}
"""Colours of M. Okabe and K. Ito, which all kinds of colour vision tell apart."""

NAMES = {"dipole": "point dipole", "cuboid": "cuboid, closed form (μr = 1)", "fem": "finite elements"}
DASHES = {"dipole": "--", "cuboid": "-.", "fem": "-"}


def new_figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, np.ndarray]:
    """A figure without a window, in the project's style, and its axes (rows, columns)."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size)
        return figure, figure.subplots(rows, columns, squeeze=False)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure; the format follows the suffix."""
    with mpl.rc_context(STYLE), replacing(path) as temporary:
        figure.savefig(temporary)


def field_figure(result: xr.Dataset) -> Figure:
    """Field components on the axis below the rotor for every model, and how far the models are apart."""
    figure, ((left, right),) = new_figure(1, 2, (8.0, 3.4))
    distance = -1e3 * result["axis_height"].values
    field = result["axis_field"]
    reference = str(result.attrs["best_model"])
    for model in field["model"].values:
        b = 1e3 * field.sel(model=model).values
        (line,) = left.plot(distance, b[:, 0], DASHES[model], label=f"$B_x$, {NAMES[model]}")
        left.plot(distance, b[:, 2], DASHES[model], color=line.get_color(), alpha=0.5, label=f"$B_z$, {NAMES[model]}")
        if model == reference:
            continue
        apart = np.linalg.norm(b - 1e3 * field.sel(model=reference).values, axis=1)
        apart /= np.linalg.norm(1e3 * field.sel(model=reference).values, axis=1)
        right.semilogy(distance, apart, DASHES[model], color=line.get_color(), label=NAMES[model])
    error = result["axis_error"].sel(model=reference).values
    right.fill_between(distance, error * 1e-3, error, color="0.8", label=f"error estimate, {NAMES[reference]}")
    left.set(xlabel="distance below the rotor (mm)", ylabel="B (mT)", yscale="symlog", title="Field on the axis")
    right.set(xlabel="distance below the rotor (mm)", ylabel=f"|ΔB|/B against {reference}", title="Difference")
    _crop(right, error)
    left.legend(fontsize=6)
    right.legend(fontsize=7)
    return figure


def _crop(axes: Axes, error: np.ndarray) -> None:
    axes.set_ylim(bottom=max(float(error.min()) * 0.3, 1e-16))


def force_figure(result: xr.Dataset) -> Figure:
    """Axial force against distance with its equilibria marked, for every model that has them."""
    figure, ((axes,),) = new_figure(1, 1, (5.5, 3.8))
    weight = -1e3 * float(result.attrs["weight_N"])
    axes.axhline(weight, color="0.3", lw=0.8, label="weight of the floater")
    for color, model in zip(("#0072B2", "#D55E00", "#009E73"), np.unique(result["curve_model"]), strict=False):
        on_curve = result["curve_model"] == model
        for number in np.unique(result["curve_number"].where(on_curve, drop=True)):
            points = result.where(on_curve & (result["curve_number"] == number), drop=True)
            distance = -1e3 * points["curve_position"].sel(axis="z")
            axes.plot(distance, 1e3 * points["curve_force"], DASHES[str(model)], color=color, lw=1.2)
        axes.plot([], [], DASHES[str(model)], color=color, label=NAMES[str(model)])
        here = result["equilibrium_model"] == model
        for stable, fill in ((True, color), (False, "white")):
            marked = here & (result["equilibrium_stable"] == stable)
            distance = -1e3 * result["equilibrium_position"].sel(axis="z").where(marked, drop=True)
            axes.plot(distance, np.full(distance.shape, weight), "o", color=color, mfc=fill, ms=5)
    axes.plot([], [], "o", color="0.3", label="stable equilibrium")
    axes.plot([], [], "o", color="0.3", mfc="white", label="unstable equilibrium")
    axes.set(xlabel="distance below the rotor (mm)", ylabel="axial magnetic force (mN), up positive")
    axes.set(ylim=(-2.5 * weight, 3.5 * weight) if weight > 0 else None, title="Force where all else is balanced")
    axes.legend(fontsize=7)
    return figure


def trajectory_figure(result: xr.Dataset) -> Figure:
    """Height, side orbit in the rotor's frame and in the laboratory's, and polar angle of a flight."""
    figure, axes = new_figure(2, 2, (8.0, 5.6))
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
