"""Figures and report of the study of the slow drift, from its dataset alone."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..results import PAGE, PALETTE, panels, styled
from .levitation_time_cases import LEVITATES, OUTCOMES

MARKS = dict(zip(OUTCOMES, ("v", "o", "X", "^", "|"), strict=True))
MEANINGS = {
    "contact": "touches the rotor",
    "fold": "sinks until it is lost (fold)",
    "instability": "oscillates until it is lost",
    "levitates": "still up after 250 s",
    "no equilibrium": "no equilibrium",
}
BANDS = {
    "displacement": "displacement ±0.2 mm, ±0.5 mm or ±0.5°",
    "spin": "spin at release ±0.1",
    "conductivity": "conductivity −20 … +80 %",
    "remanence": "remanence 1.29 … 1.32 T",
}
LINES = {
    "complete": ("-", "complete: mutual magnetisation, currents in the rotor too"),
    "rough release": ("--", "oscillation from 0.1 mm, not 3 µm"),
    "Stokes drag": (":", "air after Stokes"),
}
FLOWN = {
    "horizontal 1 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "horizontal 1.5 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "vertical 14 mm": {60: "24 hours"},
    "vertical 12.6 mm": {60: "24 hours"},
}
"""What the article saw (δx = 1 mm and δz = 14 mm there), by frequency in Hz."""


@styled
def times_figure(result: xr.Dataset) -> Figure:
    """Levitation time of each rotor against frequency, with the bands of what is not known well."""
    figure, axes = _one_panel_each(result)
    for panel, case in zip(axes.flat, result["case"].values.tolist(), strict=False):
        _times(panel, result.sel(case=case), FLOWN.get(case, {}))
    for row in axes:
        row[0].set_ylabel("levitation time (s)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    for name in OUTCOMES:
        handles += axes[0, 0].plot([], [], MARKS[name], color=PALETTE[0], ms=5)
        labels.append(MEANINGS[name])
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


@styled
def flights_figure(result: xr.Dataset) -> Figure:
    """Distance against time in some nominal flights of each rotor."""
    figure, axes = _one_panel_each(result)
    for panel, case in zip(axes.flat, result["case"].values.tolist(), strict=False):
        _flights(panel, result.sel(case=case))
    for row in axes:
        row[0].set_ylabel("distance (mm)")
    return figure


FIGURES = {"levitation-time": times_figure, "levitation-time-flights": flights_figure}


def _one_panel_each(result: xr.Dataset) -> tuple[Figure, Any]:
    """A panel for each rotor, three in a row."""
    cases = result["case"].values.tolist()
    columns = min(3, len(cases))
    rows = -(-len(cases) // columns)
    figure, axes = panels(rows, columns, (PAGE, 2.2 * rows + 0.7))
    for panel, case in zip(axes.flat, cases, strict=False):
        panel.set_title(case.replace(" deg", "°"))
    for unused in axes.flat[len(cases) :]:
        unused.remove()
    return figure, axes


def _times(axes: Axes, result: xr.Dataset, flown: dict[int, str]) -> None:
    frequency, time = result["frequency"].values, result["levitation_time"]
    variants = result["variant"].values.tolist()
    for (start, label), color in zip(BANDS.items(), ("0.6", *PALETTE[1:]), strict=False):
        names = ["nominal", *(v for v in variants if v.startswith(start))]
        if len(names) > 1:
            band = time.sel(variant=names).values
            low, high = np.fmin.reduce(band), np.fmax.reduce(band)
            axes.fill_between(frequency, low, high, color=color, alpha=0.28, lw=0, label=label)
    for name, (dashes, label) in LINES.items():
        if name in variants:
            axes.plot(frequency, time.sel(variant=name), dashes, color="0.25", lw=1, label=label)
    nominal = time.sel(variant="nominal").values
    axes.plot(frequency, nominal, color=PALETTE[0], lw=1.6, label="nominal")
    outcome = result["outcome"].sel(variant="nominal").values
    for number, name in enumerate(OUTCOMES):
        here = outcome == number
        axes.plot(frequency[here], nominal[here], MARKS[name], color=PALETTE[0], ms=3.5)
    for seen, word in flown.items():
        axes.axvline(seen, color=PALETTE[3], lw=0.8)
        words = axes.text(seen, 245, f"{seen} Hz {word}", rotation=90, ha="center", va="top", color=PALETTE[3], size=7)
        words.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85})
    axes.set(xlabel="frequency (Hz)", ylim=(-8, 262), xlim=(frequency[0], frequency[-1]))


def _flights(axes: Axes, result: xr.Dataset) -> None:
    nominal = result.sel(variant="nominal")
    frequency = result["frequency"].values
    flown = np.flatnonzero(nominal["levitation_time"].values >= float(result.attrs["shortest_s"]))
    falls = flown[nominal["outcome"].values[flown] != LEVITATES]
    lasts = flown[nominal["outcome"].values[flown] == LEVITATES]
    shown = np.unique([*falls[:: max(1, -(-len(falls) // 4))], *lasts[:: max(1, -(-len(lasts) // 3))]]).astype(int)
    for number, k in enumerate(shown):
        color = PALETTE[number % len(PALETTE)]
        time, distance = nominal["flight_time"][k].values, 1e3 * nominal["flight_distance"][k].values
        axes.plot(time, distance, color=color)
        fold = OUTCOMES[int(nominal["outcome"][k])] == "fold"
        way = {"rotation": 60, "rotation_mode": "anchor"} if fold else {"va": "center"}
        axes.annotate(f" {frequency[k]:.3g} Hz", (time[-1], distance[-1]), color=color, size=7, ha="left", **way)
    low, high = axes.get_ylim()
    axes.set(xlabel="time (s)", xlim=(0, 330), ylim=(low, high + 0.25 * (high - low)))  # room for words above folds


def time_lines(result: xr.Dataset) -> list[str]:
    """For each rotor: where flights end in the fold, where they last and where they are unstable."""
    lines = []
    for case in result["case"].values.tolist():
        for variant in ("nominal", "permeable", "complete"):
            if variant not in result["variant"]:
                continue
            chosen = result.sel(case=case, variant=variant)
            lines.append(f"{case}{'' if variant == 'nominal' else f', {variant}'}:")
            lines += [line for number in range(len(OUTCOMES)) if (line := _line(chosen, number))]
    return lines


def _line(nominal: xr.Dataset, number: int) -> str:
    """What is to be said of all flights of one outcome; nothing if there is none."""
    here = (nominal["outcome"] == number).values
    if not here.any():
        return ""
    chosen, name = nominal.isel(step=here), OUTCOMES[number]
    span = f"{_span(chosen['frequency'])} Hz"
    if name == "no equilibrium":
        return f"  none at {span}"
    words = f"  {name} at {span}: {_span(chosen['levitation_time'])} s, "
    words += f"from {_span(1e3 * chosen['distance_start'])} to {_span(1e3 * chosen['distance_end'])} mm"
    if name == "fold":
        words += f", falling {_span(1e3 * chosen['fall_rate'])} mm/s, late over early {_span(chosen['fall_ratio'])}"
    if number == LEVITATES:
        endless = np.isfinite(chosen["balance_spin"].values)
        words += f"; with a balance ahead: {endless.sum()} of {len(endless)}, s* {_span(chosen['balance_spin'])}"
        words += f"; largest growth {_span(chosen['growth'])} /s"
    return words


def _span(values: xr.DataArray) -> str:
    known = values.values[np.isfinite(values.values)]
    if not len(known):
        return "unknown"
    low, high = (f"{value:.3g}" for value in (known.min(), known.max()))
    return low if low == high else f"{low}–{high}"
