"""Figure and sentences of the map of stability, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..article import TITLES, axis_label, by_configuration, rotor_label
from ..results import COLORS, NAMES, PAGE, PALETTE, cases_with, panels, styled

MODELS = ("dipole", "fem")
FACE = -0.045
"""Height of the plate's upper face below the rotor's origin, m: no floater that levitates touches it."""
MARKERS = {"fold": "^", "oscillatory": "o", "real": "D", "contact": "v", "border": "_"}
MARKS = {"insulating": ("<", "flights of 250 s last up to here"), "conducting": ("*", "… with currents in the rotor")}
"""Marks of where averaged flights last, without and with eddy currents in the rotor's magnets."""
MEANINGS = {
    "fold": "fold: no equilibrium beyond",
    "oscillatory": "growing oscillation (Hopf)",
    "real": "growing without oscillation",
    "contact": "contact with the rotor",
    "border": "end of the search",
}


@styled
def map_figure(result: xr.Dataset) -> Figure:
    """Regions of stable levitation by dipole and by finite elements, kinds of boundary, and the plate's verdict."""
    figure, axes = panels(1, 3, (PAGE, 3.9), sharey=True)
    for place, (configuration, rotors) in zip(axes[0], by_configuration(result), strict=False):
        for model in MODELS:
            _region(place, cases_with(rotors, model=model), model)
        _plate(place, cases_with(rotors, model=MODELS[-1]))
        _lasting(place, cases_with(rotors, model=MODELS[-1]))
        place.set(
            xlabel=axis_label(configuration), title=TITLES[configuration], ylim=(20, 410),
        )  # fmt: skip
    handles = [
        *(axes[0, 0].plot([], [], "s", color=COLORS[m], alpha=0.5, label=f"stable: {NAMES[m]}")[0] for m in MODELS),
        *(axes[0, 0].plot([], [], k, color="0.3", mfc="white", label=MEANINGS[n])[0] for n, k in MARKERS.items()),
        axes[0, 0].plot([], [], "P", color=PALETTE[4], label=f"stable with a plate {-1e3 * FACE:g} mm below")[0],
        axes[0, 0].plot([], [], "x", color=PALETTE[3], label="unstable with it")[0],
        axes[0, 0].plot([], [], "1", color="0.2", label="no equilibrium is left with it")[0],
    ]
    if "high" in result:
        handles += [axes[0, 0].plot([], [], mark, color="k", label=words)[0] for mark, words in MARKS.values()]
    for place in axes[0]:
        place.margins(x=0.08)
    axes[0, 0].set_ylabel("frequency of the rotor (Hz)")
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


FIGURES = {"stability-map": map_figure}


def _region(axes: Axes, part: xr.Dataset, model: str) -> None:
    measure = part["measure"].values
    low, high = part["lowest"].values, part["highest"].values
    wide = measure if len(measure) > 1 else measure * np.array([0.99, 1.01])  # one rotor alone is a bar
    for k in range(part.sizes["interval"]):
        bottom, top = (np.broadcast_to(values[:, k], wide.shape) for values in (low, high))
        axes.fill_between(wide, bottom, top, color=COLORS[model], alpha=0.2, lw=0)
        for ends, kinds in ((low, part["low_kind"].values), (high, part["high_kind"].values)):
            axes.plot(measure, ends[:, k], color=COLORS[model], lw=0.8)
            for kind, marker in MARKERS.items():
                here = kinds[:, k] == kind
                axes.plot(measure[here], ends[here, k], marker, color=COLORS[model], mfc="white", ms=4)


def _plate(axes: Axes, part: xr.Dataset) -> None:
    growth, frequency = part["plate_growth"].values, part["plate_frequency"].values
    measure = np.broadcast_to(part["measure"].values[:, None], growth.shape)
    gone = np.isnan(growth) & np.isfinite(frequency)
    for here, style, color in ((growth < 0, "P", PALETTE[4]), (growth >= 0, "x", PALETTE[3]), (gone, "1", "0.2")):
        axes.plot(measure[here], frequency[here], style, color=color, ms=4, mew=0.8)


def _lasting(axes: Axes, part: xr.Dataset) -> None:
    for metal, (mark, _) in MARKS.items() if "high" in part else ():
        axes.plot(part["measure"], part["high"].sel(metal=metal), mark, color="k", ms=5)


def map_lines(result: xr.Dataset) -> list[str]:
    """Every rotor's intervals by both models, where the plate below keeps or undoes stability, where flights last."""
    lines = []
    for configuration, rotors in by_configuration(result):
        for measure in np.unique(rotors["measure"].values):
            rows = cases_with(rotors, measure=measure)
            found = {str(m): rows.isel(case=k) for k, m in enumerate(rows["model"].values)}
            words = [f"{model} {_intervals(one)}" for model, one in found.items()]
            verdicts = "".join(_verdicts(one) for one in found.values())
            flights = "".join(_flights(one) for one in found.values())
            lines.append(f"{rotor_label(configuration, measure)}: {'; '.join(words)}{verdicts}{flights}")
    return lines


def _intervals(one: xr.Dataset) -> str:
    rows = zip(
        one["lowest"].values, one["low_kind"].values, one["highest"].values, one["high_kind"].values, strict=True
    )
    words = [f"{low:.1f} ({a}) to {high:.1f} Hz ({b})" for low, a, high, b in rows if np.isfinite(low)]
    return " and ".join(words) or "never stable"


def _verdicts(one: xr.Dataset) -> str:
    pairs = zip(one["plate_frequency"].values, one["plate_growth"].values, strict=True)
    words = [f"{f:.0f} Hz {f'{g:+.2g}' if np.isfinite(g) else 'no equilibrium'}" for f, g in pairs if np.isfinite(f)]
    return f"; growth with the plate (1/s): {', '.join(words)}" if words else ""


def _flights(one: xr.Dataset) -> str:
    if "high" not in one:
        return ""
    words = [
        f"{low:.1f} to {high:.1f} Hz ({metal} rotor; then {end})"
        for metal, low, high, end in zip(
            one["metal"].values, one["low"], one["high"], one["ended_by"].values, strict=True
        )
        if end
    ]
    return f"; flights of 250 s last from {' and '.join(words)}" if words else ""
