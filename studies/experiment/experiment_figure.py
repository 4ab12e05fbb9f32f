"""Figures of the study of the experiment, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..results import PAGE, PALETTE, panels, styled
from .experiment_report import facts_known, prior_quantiles, quantiles, support
from .priors import UNKNOWNS

SHOWN = ("displacement", "tilt", "stack_tilt", "magnets", "steel", "motion", "spin")
"""Unknowns of the corner."""


@styled
def corner_figure(result: xr.Dataset) -> Figure:
    """The posterior of some unknowns, alone and in pairs; grey: the middle 68 % of the prior."""
    one = result.isel(variant=0)
    units = np.where(result["unit"].values == "S/m", 1e-6, 1.0)
    before = prior_quantiles(result) * units[:, None]
    names = list(result["unknown"].values)
    chosen = [names.index(name) for name in SHOWN]
    draws = one["posterior"].values * units
    draws = draws[np.isfinite(draws).all(axis=1)]
    figure, axes = panels(len(chosen), len(chosen), (PAGE, PAGE))
    for row, i in enumerate(chosen):
        for column, j in enumerate(chosen):
            panel = axes[row][column]
            if column > row:
                panel.set_axis_off()
                continue
            panel.axvspan(before[j, 0], before[j, 2], color="0.92", zorder=0)
            if row == column:
                panel.hist(draws[:, j], bins=30, color=PALETTE[0], histtype="stepfilled")
                panel.set_yticks([])
            else:
                panel.axhspan(before[i, 0], before[i, 2], color="0.92", zorder=0)
                panel.plot(draws[:, j], draws[:, i], ".", ms=1, alpha=0.3, color=PALETTE[0], rasterized=True)
                panel.set_ylim(*np.quantile(draws[:, i], (0.003, 0.997)))
            panel.set_xlim(*np.quantile(draws[:, j], (0.003, 0.997)))
            panel.tick_params(labelbottom=row == len(chosen) - 1, labelleft=column == 0 and row > 0, labelsize=5)
            if row == len(chosen) - 1:
                panel.set_xlabel(_label(result, j), fontsize=6)
            if not column and row:
                panel.set_ylabel(_label(result, i), fontsize=6)
    return figure


@styled
def unknowns_figure(result: xr.Dataset) -> Figure:
    """The middle 68 % of each unknown's posterior in deviations of its prior, for each variant fitted to the facts."""
    before = prior_quantiles(result)
    middle, half = before[:, 1], (before[:, 2] - before[:, 0]) / 2
    told = [k for k in range(result.sizes["variant"]) if not np.isfinite(result["truth"].values[k]).any()]
    symbols = {unknown.name: unknown.symbol for unknown in UNKNOWNS}
    figure, ((panel,),) = panels(1, 1, (PAGE, 1.2 + 0.22 * len(middle)))
    places = np.arange(len(middle))[::-1]
    panel.axvspan(-1, 1, color="0.92", zorder=0)
    for n, k in enumerate(told):
        found = (quantiles(result.isel(variant=k)) - middle[:, None]) / half[:, None]
        bars = np.abs(found[:, [0, 2]] - found[:, [1]]).T
        name = str(result["variant"].values[k])
        panel.errorbar(
            found[:, 1], places - 0.12 * n, xerr=bars, fmt="o", ms=3, color=PALETTE[n % len(PALETTE)], label=name
        )
    panel.set_yticks(places, [symbols.get(str(name), str(name)) for name in result["unknown"].values])
    panel.set_xlabel("middle 68 %, in deviations of the prior")
    panel.legend(fontsize=6, loc="lower right")
    return figure


@styled
def facts_figure(result: xr.Dataset) -> Figure:
    """Each fact's probability beforehand, given the others, and in the fit; and which facts go together."""
    one = result.isel(variant=0)
    known = facts_known(one)
    names = [str(one["fact"].values[k]) for k in known]
    figure, ((left, right),) = panels(1, 2, (PAGE, 1.6 + 0.28 * len(names)))
    places = np.arange(len(names))[::-1]
    alone = np.exp(one["log_evidence_single"].values[known])
    given = np.exp(float(one["log_evidence_drawn"]) - one["log_evidence_others"].values[known])
    fitted = np.nanmean(np.exp(one["fact_log_likelihood"].values[:, known]), axis=0)
    for values, mark, label in (
        (alone, "o", "beforehand"),
        (given, "s", "given all others"),
        (fitted, "^", "in the fit"),
    ):
        left.plot(values, places, mark, ms=4, label=label)
    left.set(xscale="log", xlim=(3e-3, 1.3), xlabel="probability of the fact")
    left.set_yticks(places, names)
    left.legend(fontsize=6)
    ratio = support(one)[np.ix_(known, known)]
    np.fill_diagonal(ratio, np.nan)
    drawn = right.imshow(ratio, cmap="RdBu", vmin=-3, vmax=3)
    right.set_xticks(np.arange(len(names)), names, rotation=90, fontsize=6)
    right.set_yticks(np.arange(len(names)), names, fontsize=6)
    right.grid(False)
    figure.colorbar(drawn, ax=right, shrink=0.6, label="gain of two facts (logarithm)")
    return figure


FIGURES = {"experiment": unknowns_figure, "experiment-corner": corner_figure, "experiment-facts": facts_figure}


def _label(result: xr.Dataset, k: int) -> str:
    name, unit = str(result["unknown"].values[k]).replace("_", " "), str(result["unit"].values[k])
    return name if unit == "1" else f"{name} ({'MS/m' if unit == 'S/m' else unit})"
