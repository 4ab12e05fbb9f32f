"""The figure of working points: where in each magnet the field is how low, and how much of it is below the knee."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..results import PAGE, PALETTE, panels, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def working_point_figure(found: xr.Dataset) -> Figure:
    """A row per magnet: a section along the easy axis through the lowest place, and the field over the volume."""
    count = found.sizes["magnet"]
    figure, axes = panels(count, 2, (PAGE, 2.9 * count))
    for k, (section, volume) in enumerate(axes):
        one = found.isel(magnet=k)
        u, v, knee = 1e3 * one["along"].values, 1e3 * one["across"].values, float(one["knee"])
        shown = section.pcolormesh(u, v, one["section"].values, cmap="viridis", shading="nearest", rasterized=True)
        figure.colorbar(shown, ax=section, label="μ0 H along the easy axis (T)")
        if np.nanmin(one["section"].values) < knee:
            below = np.where(one["section"].values < knee, 1.0, np.nan)
            section.contourf(u, v, below, levels=[0.5, 1.5], colors="none", hatches=["////"])
            section.contour(u, v, np.nan_to_num(one["section"].values), levels=[knee], colors="white", linewidths=1)
        away = one["place"].values - one["center"].values
        where = [1e3 * float(away @ one[name].values) for name in ("easy_axis", "across_axis")]
        section.plot(*where, "o", color=PALETTE[1], markersize=5, markeredgecolor="white", clip_on=False)
        section.set(title=f"Magnet {int(one['magnet'])}", xlabel="along the easy axis (mm)", ylabel="across (mm)")
        section.set_aspect("equal")
        section.grid(False)
        volume.plot(one["levels"], 100 * found["share"])
        volume.axvline(float(one["lowest"]), color=PALETTE[1], linestyle="--", label="lowest, off the edges")
        if np.isfinite(knee):
            volume.axvline(knee, color="black", label="knee")
        volume.set(xlabel="μ0 H along the easy axis (T)", ylabel="share of the volume below (%)", ylim=(0, 100))
        volume.legend()
    return figure
