"""The figure of a map of the field on a plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..results import NAMES, PAGE, panels, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def field_map_figure(found: xr.Dataset) -> Figure:
    """|B| with field lines through the magnets, by model; below, what they differ from the finite elements."""
    from matplotlib.colors import LogNorm

    figure, axes = panels(2, 3, (PAGE, 4.6), sharex=True, sharey=True)
    size = 1e3 * np.linalg.norm(found["B"].values, axis=-1)
    limits = LogNorm(*np.nanpercentile(size[2], [1, 99.5]))
    for k, model in enumerate(found["model"].values.tolist()):
        shown = _colours(axes[0, k], found, size[k], limits, "viridis")
        _lines(axes[0, k], found, model)
        axes[0, k].set_title("closed form (μr = 1)" if model == "cuboid" else NAMES[model])
    figure.colorbar(shown, ax=axes[0].tolist(), label="|B| (mT)")
    apart = LogNorm(1e-6, 1.0)
    error = found["error"].values / np.linalg.norm(found["B"].sel(model="fem").values, axis=-1)
    titles = ("dipole, difference", "closed form, difference", "finite elements, stated error")
    differences = [found["difference"].sel(model=model).values for model in ("dipole", "cuboid")]
    for axis, values, title in zip(axes[1], [*differences, error], titles, strict=True):
        shown = _colours(axis, found, np.clip(values, 1e-6, 1.0), apart, "magma")
        axis.set_title(title)
        axis.set_xlabel(f"{found.attrs['plane'][0]} (mm)")
    figure.colorbar(shown, ax=axes[1].tolist(), label="|ΔB| / |B|")
    for axis in axes[:, 0]:
        axis.set_ylabel(f"{found.attrs['plane'][1]} (mm)")
    return figure


def _colours(axes: Axes, found: xr.Dataset, values: Any, norm: Any, cmap: str) -> Any:
    u, v = 1e3 * found["u"].values, 1e3 * found["v"].values
    shown = axes.pcolormesh(u, v, values, norm=norm, cmap=cmap, shading="gouraud", rasterized=True)
    magnet = found["magnet"].values
    for number in range(1, int(magnet.max()) + 1):
        axes.contour(u, v, (magnet == number).astype(float), levels=[0.5], colors="white", linewidths=0.8)
    axes.set_aspect("equal")
    axes.grid(False)
    return shown


def _lines(axes: Axes, found: xr.Dataset, model: str) -> None:
    """Lines of B in the plane; they go on in the magnets, as B has no sources."""
    plane = ["xyz".index(name) for name in str(found.attrs["plane"])]
    b = np.nan_to_num(found["B"].sel(model=model).values)
    u, v = 1e3 * found["u"].values, 1e3 * found["v"].values
    even = [np.linspace(line[0], line[-1], len(line)) for line in (u, v)]
    across, up = b[..., plane[0]], b[..., plane[1]]
    axes.streamplot(even[0], even[1], across, up, color="white", linewidth=0.4, density=1.1, arrowsize=0.5)
