"""Table and figure of TEAM workshop problem 7, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..results import PAGE, PALETTE, panels, styled

FIELDS = ("measured", "computed")


def team7_lines(result: xr.Dataset) -> list[str]:
    """Largest and mean deviation by curve."""
    lines = ["TEAM workshop problem 7, B_z on y = 72, z = 34 mm: deviation in per cent of the line's peak"]
    for curve in result["curve"].values:
        size = 100 * np.abs(result["deviation"].sel(curve=curve).values)
        lines.append(f"  {curve:18} largest {size.max():5.2f}, mean {size.mean():5.2f}")
    size = 100 * np.abs(result["deviation"].values)
    lines.append(f"  all {size.size} values         largest {size.max():5.2f}, mean {size.mean():5.2f}")
    return [*lines, *(_common_phase(result, number) for number in (0, 2))]


def _common_phase(result: xr.Dataset, number: int) -> str:
    """What stays at a frequency, whose curves are `number` and the next, once all phases are turned by one angle."""
    measured, computed = (result[name].values[:, number] - 1j * result[name].values[:, number + 1] for name in FIELDS)
    angle = float(np.angle(np.vdot(computed, measured)))
    left = 100 * (computed * np.exp(1j * angle) - measured) / np.abs(measured).max()
    size = np.abs([left.real, left.imag])
    return (
        f"  {str(result['curve'].values[number]).split(',')[0]}, all phases turned by {np.degrees(angle):+.2f}°: "
        f"largest {size.max():.2f}, mean {size.mean():.2f}; at 90° largest {size[1].max():.2f}"
    )


@styled
def team7_figure(result: xr.Dataset) -> Figure:
    """The four curves with what is measured, and their deviation."""
    figure, ((left, right),) = panels(1, 2, (PAGE, 3.2))
    x = 1e3 * result["x"].values
    for curve, color in zip(result["curve"].values, PALETTE, strict=False):
        here = result.sel(curve=curve)
        left.plot(x, 1e3 * here["computed"], color=color, label=curve)
        left.plot(x, 1e3 * here["measured"], "o", ms=3.5, color=color)
        right.plot(x, 100 * here["deviation"], "o-", ms=3, color=color, label=curve)
    left.plot([], [], "-", color="0.3", label="computed (same places)")
    left.plot([], [], "o", ms=3.5, color="0.3", label="measured (COMPEL 1990)")
    right.axhspan(-5, 5, color="0.93", zorder=0)
    left.set(xlabel="x (mm)", ylabel="$B_z$ (mT)", title="TEAM problem 7: line y = 72 mm, z = 34 mm", ylim=(-3, 12.5))
    right.set(xlabel="x (mm)", ylabel="computed - measured (% of the line's peak)", title="Deviation", ylim=(-6, 8))
    left.legend(loc="upper left", ncols=2)
    right.legend(loc="upper left", ncols=2)
    return figure


FIGURES = {"team7": team7_figure}
