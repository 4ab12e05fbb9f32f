"""Figures of the study of capture, from its dataset alone."""

from itertools import pairwise

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..article import CONFIGURATIONS, axis_label, rotor_label
from ..results import PAGE, PALETTE, legend_below, panels, styled
from .launches import FARTHER, LEAN, NEARER, SIDEWAYS
from .outcomes import HELD, Caught, Share, rotors_of

SHOWN = (("horizontal", 2.0), ("vertical", 14.0), ("vertical", 18.0), ("tilt", 10.0))
"""Rotors of which it is drawn from where they catch."""
BINS = 12


@styled
def share_figure(result: xr.Dataset) -> Figure:
    """The share that is held against each configuration's displacement or tilt, at each part of its frequencies."""
    known = list(rotors_of(result))
    names = [name for name in CONFIGURATIONS if any(name == configuration for configuration, _, _ in known)]
    figure, (axes,) = panels(1, len(names), (PAGE, 2.7), sharey=True)
    for panel, name in zip(axes, names, strict=True):
        rows = [(measure, parts) for configuration, measure, parts in known if configuration == name]
        for k in range(max(len(parts) for _, parts in rows)):
            there = [(measure, parts[k].held) for measure, parts in rows if k < len(parts)]
            values = np.array([share.value for _, share in there])
            around = np.array([share.bounds for _, share in there])
            bars = np.maximum(np.stack([values - around[:, 0], around[:, 1] - values]), 0)
            label = f"{rows[0][1][k].part:.0%} of the stable range"
            panel.errorbar([m for m, _ in there], 100 * values, 100 * bars, fmt="o-", color=PALETTE[k], label=label)
        for measure in CONFIGURATIONS[name].levitated:
            panel.axvline(measure, color="0.85", lw=4, zorder=0)
        panel.set(xlabel=axis_label(name), ylim=(-2, 102))
    axes[0].set_ylabel("launches that are held (%)")
    legend_below(figure, axes[0])
    return figure


@styled
def place_figure(result: xr.Dataset) -> Figure:
    """From where floaters are caught: the share over height and distance from the axis, and over the moment's angle."""
    found = {(c, m): parts for c, m, parts in rotors_of(result)}
    chosen = [parts[len(parts) // 2] for key in SHOWN if (parts := found.get(key))]
    figure, (maps, leans) = panels(2, len(chosen), (PAGE, 4.6), sharey="row")
    for top, bottom, caught in zip(maps, leans, chosen, strict=True):
        _map(top, caught)
        _lean(bottom, caught)
        top.set_title(f"{rotor_label(caught.configuration, caught.measure)}, {caught.frequency:.0f} Hz")
    maps[0].set_ylabel("farther from the rotor (mm)")
    maps[0].invert_yaxis()  # shared by all
    leans[0].set_ylabel("held (%)")
    return figure


FIGURES = {"capture": share_figure, "capture-from-where": place_figure}


def _map(axes: Axes, caught: Caught) -> None:
    """Held (blue) and not held (red) launches; of each place the mean over all directions of the moment."""
    side, height = np.linspace(0, SIDEWAYS, 5), np.linspace(-NEARER, FARTHER, 9)
    at = caught.flights["sideways"].values, caught.flights["farther"].values
    held = caught.flights["outcome"].values == HELD
    every = np.histogram2d(*at, bins=(side, height))[0]
    some = np.histogram2d(at[0][held], at[1][held], bins=(side, height))[0]
    share = np.divide(100 * some, every, out=np.full_like(every, np.nan), where=every > 0)
    drawn = axes.pcolormesh(1e3 * side, 1e3 * height, share.T, vmin=0, vmax=100, cmap="RdYlBu")
    axes.set_xlabel("beside the axis (mm)")
    axes.figure.colorbar(drawn, ax=axes, label="held (%)")


def _lean(axes: Axes, caught: Caught) -> None:
    """The share against the moment's angle to the axis."""
    edges = np.degrees(np.linspace(0, LEAN, BINS // 2 + 1))
    angle, held = np.degrees(caught.flights["lean"].values), caught.flights["outcome"].values == HELD
    inside = [(angle >= a) & (angle < b) for a, b in pairwise(edges)]
    shares = [Share(int(held[k].sum()), int(k.sum())) for k in inside]
    values, bars = [100 * s.value for s in shares], [100 * s.error for s in shares]
    axes.errorbar((edges[1:] + edges[:-1]) / 2, values, bars, fmt="o-", color=PALETTE[0])
    axes.set(xlabel="moment to the axis (°)", ylim=(-2, 102))
