"""What became of a floater whose rotor was turned up or down, drawn from the result alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from .run import DISTANCE, PARTS
from .style import PALETTE, legend_below, panels, plot_branch, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WAYS = {-1: ("turned down", PALETTE[0]), 1: ("turned up", PALETTE[1]), 0: ("steady", "0.5")}
MARGIN = 0.3  # Of the range of distances that is shown, above and below it
MOST = 0.8  # Of the way is shown where it is far from the equilibria, so that a fall at its end is not


@styled
def drive_figure(result: xr.Dataset) -> Figure:
    """Distance against frequency, smallest to largest, with the equilibria beneath; and the motor's work in time."""
    figure, ((along, work),) = panels(1, 2, 3.0)
    time, frequency = result["time"].values, result["rotor_frequency"].values
    distance = -1e3 * result["position"].sel(axis="z").values
    parts = [part for part in np.array_split(np.arange(len(time)), PARTS) if len(part)]
    mean, low, high = np.array([(frequency[p].mean(), distance[p].min(), distance[p].max()) for p in parts]).T
    ways = np.sign(np.round([frequency[p[-1]] - frequency[p[0]] for p in parts], 9)).astype(int)
    steady, equilibria = result["quasi_static_frequency"].values, 1e3 * result["quasi_static_distance"].values
    stable = result["quasi_static_growth"].values <= 0.004
    plot_branch(along, steady, equilibria, stable, color="k", label="equilibrium")
    along.plot([], [], "k--", label="unstable equilibrium")
    for stretch in np.split(np.arange(len(parts)), np.flatnonzero(np.diff(ways)) + 1):
        label, color = WAYS[int(ways[stretch[0]])]
        joined = np.append(stretch, stretch[-1] + 1)[: len(parts) - stretch[0]]
        look = {"color": color, "alpha": 0.5, "label": label}
        if ways[stretch[0]]:
            along.fill_between(mean[joined], low[joined], high[joined], lw=0.8, **look)
        else:
            along.plot(mean[stretch][[0, 0]], [low[stretch].min(), high[stretch].max()], lw=3, **look)
    there = (steady >= frequency.min()) & (steady <= frequency.max())
    known = np.array([*equilibria[there], np.quantile(low, 1 - MOST), np.quantile(high, MOST)])
    room = MARGIN * max(float(np.ptp(known)), 1.0)
    if str(result.attrs["ended_by"]) in ("contact", "lost"):
        along.axvline(
            frequency[-1], color=PALETTE[3], ls=":", label=f"{result.attrs['ended_by']}, {frequency[-1]:.4g} Hz"
        )
    span = max(float(np.ptp(frequency)), 1.0)
    along.set(xlabel="frequency of the rotor (Hz)", ylabel=DISTANCE, ylim=(known.min() - room, known.max() + room))
    along.set_xlim(frequency.min() - 0.1 * span, frequency.max() + 0.1 * span)
    work.plot(time, 1e3 * result["motor_work"], color=PALETTE[2], lw=0.6, label="work of the motor")
    work.set(xlabel="time (s)", ylabel="work of the motor (mJ)")
    legend_below(figure)
    return figure
