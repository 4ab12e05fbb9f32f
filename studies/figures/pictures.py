"""Figure and report of one's own question, from its result alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..results import PALETTE, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = {
    "equilibria": ("depth", "lateral_offset", "polar_angle", "growth"),
    "flight": ("levitated", "height_spread"),
    "field": ("size", "B_error"),
}
"""Quantities drawn for each question, those of the motion in the laboratory."""


def drawable(result: xr.Dataset) -> bool:
    """Whether there is a figure for so many parameters."""
    return len(_varied(result)) <= 2


@styled
def question_figure(result: xr.Dataset) -> Figure:
    """Curves over one parameter or maps over two."""
    shown = _derived(result)
    names, varied = _shown(shown), _varied(result)
    figure, axes = panels(-(-len(names) // 2), 2, (8.4, 3.6 * -(-len(names) // 2)))
    for panel, name in zip(axes.ravel(), names, strict=True):
        if len(varied) == 1:
            _curves(panel, shown, name, varied[0])
        else:
            _map(panel, shown, name, varied)
    return figure


def _shown(result: xr.Dataset) -> list[str]:
    """Names of what is drawn of a result; one of an older version has less."""
    return [name for name in SHOWN[str(result.attrs["ask"])] if name in result]


def _derived(result: xr.Dataset) -> xr.Dataset:
    """The result with what is drawn instead of what is kept."""
    if "position" in result:
        depth = (-1e3 * result["position"].sel(axis="z")).assign_attrs(units="mm", long_name="levitation distance")
        result = result.assign(depth=depth)
    if "lateral_offset" in result:
        aside = (1e3 * result["lateral_offset"]).assign_attrs(units="mm", long_name="lateral offset")
        angle = result["polar_angle"].assign_attrs(long_name="polar angle")
        result = result.assign(lateral_offset=aside, polar_angle=angle)
    if "B" in result:
        size = 1e3 * (result["B"] ** 2).sum("axis", skipna=False) ** 0.5
        return result.assign(size=size.assign_attrs(units="mT", long_name="|B|"))
    return result


def _curves(axes: Axes, result: xr.Dataset, name: str, key: str) -> None:
    values, x = result[name], result[key].values
    if "equilibrium" not in values.dims:
        axes.plot(x, values.values, "o-", ms=3)
    else:
        for stable, fill in ((1, PALETTE[0]), (0, "white")):
            chosen = values.where(result["stable"] == stable).transpose(key, "equilibrium").values
            axes.plot([], [], "o", color=PALETTE[0], mfc=fill, ms=4, label="stable" if stable else "unstable")
            axes.plot(x, chosen, "o", color=PALETTE[0], mfc=fill, ms=4)
        axes.legend()
    axes.set(xlabel=key, ylabel=_label(values))
    if name == "growth":
        axes.set_yscale("symlog", linthresh=1e-3)


def _map(axes: Axes, result: xr.Dataset, name: str, keys: list[str]) -> None:
    values = result[name]
    if "equilibrium" in values.dims:  # the first is stable wherever any is
        values = values.where(result["stable"] == 1).isel(equilibrium=0).assign_attrs(values.attrs)
        axes.set_title("stable equilibrium nearest to the rotor")
    drawn = axes.pcolormesh(
        result[keys[1]].values, result[keys[0]].values, values.transpose(*keys).values, shading="nearest"
    )
    axes.set(xlabel=keys[1], ylabel=keys[0])
    if axes.figure is not None:
        axes.figure.colorbar(drawn, ax=axes, label=_label(values))


def _label(values: xr.DataArray) -> str:
    return f"{values.attrs['long_name']} ({values.attrs['units']})"


def _varied(result: xr.Dataset) -> list[str]:
    return [str(key) for key in np.atleast_1d(result.attrs["varied"])]


def question_lines(result: xr.Dataset) -> list[str]:
    """What was found, in a few lines."""
    varied, ask = _varied(result), str(result.attrs["ask"])
    grid = " × ".join(f"{key} ({result.sizes[key]})" for key in varied)
    lines = [f"Asked for {ask} over {grid}."]
    shown = _derived(result)
    if "stable" in shown:
        some = (shown["stable"] == 1).any("equilibrium")
        lines.append(f"A stable equilibrium at {int(some.sum())} of {some.size} points.")
        shown = shown.where(shown["stable"] == 1)
    if "unknown" in result and (result["unknown"] > 0).any():
        lines.append(f"At {int((result['unknown'] > 0).sum())} points not all equilibria could be computed.")
    for name in _shown(shown):
        values = shown[name].values[np.isfinite(shown[name].values)]
        if len(values):
            what = f"{shown[name].attrs['long_name']}{' where stable' if 'stable' in shown else ''}"
            units = {"1": ""}.get(shown[name].attrs["units"], shown[name].attrs["units"])
            lines.append(f"{what}: {values.min():.6g} to {values.max():.6g} {units}".rstrip())
    return lines
