"""Figure and table of the study of hard cases, from its result alone."""

from textwrap import fill

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from ..results import PAGE, PALETTE, panels, styled

COLUMNS = 4
SMALL = 1e-11
"""Panels with errors below it show round-off too."""
LINES = {
    "stated_error": ("stated by the table", "--", PALETTE[1], "s"),
    "true_error": ("difference from the reference", "-", PALETTE[0], "o"),
    "reference_step": ("last step of the reference", ":", "0.45", ""),
}


@styled
def hard_case_figure(result: xr.Dataset) -> Figure:
    """True and stated error over the distance, a panel for each case with a field."""
    names = [name for name in result["case"].values if float(result["true_error"].sel(case=name).max()) > 0]
    rows = -(-len(names) // COLUMNS)
    figure, axes = panels(rows, COLUMNS, (PAGE, 1.5 * rows + 0.7))
    for panel, name in zip(axes.flat, names, strict=False):
        row = result.sel(case=name)
        for key, (label, dash, color, marker) in LINES.items():
            values = np.where(row[key] > 0, np.maximum(row[key], 1e-17), np.nan)
            panel.loglog(1e3 * row["distance"], values, dash, color=color, marker=marker, ms=3, label=label)
        panel.axhline(1e-5, color="0.2", lw=0.7, label="tolerance asked for")
        panel.set_title(fill(name, 22))
        small = float(row["true_error"].min()) < SMALL
        panel.set(xlim=(4, 1300), ylim=(3e-17 if small else 1e-10, 1e-4))
        panel.yaxis.set_major_locator(LogLocator(numticks=6))
    for panel in axes.flat[len(names) :]:
        panel.set_visible(False)
    figure.supxlabel("distance from the magnets' faces (mm)", fontsize="medium")
    figure.supylabel("largest relative error of B", fontsize="medium")
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


FIGURES = {"field-hard-cases": hard_case_figure}


def hard_case_lines(result: xr.Dataset) -> list[str]:
    """The study's table."""
    ends = f"{'at the nearest distance':27}  {'10 cm and farther':27}"
    lines = [
        "Largest relative error of B: true / stated / last step of the reference",
        f"{'case':30} {'mm':>6}  {ends} {'cover':>6} {'order':>5} {'CPU s':>6}",
    ]
    for name in result["case"].values:
        row = result.sel(case=name)
        near, far = row.isel(place=0), row.where(row["distance"] >= 0.1).max()
        lines.append(
            f"{name:30} {1e3 * float(near['distance']):6.2f}  {_three(near)}  {_three(far)} "
            f"{float(row['shortfall'].max()):6.2f} {int(row['order']):5d} {float(row['seconds']):6.1f}"
        )
    return [*lines, "cover: true error over stated error and reference's step; above 1 the table states too little."]


def _three(row: xr.Dataset) -> str:
    return " / ".join(f"{float(row[key]):7.1e}" for key in ("true_error", "stated_error", "reference_step"))
