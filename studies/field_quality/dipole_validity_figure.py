"""Figure and table of the study of the dipole's validity, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...geometry.basics import Array
from ..results import PAGE, panels, styled

LEVELS = (1e-1, 1e-2, 1e-3, 1e-4)


def validity_lines(result: xr.Dataset) -> list[str]:
    """From which distance on each model is good to 10, 1, 0.1 and 0.01 % on the axis, by rotor."""
    lines = ["Distance (mm) below the lower magnet from which on B on the axis is good to 10 / 1 / 0.1 / 0.01 %:"]
    for rotor in result["rotor"].values:
        for model in result["model"].values:
            error = result["field_error"].sel(rotor=rotor, model=model).isel(offset=0).values
            entries = [_reach(1e3 * result["distance"].values, error, level) for level in LEVELS]
            lines.append(f"  {rotor:22} {model:27} {' '.join(entries)}")
    return lines


def _reach(distance: Array, error: Array, level: float) -> str:
    """The distance beyond which the error stays below a level, interpolated; '>' if it never does."""
    above = np.flatnonzero(error > level)
    if not len(above):
        return f"  <{distance[0]:4.1f}"
    last = int(above[-1])
    if last == len(distance) - 1:
        return f"  >{distance[-1]:4.1f}"
    share = np.log(error[last] / level) / np.log(error[last] / error[last + 1])
    return f"   {distance[last] + share * (distance[last + 1] - distance[last]):4.1f}"


@styled
def validity_figure(result: xr.Dataset) -> Figure:
    """Regions in which each model is good to 10, 1, 0.1 and 0.01 %, rotor by rotor."""
    rotors, names = result["rotor"].values, result["model"].values
    figure, axes = panels(len(rotors), len(names), (PAGE, 1.5 * len(rotors) + 0.3), sharex=True, sharey=True)
    colors = ["#2c7bb6", "#92c5de", "#ffffbf", "#fdae61", "#d7191c"]
    bounds = [1e-9, *LEVELS[::-1], 1e3]
    for row, rotor in zip(axes, rotors, strict=True):
        for panel, model in zip(row, names, strict=True):
            error = result["field_error"].sel(rotor=rotor, model=model)
            shown = panel.contourf(
                1e3 * result["offset"], 1e3 * result["distance"], np.clip(error, 1e-8, 1e2), bounds, colors=colors
            )
            panel.grid(visible=False)
            if rotor == rotors[0]:
                panel.set_title(model.replace(", ", ",\n"), fontsize="small")
            if rotor == rotors[-1]:
                panel.set_xlabel("offset (mm)")
            if model == names[0]:
                panel.set_ylabel(f"{rotor}\ndistance (mm)", fontsize="small")
    axes[0, 0].invert_yaxis()
    bar = figure.colorbar(shown, ax=axes, shrink=0.7, ticks=LEVELS, label="relative error of B")
    bar.ax.set_yticklabels([f"{100 * level:g} %" for level in LEVELS])
    return figure


FIGURES = {"dipole-validity": validity_figure}
