"""Figure and sentences of the study of designs, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from ..article import CONFIGURATIONS, axis_label
from ..results import PAGE, PALETTE, cases_with, panels, styled


def wanted(result: xr.Dataset) -> list[tuple[float, float]]:
    """The pairs of distance (m) and frequency (Hz) that were asked for."""
    pairs = zip(result["wanted_distance"].values, result["wanted_frequency"].values, strict=True)
    return sorted({(float(d), float(f)) for d, f in pairs})


def _wish(result: xr.Dataset, distance: float, frequency: float) -> list[xr.Dataset]:
    """What each configuration answers to one of them."""
    found = cases_with(result, wanted_distance=distance, wanted_frequency=frequency)
    return [found.isel(case=k) for k in range(found.sizes["case"])]


@styled
def design_figure(result: xr.Dataset) -> Figure:
    """Stability margin against the cubes' edge for every configuration and wish, with the measure that it takes."""
    wishes = wanted(result)
    columns = len({f for _, f in wishes})
    figure, axes = panels(len(wishes) // columns, columns, (PAGE, 2.3 * len(wishes) / columns + 0.2))
    for place, (distance, frequency) in zip(axes.flat, wishes, strict=True):
        for one in _wish(result, distance, frequency):
            _margins(place, one)
        place.set_title(f"{1e3 * distance:g} mm at {frequency:g} Hz")
        place.yaxis.set_major_formatter(PercentFormatter(1.0))
        place.margins(y=0.15)
        place.set(ylim=(-0.02, None))
        place.legend(loc="upper left")
    for place in axes[-1]:
        place.set_xlabel("edge of the cubes (mm)")
    for place in axes[:, 0]:
        place.set_ylabel("margin in frequency")
    return figure


FIGURES = {"design": design_figure}


def _margins(place: Axes, one: xr.Dataset) -> None:
    kind = str(one["configuration"].values)
    color = PALETTE[list(CONFIGURATIONS).index(kind)]
    edges, margin, measure = 1e3 * one["edge"].values, one["margin"].values, one["measure"].values
    place.plot(edges, margin, "o-", ms=3, color=color, label=f"{kind}, {axis_label(kind)}")
    for edge, height, value in zip(edges, margin, measure, strict=True):
        if np.isfinite(height) and height > 0:
            place.annotate(
                f"{value:.2g}", (edge, height), xytext=(0, 3), textcoords="offset points", ha="center",
                fontsize=6, color=color,
            )  # fmt: skip


def design_lines(result: xr.Dataset) -> list[str]:
    """The best rotor for each wish, checked by a forward search in the true field."""
    lines = []
    for distance, frequency in wanted(result):
        lines.append(f"{1e3 * distance:g} mm at {frequency:g} Hz:")
        lines += [f"  {_best(one)}" for one in _wish(result, distance, frequency)]
    return lines


def _best(one: xr.Dataset) -> str:
    kind, best = str(one["configuration"].values), int(one["best"])
    if best < 0 or not float(one["margin"][best]) > 0:
        return f"{kind}: no edge gives stable levitation there."
    at = one.isel(edge=best)
    symbol, unit = CONFIGURATIONS[kind].symbol, CONFIGURATIONS[kind].unit
    found = (
        f"{kind}: edge {1e3 * float(at['edge']):g} mm, {symbol} = {float(at['measure']):.3f} {unit} (closed "
        f"form), margin {100 * float(at['margin']):.1f} % ({float(at['lowest']):.1f} to {float(at['highest']):.1f} Hz)"
    )
    if not np.isfinite(float(one["true_distance"])):
        return f"{found}; the true field was not met."
    state = "stable" if float(one["true_stable"]) else f"UNSTABLE, {float(one['true_growth']):.2g} /s"
    return (
        f"{found}; true field: {symbol} = {float(one['true_measure']):.3f} {unit} gives "
        f"{1e3 * float(one['true_distance']):.4f} ± {1e3 * float(one['true_distance_error']):.1g} mm, {state}."
    )
