"""The small motions about equilibria: how fast each grows or dies out, and its frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..results import PALETTE, panels, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKERS = "osD^v"
"""One for each small motion."""
NOTHING = 1e-9
"""Growth that counts as none on the axis, 1/s."""


@styled
def modes_figure(result: xr.Dataset) -> Figure:
    """Growth against frequency of every small motion, from a result of `equilibria` or `stability`."""
    figure, ((axes,),) = panels(1, 1, (5.5, 3.6))
    listed = result if "equilibrium" in result.dims else result.expand_dims("equilibrium")
    for k, color in zip(range(listed.sizes["equilibrium"]), PALETTE * 9, strict=False):
        one = listed.isel(equilibrium=k)
        height = 1e3 * float(one["position"].sel(axis="z"))
        axes.plot([], [], "s", color=color, label=f"z = {height:.2f} mm, {'stable' if one['stable'] else 'unstable'}")
        for name, marker in zip(one["mode"].values.tolist(), MARKERS, strict=True):
            mode = one.sel(mode=name)
            axes.plot(mode["mode_frequency"], mode["mode_growth"], marker, color=color, mfc="none", ms=6)
    for name, marker in zip(listed["mode"].values.tolist(), MARKERS, strict=True):
        axes.plot([], [], marker, color="0.3", mfc="none", label=name)
    axes.axhline(0.0, color="0.3", lw=0.8)
    sizes = np.abs(listed["mode_growth"].values)
    smallest = sizes[sizes > NOTHING].min(initial=1.0)
    axes.set_yscale("symlog", linthresh=10.0 ** np.floor(np.log10(smallest)))
    axes.margins(0.08)
    axes.set(xlabel="frequency, rotor's frame (Hz)", ylabel="growth (1/s), negative: dies out", title="Small motions")
    axes.legend(ncols=2, loc="center left")
    return figure
