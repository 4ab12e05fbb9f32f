"""Figure and sentences of the study of the field's components, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from ...geometry.basics import Array
from ..results import DASHES, NAMES, PALETTE, cases_with, panels, styled
from .article import CONFIGURATIONS
from .article_figure import TITLES

PARTS = {"off_axis": "off-axis $B_\\perp$ (mT)", "on_axis": "on-axis $B_z$ (mT)"}


@styled
def components_figure(result: xr.Dataset) -> Figure:
    """Both components against the parameter of each configuration, and how far the simpler models are off."""
    figure, axes = panels(3, 3, (10.0, 8.6))
    for row, (configuration, kind) in zip(axes, CONFIGURATIONS.items(), strict=True):
        part = cases_with(result, configuration=configuration)
        for axis, (quantity, text) in zip(row, PARTS.items(), strict=False):
            _components(axis, part, quantity)
            axis.set(ylabel=text, yscale="log")
            axis.yaxis.set_major_formatter(FuncFormatter(lambda field, _: f"{field:g}"))
            axis.yaxis.set_minor_formatter(NullFormatter())
        _differences(row[2], part)
        row[0].set_title(TITLES[configuration])
        row[2].set(ylabel="|ΔB| / |B| (%)", yscale="log", title="Difference from finite elements")
        for axis in row:
            axis.set_xlabel(f"{kind.symbol} ({kind.unit})")
    _keys(axes[0, 0], axes[0, 1], axes[0, 2], result["distance"].values)
    return figure


def _keys(first: Axes, second: Axes, third: Axes, distances: Array) -> None:
    for distance, color in zip(distances, PALETTE, strict=False):
        first.plot([], [], color=color, label=f"{1e3 * distance:g} mm below")
    first.legend(ncols=2, loc="lower left")
    first.set_ylim(0.25, 45)
    for model in ("fem", "dipole"):
        second.plot([], [], DASHES[model], color="0.3", label=NAMES[model])
    second.plot([], [], "+", color="0.3", label="article's formula")
    second.legend(loc="lower right")
    for model in ("dipole", "cuboid"):
        third.plot([], [], DASHES[model], color="0.3", label=NAMES[model])
    third.fill_between([], [], [], color="0.8", label="estimated error of the finite elements")
    third.legend()


def _components(axes: Axes, part: xr.Dataset, quantity: str) -> None:
    for k, color in zip(range(part.sizes["distance"]), PALETTE, strict=False):
        for model in ("fem", "dipole", "article"):
            value, field = _curve(part, model, quantity, k)
            style = {"article": "+"}.get(model, DASHES.get(model, "-"))
            axes.plot(value, 1e3 * field, style, color=color, ms=5)
        value, field = _curve(part, "fem", quantity, k)
        error = _curve(part, "fem", "field_error", k)[1]
        axes.fill_between(value, 1e3 * (field - error), 1e3 * (field + error), color=color, alpha=0.3, lw=0)


def _differences(axes: Axes, part: xr.Dataset) -> None:
    for k, color in zip(range(part.sizes["distance"]), PALETTE, strict=False):
        value, across = _curve(part, "fem", "off_axis", k)
        along = _curve(part, "fem", "on_axis", k)[1]
        size = np.hypot(across, along)
        for model in ("dipole", "cuboid"):
            axes.plot(value, 100 * difference(part, model, k), DASHES[model], color=color)
        error = 100 * _curve(part, "fem", "field_error", k)[1] / size
        axes.fill_between(value, error / 3, error, color="0.8", lw=0)


def difference(part: xr.Dataset, model: str, k: int) -> Array:
    """|B - B_fem| / |B_fem| of a configuration's rotors at the k-th distance."""
    apart = [_curve(part, model, q, k)[1] - _curve(part, "fem", q, k)[1] for q in PARTS]
    true = [_curve(part, "fem", q, k)[1] for q in PARTS]
    return np.asarray(np.hypot(*apart) / np.hypot(*true))


def _curve(part: xr.Dataset, model: str, quantity: str, k: int) -> tuple[Array, Array]:
    rows = cases_with(part, model=model).sortby("value")
    return rows["value"].values, rows[quantity].values[:, k]


def components_lines(result: xr.Dataset) -> list[str]:
    """How each component goes with the parameter, and how far the simpler models are off, at each distance."""
    lines = []
    for configuration, kind in CONFIGURATIONS.items():
        part = cases_with(result, configuration=configuration)
        for k, distance in enumerate(result["distance"].values):
            value, across = _curve(part, "fem", "off_axis", k)
            along = _curve(part, "fem", "on_axis", k)[1]
            where = f"{1e3 * distance:g} mm below, {kind.symbol} = {value[0]:g} to {value[-1]:g} {kind.unit}"
            lines.append(
                f"{configuration}, {where}: "
                f"off-axis {1e3 * across[0]:.3f} to {1e3 * across[-1]:.3f} mT, "
                f"on-axis {1e3 * along[0]:.3f} to {1e3 * along[-1]:.3f} mT; off by at most "
                f"{100 * difference(part, 'dipole', k).max():.2g} % (dipole), "
                f"{100 * difference(part, 'cuboid', k).max():.2g} % (μr = 1), "
                f"{100 * difference(part, 'article', k).max():.2g} % (article's formula); finite elements to "
                f"{100 * (_curve(part, 'fem', 'field_error', k)[1] / np.hypot(across, along)).max():.1g} %."
            )
    return lines
