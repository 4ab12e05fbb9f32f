"""Table and figure of the study of speed against error, from its result alone."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..results import PAGE, PALETTE, panels, styled

ROUND_OFF = 1e-13
"""What is stated of a model that has no error but that."""


def speed_lines(result: xr.Dataset) -> list[str]:
    """The table of the study."""
    head = " ".join(f"{1e3 * d:4.0f} mm" + " " * 8 for d in result["distance"].values)
    lines = [
        "Largest relative error of B / of its gradient, and what it costs from nothing",
        f"{'method':26} {'s':>7} {'CPU s':>7} {'unknowns':>9} {'MB':>6} {'ns/pt':>6}  {head}",
    ]
    for name in result["approach"].values:
        row = result.sel(approach=name)
        pairs = zip(row["field_error"].values, row["gradient_error"].values, strict=True)
        lines.append(
            f"{name:26} {float(row['seconds']):7.2f} {float(row['cpu_seconds']):7.2f} {int(row['unknowns']):9d} "
            f"{float(row['memory']) / 1e6:6.0f} {1e9 * float(row['per_point']):6.0f}  "
            + "  ".join(f"{b:.0e} / {g:.0e}" for b, g in pairs)
        )
    pace = 1e9 * result.attrs["magpylib_seconds_per_point"]
    lines.append(f"magpylib, B alone: {pace:.0f} ns per point")
    own = result["truth_error"].where(result["problem"] == "permeable").max()
    return [*lines, f"The reference for μr = 1.05 states an error of at most {float(own):.1e}; for μr = 1 it is exact."]


@styled
def speed_figure(result: xr.Dataset) -> Figure:
    """Error of B at 20 mm (full) and 13 mm (faint) against the time from nothing, for both problems.

    Where a table estimates its own error, a bar reaches from the true error up to the stated one.
    """
    figure, (axes,) = panels(1, 2, (PAGE, 3.4), sharey=True)
    titles = {"exact": "μr = 1 (closed form known)", "permeable": "μr = 1.05"}
    families = list(dict.fromkeys(result["family"].values.tolist()))
    for panel, (problem, title) in zip(axes, titles.items(), strict=True):
        for family, color in zip(families, [*PALETTE, "0.4"], strict=False):
            rows = result.isel(approach=np.flatnonzero((result["family"] == family) & (result["problem"] == problem)))
            if not rows.sizes["approach"]:
                continue
            for distance, alpha, label in ((0.02, 1.0, family), (0.013, 0.35, None)):
                at = rows.sel(distance=distance)
                error = np.maximum(at["field_error"], 1e-16)
                stated = np.where(at["stated_error"] > ROUND_OFF, np.maximum(at["stated_error"] - error, 0.0), 0.0)
                bars = [np.zeros_like(stated), stated] if stated.any() else None
                style = {"ms": 4, "capsize": 2.5, "elinewidth": 1, "color": color, "alpha": alpha, "label": label}
                panel.errorbar(rows["cpu_seconds"], error, bars, fmt="o-", **style)
        panel.set(xscale="log", yscale="log")
        own = float(result["truth_error"].where(result["problem"] == problem).sel(distance=0.02).max())
        panel.axhspan(1e-17, max(own, 1e-16), facecolor="0.9", edgecolor="0.6", label="error of the reference")
        panel.set(xlabel="processor time from nothing (s)", title=title, ylim=(1e-16, None))
        panel.legend(frameon=True)
    axes[0].set_ylabel("relative error of B")
    return figure


FIGURES = {"speed-accuracy": speed_figure}
