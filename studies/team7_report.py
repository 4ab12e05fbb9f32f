"""TEAM workshop problem 7 as a study: result, table and figure."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .figures import PALETTE, panels, styled
from .results import variable
from .team7 import team7

CURVES = ("50 Hz, ωt = 0", "50 Hz, ωt = 90°", "200 Hz, ωt = 0", "200 Hz, ωt = 90°")


def team7_study(quick: bool) -> xr.Dataset:
    """Measured and computed B_z on the line, in T, and their deviation in units of the line's peak."""
    compared = team7(order=2 if quick else 3)
    dims = ("x", "curve")
    return xr.Dataset(
        {
            "measured": variable(dims, compared.measured, "T", "measured B_z"),
            "computed": variable(dims, compared.computed, "T", "computed B_z"),
            "deviation": variable(dims, compared.deviation, "1", "deviation over the line's peak"),
        },
        {"x": variable(("x",), compared.x, "m", "x"), "curve": list(CURVES)},
    )


def team7_lines(result: xr.Dataset) -> list[str]:
    """Largest and mean deviation by curve."""
    lines = ["TEAM workshop problem 7, B_z on y = 72, z = 34 mm: deviation in per cent of the line's peak"]
    for curve in result["curve"].values:
        size = 100 * np.abs(result["deviation"].sel(curve=curve).values)
        lines.append(f"  {curve:18} largest {size.max():5.2f}, mean {size.mean():5.2f}")
    size = 100 * np.abs(result["deviation"].values)
    return [*lines, f"  all {size.size} values         largest {size.max():5.2f}, mean {size.mean():5.2f}"]


@styled
def team7_figure(result: xr.Dataset) -> Figure:
    """The four curves and what is measured."""
    figure, ((axes,),) = panels(1, 1, (6.0, 4.0))
    for curve, color in zip(result["curve"].values, PALETTE, strict=False):
        axes.plot(1e3 * result["x"], 1e3 * result["computed"].sel(curve=curve), color=color, label=curve)
        axes.plot(1e3 * result["x"], 1e3 * result["measured"].sel(curve=curve), "o", ms=4, color=color)
    axes.plot([], [], "ko", ms=4, label="measured (Fujiwara and Nakata 1990)")
    axes.set(xlabel="x (mm)", ylabel="$B_z$ (mT)", title="TEAM problem 7: line y = 72 mm, z = 34 mm")
    axes.legend()
    return figure
