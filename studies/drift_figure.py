"""Figure and report of the study of the slow drift, from its dataset alone."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .drift import KEPT, OUTCOMES
from .figures import PALETTE, panels, styled

MARKS = dict(zip(OUTCOMES, ("v", "o", "X", "^", "_"), strict=True))


@styled
def drift_figure(result: xr.Dataset) -> Figure:
    """For each rotor: levitation time against frequency with its bands, and the nominal flights."""
    cases = result["case"].values.tolist()
    figure, axes = panels(len(cases), 2, (8.0, 2.7 * len(cases)))
    for (left, right), case in zip(axes, cases, strict=True):
        _times(left, result.sel(case=case))
        _flights(right, result.sel(case=case))
        left.set(title=case)
    axes[0, 0].legend()
    return figure


def _times(axes: Axes, result: xr.Dataset) -> None:
    frequency, time = result["frequency"].values, result["levitation_time"]
    groups = {
        "spin at release ±0.1": "spin",
        "remanence 1.29–1.32 T": "remanence",
        "conductivity ±20 %": "conductivity",
    }
    for (label, start), color in zip(groups.items(), PALETTE[1:], strict=False):
        names = ["nominal", *(v for v in result["variant"].values.tolist() if v.startswith(start))]
        if len(names) == 1:
            continue
        band = time.sel(variant=names).values
        axes.fill_between(frequency, band.min(axis=0), band.max(axis=0), color=color, alpha=0.25, lw=0, label=label)
    axes.plot(frequency, time.sel(variant="Stokes drag"), ":", color="0.4", label="Stokes drag")
    nominal = time.sel(variant="nominal").values
    axes.plot(frequency, nominal, color=PALETTE[0], label="nominal")
    outcome = result["outcome"].sel(variant="nominal").values
    for number, name in enumerate(OUTCOMES):
        here = outcome == number
        if here.any():
            axes.plot(frequency[here], nominal[here], MARKS[name], color=PALETTE[0], ms=5, label=name)
    axes.set(xlabel="frequency (Hz)", ylabel="levitation time (s)", ylim=(-8, 262))


def _flights(axes: Axes, result: xr.Dataset) -> None:
    frequency = result["frequency"].values
    flown = np.flatnonzero(result["levitation_time"].sel(variant="nominal").values >= float(result.attrs["shortest_s"]))
    for k in flown[:: max(1, len(flown) // 6)]:
        line = axes.plot(result["flight_time"][k], 1e3 * result["flight_distance"][k])
        end = (float(result["flight_time"][k, -1]), 1e3 * float(result["flight_distance"][k, -1]))
        axes.annotate(f"{frequency[k]:.4g} Hz", end, color=line[0].get_color(), fontsize=7)
    axes.set(xlabel="time (s)", ylabel="distance (mm)", title="nominal flights", xlim=(0, 290))


def drift_lines(result: xr.Dataset) -> list[str]:
    """For each rotor: where flights end in the fold, where they last and where they are unstable."""
    lines = []
    for case in result["case"].values.tolist():
        nominal = result.sel(case=case, variant="nominal")
        lines.append(f"{case}:")
        for number, name in enumerate(OUTCOMES):
            here = (nominal["outcome"] == number).values
            if not here.any():
                continue
            chosen = nominal.isel(step=here)
            span = f"{_span(chosen['frequency'])} Hz"
            if name == "no equilibrium":
                lines.append(f"  none at {span}")
                continue
            words = f"  {name} at {span}: {_span(chosen['levitation_time'])} s, "
            words += f"from {_span(1e3 * chosen['distance_start'])} to {_span(1e3 * chosen['distance_end'])} mm"
            if name == "fold":
                words += (
                    f", falling {_span(1e3 * chosen['fall_rate'])} mm/s, late over early {_span(chosen['fall_ratio'])}"
                )
            if number == KEPT:
                endless = np.isfinite(chosen["balance_spin"].values)
                words += f"; endless: {endless.sum()} of {len(endless)}, s* {_span(chosen['balance_spin'])}"
            lines.append(words)
    return lines


def _span(values: xr.DataArray) -> str:
    known = values.values[np.isfinite(values.values)]
    if not len(known):
        return "unknown"
    low, high = (f"{value:.3g}" for value in (known.min(), known.max()))
    return low if low == high else f"{low}–{high}"
