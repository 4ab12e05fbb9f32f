"""Figure of the study of the floater's permeability, drawn from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..results import PAGE, PALETTE, panels, styled

LABELS = {
    "floater_answer": "floater answers to the rotor",
    "rotor_answer": "rotor answers to the floater",
    "total": "both",
}


@styled
def floater_figure(result: xr.Dataset) -> Figure:
    """What the rigid dipole misses against distance: share of force and torque; axial force by its two causes."""
    figure, ((left, right),) = panels(1, 2, (PAGE, 2.9))
    _shares(left, result)
    _axial(right, result)
    if "rigid_position" in result:
        place = -1e3 * float(result["rigid_position"].sel(axis="z"))
        for axes in (left, right):
            axes.axvline(place, color="0.3", lw=0.8, ls=":", label="stable equilibrium")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17))
    right.legend(loc="upper right")
    return figure


FIGURES = {"floater-permeability": floater_figure}


def _shares(axes: Axes, result: xr.Dataset) -> None:
    distance = 1e3 * result["distance"].values
    for quantity, color in zip(("force", "torque"), PALETTE, strict=False):
        share, error = (result[f"{quantity}_{name}"].values for name in ("missed", "missed_error"))
        axes.semilogy(distance, share, "o-", ms=3, color=color, label=f"{quantity}, |Δ| / |total|")
        axes.fill_between(distance, np.maximum(share - error, share / 100), share + error, color=color, alpha=0.25)
    for level in result["level"].values:
        axes.axhline(level, color="0.6", lw=0.6)
        axes.annotate(f"{100 * level:g} %", (distance[-1], level), ha="right", va="bottom", fontsize=7)
    axes.set(xlabel="distance below the rotor (mm)", ylabel="missed share", title="What a rigid dipole misses")


def _axial(axes: Axes, result: xr.Dataset) -> None:
    distance, force = 1e3 * result["distance"].values, result["force"].sel(axis="z")
    weight = float(result.attrs["weight_N"])
    for (part, label), color in zip(LABELS.items(), PALETTE[2:], strict=False):
        values = force.sel(part=part) - (force.sel(part="rigid") if part == "total" else 0.0)
        axes.semilogy(distance, np.abs(values) / weight, "o-", ms=3, color=color, label=label)
    axes.set(xlabel="distance below the rotor (mm)", ylabel="|missed axial force| / weight", title="Missed lift")


def floater_lines(result: xr.Dataset) -> list[str]:
    """From where on the rigid dipole suffices, and what it misses at the stable equilibrium."""
    lines = ["The rigid dipole suffices for the force / the torque on the floater:"]
    for level in result["level"].values:
        reach = [1e3 * float(result["sufficient_from"].sel(quantity=q, level=level)) for q in ("force", "torque")]
        words = ["beyond the range" if np.isnan(r) else f"from {r:.1f} mm on" for r in reach]
        lines.append(f"  to {100 * float(level):g} %: {words[0]} / {words[1]}")
    if "shift" in result:
        force, error = (float(result[name].sel(axis="z")) for name in ("missed_force", "missed_force_error"))
        shift, doubt = (1e3 * float(result[name].sel(axis="z")) for name in ("shift", "shift_error"))
        share = 100 * abs(force) / result.attrs["weight_N"]
        lines.append(
            f"At the stable equilibrium it misses {1e3 * force:+.4f} ± {1e3 * error:.1g} mN, {share:.1f} % of the "
            f"weight: the floater hangs {shift:+.4f} ± {doubt:.1g} mm higher."
        )
    return lines
