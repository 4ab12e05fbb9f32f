"""Figures of a run, drawn from its result file alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ...geometry.common import Array
from .style import COLORS, DASHES, NAMES, PALETTE, fixed_panels, power_of_ten, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RIGHT_ABOVE: Any = {"ha": "left", "va": "bottom", "xytext": (4, 2)}
LEFT_BELOW: Any = {"ha": "right", "va": "top", "xytext": (-4, -2)}


@styled
def field_figure(result: xr.Dataset) -> Figure:
    """Field components on the axis below the rotor for every model, and how far the models are apart."""
    figure, ((left, right),) = fixed_panels(1, 2, (8.0, 3.4))
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
    middle = len(distance) // 2
    sizes = {"across the axis": 1e3 * np.hypot(*true[middle, :2]), "along the axis": 1e3 * np.abs(true[middle, 2])}
    for name, size in sizes.items():
        where = RIGHT_ABOVE if size == max(sizes.values()) else LEFT_BELOW
        left.annotate(name, (distance[middle], size), textcoords="offset points", **where)
    left.set(xlabel="distance below the rotor (mm)", ylabel="B (mT)", title="Field on the axis")
    right.set(xlabel="distance below the rotor (mm)", ylabel="|ΔB| / |B|", title=f"Difference from {NAMES[reference]}")
    right.minorticks_off()  # many decades
    for panel in (left, right):
        panel.yaxis.set_major_formatter(power_of_ten)
    left.legend(loc="upper right")  # fields fall
    right.legend()
    return figure


@styled
def force_figure(result: xr.Dataset) -> Figure:
    """Axial force against distance with its equilibria marked, for every model that has them; a zoom on the first."""
    figure, ((axes, near),) = fixed_panels(1, 2, (8.0, 3.8), lines_below=3)
    weight = -1e3 * float(result.attrs["weight_N"])
    for panel in (axes, near):
        panel.axhline(weight, color="0.3", lw=0.8, label="weight of the floater")
        for model in dict.fromkeys(result["curve_model"].values.tolist()):
            _draw_curves(panel, result, model)
            _mark_equilibria(panel, result, model, weight)
        for marker, fill, label in MARKS if _with_plate(result).any() else MARKS[:2]:
            panel.plot([], [], marker, color="0.3", mfc=fill or "0.3", label=label)
        panel.set(xlabel="distance below the rotor (mm)")
    axes.set(xlim=(5, 60), ylabel="axial magnetic force (mN), up positive", title="Force on the balanced floater")
    if weight > 0:
        axes.set_ylim(-2.5 * weight, 3.5 * weight)
    first = _first_distance(result)
    if first is None or weight <= 0:
        near.set_axis_off()
    else:
        near.set(xlim=(first - 1.0, first + 1.0), ylim=(0.0, 2 * weight), title="Where it floats")
    figure.legend(*axes.get_legend_handles_labels(), loc="lower center", ncols=3)
    return figure


MARKS = (
    ("o", None, "stable, no plate"),
    ("o", "white", "unstable, no plate"),
    ("D", None, "stable, with the plate"),
    ("D", "white", "unstable, with the plate"),
)


def _draw_curves(axes: Axes, result: xr.Dataset, model: str) -> None:
    curves = result[["curve_model", "curve_number", "curve_position", "curve_force"]]  # not the flight's many samples
    curves = curves.isel(curve_point=(curves["curve_model"] == model).values)
    for number in np.unique(curves["curve_number"]):
        points = curves.isel(curve_point=(curves["curve_number"] == number).values)
        distance, force = -1e3 * points["curve_position"].sel(axis="z").values, 1e3 * points["curve_force"].values
        axes.plot(*_smooth(np.arange(len(force), dtype=float), distance, force), DASHES[model], color=COLORS[model])
    axes.plot([], [], DASHES[model], color=COLORS[model], label=NAMES[model])


def _mark_equilibria(axes: Axes, result: xr.Dataset, model: str, weight: float) -> None:
    """Circles without the plate's currents, diamonds with them; filled where stable."""
    here = result["equilibrium_model"] == model
    felt = _with_plate(result)
    for plate, marker in ((False, "o"), (True, "D")):
        for stable, fill in ((1, COLORS[model]), (0, "white")):
            chosen = here & (felt == plate) & (result["equilibrium_stable"] == stable)
            distance = -1e3 * result["equilibrium_position"].sel(axis="z").where(chosen).dropna("equilibrium").values
            axes.plot(distance, np.full(distance.shape, weight), marker, color=COLORS[model], mfc=fill, ms=5)


def _with_plate(result: xr.Dataset) -> xr.DataArray:
    """Which equilibria feel the plate's currents; older results do not say."""
    return xr.DataArray(result.get("equilibrium_with_plate", 0 * result["equilibrium_stable"]) == 1)


def _first_distance(result: xr.Dataset) -> float | None:
    """Where the first stable equilibrium is, mm."""
    chosen = result["equilibrium_position"].sel(axis="z").where(result["equilibrium_stable"] == 1)
    distances = -1e3 * chosen.dropna("equilibrium").values
    return float(distances[0]) if len(distances) else None


