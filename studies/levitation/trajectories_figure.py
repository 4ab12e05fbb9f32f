"""Figure and sentences of the study of the kinds of flight, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..article import rotor_label
from ..results import PAGE, PALETTE, panels, styled

TOLD = {115.0: "linear fall", 140.0: "stable", 150.0: "oscillating loss"}
"""The article's three flights, by frequency in Hz."""
NONE, SHORT = "no equilibrium", "lost within 3 s"
"""Of a flight that is none."""
LOST = (SHORT, "linear fall", "oscillating loss")


@styled
def flight_figure(result: xr.Dataset) -> Figure:
    """The distance in each flight, one panel for each displacement."""
    figure, (axes,) = panels(1, result.sizes["case"], (PAGE, 4.2), sharey=True)
    for panel, k in zip(axes, range(result.sizes["case"]), strict=True):
        rotor = result.isel(case=k)
        for one, color in zip(range(rotor.sizes["frequency"]), PALETTE, strict=False):
            _flight(panel, rotor.isel(frequency=one), color)
        panel.set(xlabel="time (s)", ylim=(11, 40))
        panel.set_title(rotor_label("horizontal", float(rotor["value"])))
        panel.plot([], [], "--", color="0.3", label="averaged flight")
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17))
    axes[0].set_ylabel("levitation distance (mm)")
    return figure


FIGURES = {"trajectories": flight_figure}


def _flight(axes: Axes, flight: xr.Dataset, color: str) -> None:
    kind = str(flight["kind"].values)
    text = f"{float(flight['frequency']):g} Hz: {kind}"
    if kind == NONE:
        axes.plot([], [], color=color, label=text)
        return
    time = flight["time"].values
    low, mean, high = (1e3 * flight[name].values for name in ("lowest", "mean", "highest"))
    axes.fill_between(time, low, high, color=color, alpha=0.3, lw=0)
    axes.plot(time, mean, color=color, label=text)
    axes.plot(flight["averaged_time"], 1e3 * flight["averaged_distance"], "--", color="k", lw=0.7)
    if kind in LOST:
        last = np.flatnonzero(np.isfinite(mean))[-1]
        axes.plot(time[last], min(mean[last], 34), "x", color=color)


def flight_lines(result: xr.Dataset) -> list[str]:
    """What became of each flight, simulated and averaged, beside what the article saw at that frequency."""
    lines = []
    for k in range(result.sizes["case"]):
        rotor = result.isel(case=k)
        for frequency in rotor["frequency"].values:
            one = rotor.sel(frequency=frequency)
            told = f"; the article, δx = 1 mm: {TOLD[frequency]}" if frequency in TOLD else ""
            where = f"{rotor_label('horizontal', float(rotor['value']))}, {frequency:g} Hz: {one['kind'].values}"
            if str(one["kind"].values) == NONE:
                lines.append(f"{where}{told}.")
                continue
            mean = 1e3 * one["mean"].dropna("part").values
            growth, ledger = float(one["growth"]), float(one["energy_error"])
            lines.append(
                f"{where} after {float(one['levitated']):.2f} s, from {mean[0]:.2f} mm to {mean[-2]:.2f} mm{told}. "
                f"Averaged: {one['averaged_end'].values} after {float(one['averaged_levitated']):.2f} s; "
                f"growth at the start {growth:.2g} /s, ledger of energy to {ledger:.0e}."
            )
    return lines
