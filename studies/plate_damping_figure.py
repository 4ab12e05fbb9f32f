"""Figure and sentences of the study of the plate's damping, from its dataset alone."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from .figures import PALETTE, panels, styled

SWEEPS = {
    "below": ("distance of the face below the floater's centre (mm)", 1e3),
    "beside": ("distance of the face beside the floater's centre (mm)", 1e3),
    "conductivity": ("conductivity (MS/m), plate 18 mm below", 1e-6),
    "thickness": ("thickness (mm), plate 18 mm below", 1e3),
}
DISTANCES = (10, 15, 20, 30, 40, 60)
MODELS = {"": ("infinite slab", "o-", 3.0), ", real plate": ("real plate", "s", 6.0)}
"""By the ending of a sweep's name: what the plate is, its marks and their size."""
LINEAR = 0.1
"""Growth rates below this are drawn on a linear scale, 1/s."""


@styled
def damping_figure(result: xr.Dataset) -> Figure:
    """Growth of each small motion against place and material of the plate; what the plate does on average."""
    figure, axes = panels(2, 3, (11.0, 6.2))
    for (sweep, (label, scale)), place in zip(
        SWEEPS.items(), (axes[0, 0], axes[0, 1], axes[1, 0], axes[1, 1]), strict=True
    ):
        _growth(place, result, sweep, scale)
        place.set(xlabel=label, ylabel="growth rate (1/s)")
    axes[0, 0].set_title("Plate below")
    axes[0, 1].set_title("Plate standing beside")
    axes[1, 0].set_title("Conductivity")
    axes[1, 1].set_title("Thickness")
    axes[0, 0].legend(loc="lower right")
    for ending, (name, style, size) in MODELS.items():
        if _part(result, f"beside{ending}").sizes["case"]:
            axes[0, 1].plot([], [], style, ms=size, mfc="none" if ending else "0.3", color="0.3", label=name)
    axes[0, 1].legend(loc="lower right")
    _means(axes[0, 2], axes[1, 2], result)
    for place in (*axes[0], axes[1, 2]):
        place.set_xticks(DISTANCES, [f"{d:g}" for d in DISTANCES])
        place.xaxis.set_minor_locator(NullLocator())
    return figure


def _part(result: xr.Dataset, sweep: str) -> xr.Dataset:
    return result.isel(case=np.flatnonzero(result["sweep"].values == sweep)).sortby("value")


def _growth(axes: Axes, result: xr.Dataset, sweep: str, scale: float) -> None:
    for ending, (_, style, size) in MODELS.items():
        part = _part(result, sweep + ending)
        for mode, color in zip(result["mode"].values, PALETTE, strict=False):
            growth, error = part["growth"].sel(mode=mode).values, part["error"].values
            axes.errorbar(
                part["value"].values * scale, growth, yerr=np.abs(growth) * error, fmt=style, ms=size,
                mfc="none" if ending else color, color=color, label=None if ending or sweep != "below" else str(mode),
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("symlog", linthresh=LINEAR)
    axes.margins(y=0.12)
    axes.axhline(0.0, color="0.3", lw=0.8)


def _means(upper: Axes, lower: Axes, result: xr.Dataset) -> None:
    twin = lower.twinx()
    for sweep, style, color in (("below", "o-", PALETTE[0]), ("beside", "s--", PALETTE[1])):
        part = _part(result, sweep)
        distance = part["value"].values * 1e3
        upper.plot(distance, np.linalg.norm(part["shift"].values, axis=1) * 1e3, style, ms=3, color=color, label=sweep)
        lower.plot(distance, part["loss"].values * 1e3, style, ms=3, color=color, label=f"loss, {sweep}")
        torque = -part["torque"].sel(axis="z").values * 1e6
        twin.plot(
            distance,
            torque,
            style,
            ms=3,
            mfc="none",
            color=PALETTE[2 if sweep == "below" else 3],
            label=f"torque, {sweep}",
        )
    upper.set(
        xscale="log",
        yscale="log",
        xlabel="distance of the face (mm)",
        ylabel="displacement (mm)",
        title="Equilibrium moved by",
    )
    lower.set(
        xscale="log",
        yscale="log",
        xlabel="distance of the face (mm)",
        ylabel="loss in the plate (mW)",
        title="Loss and braking torque",
    )
    twin.set(yscale="log", ylabel="braking torque on the floater (µN m)")
    twin.grid(False)
    upper.legend()
    handles = [*lower.get_lines(), *twin.get_lines()]
    lower.legend(handles, [str(line.get_label()) for line in handles], loc="lower left")


def damping_lines(result: xr.Dataset) -> list[str]:
    """Where the plate stabilises and where it does not, and the size of what it does at 18 mm."""
    lines = []
    for sweep in ("below", "beside", "below, real plate", "beside, real plate"):
        part = _part(result, sweep)
        for k in range(part.sizes["case"]):
            one = part.isel(case=k)
            worst = one["growth"].max("mode")
            where = f"Plate {sweep}, face at {float(one['value']) * 1e3:5.1f} mm: "
            if np.isnan(worst):
                lines.append(f"{where}no equilibrium is left.")
                continue
            mode = str(result["mode"].values[int(one["growth"].argmax("mode"))])
            lines.append(
                f"{where}{'stable' if worst < 0 else 'UNSTABLE'}, slowest motion {mode} {float(worst):+.3g} /s "
                f"(without the plate {float(result['growth_without'].max()):+.1g} /s); moved "
                f"{float(np.linalg.norm(one['shift'])) * 1e3:.3f} mm; loss {float(one['loss']) * 1e3:.3g} mW; "
                f"braking torque {-float(one['torque'].sel(axis='z')) * 1e6:.3g} µN m."
            )
    return lines