PARTS = 120
"""Intervals of an envelope: more than a printed figure tells apart."""
SHOWN = 200
"""Samples of a flight that are drawn one by one."""
COARSE = 0.05
"""Interval of samples (s) that lets a bounce pass unseen: a line through them would show slow motions that are none."""
HOURS = 7200.0
"""Flights that take longer are drawn over hours, s."""


@styled
def trajectory_figure(result: xr.Dataset) -> Figure:
    """Distance and polar angle of a flight as envelopes, and a closer look at its beginning, or at its end if lost."""
    figure, axes = fixed_panels(2, 2, (8.0, 5.4))
    seconds, moment = result["time"].values, result["moment"].values
    time, unit = (seconds / 3600, "h") if seconds[-1] > HOURS else (seconds, "s")
    distance = -1e3 * result["position"].sel(axis="z").values
    angle = np.degrees(np.arctan2(np.hypot(moment[:, 0], moment[:, 1]), moment[:, 2]))
    up = str(result.attrs.get("ended_by", "duration")) in ("duration", "stopped")
    near = slice(0, SHOWN) if up else slice(-SHOWN, None)
    _envelope(axes[0, 0], time, distance)
    _envelope(axes[1, 0], time, angle)
    for panel in axes[:, 0]:
        panel.axvspan(time[near][0], time[near][-1], color=PALETTE[4], alpha=0.4, lw=0, label="shown on the right")
        if "lowered_from_s" in result.attrs:
            lowered = np.array(_lowering(result, seconds)) * time[-1] / seconds[-1]
            panel.axvspan(*lowered, color="0.88", lw=0, zorder=0, label="plate is lowered")
        panel.set_xlabel(f"time ({unit})")
    axes[0, 0].legend(frameon=True, framealpha=0.9, edgecolor="none")
    seen = {"rotor's frame": "position_rotor_frame", "laboratory": "position"}  # the one in which it moves less
    moved = {frame: np.ptp(result[name].values[near], axis=0).max() for frame, name in seen.items()}
    frame = min(moved, key=lambda frame: moved[frame])
    turned = 1e3 * result[seen[frame]].values[near]
    step = float(np.diff(seconds[near]).max(initial=0.0))
    look = "A closer look"
    if step > COARSE:
        look = f"{look}: a sample every {step:.2g} s"
        axes[0, 1].plot(time[near], distance[near], ".", ms=3)
        axes[1, 1].plot(turned[:, 0], turned[:, 1], ".", ms=3)
    else:
        axes[0, 1].plot(*_smooth(time[near], time[near], distance[near]), lw=0.8)
        axes[1, 1].plot(*_smooth(time[near], turned[:, 0], turned[:, 1]), lw=0.8)
    axes[1, 1].plot(*turned[-1, :2], "o", color=PALETTE[1], ms=4, label="end")
    axes[1, 1].legend()
    axes[0, 0].set(ylabel="distance along the axis (mm)", title="Distance: smallest, mean, largest")
    axes[1, 0].set(ylabel="polar angle of the moment (°)", title="Polar angle: smallest, mean, largest")
    axes[0, 1].set(xlabel=f"time ({unit})", ylabel="distance along the axis (mm)", title=look)
    axes[1, 1].set(xlabel="x (mm)", ylabel="y (mm)", title=f"The same from above, {frame}")
    axes[1, 1].set(aspect="equal", adjustable="datalim")
    axes[1, 1].locator_params(axis="x", nbins=5)
    return figure


def _lowering(result: xr.Dataset, time: Array) -> tuple[float, float]:
    begins, ends = (min(float(result.attrs[f"lowered_{word}_s"]), float(time[-1])) for word in ("from", "until"))
    return begins, ends


def _envelope(axes: Axes, time: Array, values: Array) -> None:
    """Smallest, mean and largest value of each of many short intervals."""
    parts = np.array_split(np.arange(len(time)), min(PARTS, max(1, len(time) // 8)))
    middle, mean = (np.array([v[part].mean() for part in parts]) for v in (time, values))
    low, high = (np.array([pick(values[part]) for part in parts]) for pick in (np.min, np.max))
    axes.fill_between(middle, low, high, color=PALETTE[5], alpha=0.6, lw=0)
    axes.plot(middle, mean, color=PALETTE[0], lw=1.0)


def _smooth(parameter: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Points of a smooth curve through samples (n,) at a growing parameter (n,): cubics that share slopes.

    SciPy's splines take longer to load than the figure to draw.
    """
    if len(parameter) < 4:
        return x, y
    fine = np.linspace(parameter[0], parameter[-1], 12 * len(parameter))
    before = np.clip(np.searchsorted(parameter, fine, side="right") - 1, 0, len(parameter) - 2)
    step = np.diff(parameter)[before]
    part = (fine - parameter[before]) / step
    rest = 1 - part

    def between(values: Array) -> Array:
        slope = np.gradient(values, parameter, edge_order=2)
        low, high = values[before], values[before + 1]
        leaving, coming = step * slope[before], step * slope[before + 1]
        return rest**2 * (low + part * (2 * low + leaving)) + part**2 * (high + rest * (2 * high - coming))

    return between(x), between(y)
