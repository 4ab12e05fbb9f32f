"""On-axis and off-axis field at several places of the floater against the parameter of each of the article's rotors."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from ...geometry.common import Array
from ..figures.style import DASHES, NAMES, PALETTE, styled
from ..levitation import sources
from ..result import variable
from ..study import Point, Study, by_case, cases_with, one_case
from .article import CONFIGURATIONS, article_scene, field, levitation_of, one_panel_each

DISTANCES = (15e-3, 20e-3, 25e-3, 30e-3, 40e-3)
"""Places of the floater on the axis below the rotor, m; the article's text does not give its own."""
MODELS = ("article", "dipole", "cuboid", "fem")


def field_points(quick: bool) -> list[Point]:
    """Every rotor of the article; `quick` takes the first, the middle and the last of each configuration."""
    return [
        {"configuration": name, "value": value, "model": model}
        for name, kind in CONFIGURATIONS.items()
        for value in (kind.tested[:: (len(kind.tested) - 1) // 2] if quick else kind.tested)
        for model in MODELS
    ]


def field_components(point: Point) -> xr.Dataset:
    """Field of one rotor by one model.

    Returns
    -------
    Dataset over `distance`: |B⊥| and B_z, in tesla, and the model's own estimate of the error of either (0 for the
    article's formula, which states none).
    """
    distance = np.array(DISTANCES)
    if point["model"] == "article":
        across, along = field(point["configuration"], point["value"], distance)
        error = np.zeros_like(distance)
    else:
        scene = article_scene(point["configuration"], point["value"])
        table = sources(levitation_of(scene, point["model"]).table)
        places = distance[:, None] * np.array([0.0, 0.0, -1.0])
        b, _ = table.evaluate(places)
        across, along, error = np.hypot(b[:, 0], b[:, 1]), b[:, 2], table.absolute_error(places)[0]
    return one_case(
        point,
        xr.Dataset(
            {
                "off_axis": variable(("distance",), across, "T", "field across the axis"),
                "on_axis": variable(("distance",), along, "T", "field along the axis"),
                "field_error": variable(("distance",), error, "T", "estimated error of the field"),
            },
            {"distance": variable(("distance",), distance, "m", "distance below the rotor's origin")},
        ),
    )


PARTS = {"off_axis": "off-axis field $B_\\perp$ (mT)", "on_axis": "on-axis field $B_z$ (mT)"}
DRAWN_MODELS = ("fem", "dipole", "article")


@styled
def component_figure(result: xr.Dataset, quantity: str) -> Figure:
    """One component of the field below the rotor against the parameter of each configuration."""
    figure, axes = _logarithmic_panels(result)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        _component(panel, cases_with(result, configuration=configuration), quantity)
    axes[0].set(ylabel=PARTS[quantity], ylim=(0.02 if quantity == "on_axis" else 0.2, None))
    axes[0].yaxis.set_major_formatter(FuncFormatter(lambda field, _: f"{field:g}"))
    for model in ("fem", "dipole"):
        axes[1].plot([], [], DASHES[model], color="0.3", label=NAMES[model])
    axes[1].plot([], [], "+", color="0.3", label="article's formula")
    axes[1].legend(loc="lower left")
    return figure


@styled
def differences_figure(result: xr.Dataset) -> Figure:
    """How far the simpler models are from the finite elements."""
    figure, axes = _logarithmic_panels(result)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        _differences(panel, cases_with(result, configuration=configuration))
    axes[0].set(ylabel="difference |ΔB| / |B| (%)", ylim=(1e-4, 100))
    for model in ("dipole", "cuboid"):
        axes[1].plot([], [], DASHES[model], color="0.3", label=NAMES[model])
    axes[1].fill_between([], [], [], color="0.8", label="error of the finite elements")
    axes[1].legend(loc="lower left")
    return figure


FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "field-components-off-axis": partial(component_figure, quantity="off_axis"),
    "field-components-on-axis": partial(component_figure, quantity="on_axis"),
    "field-components-differences": differences_figure,
}


def _logarithmic_panels(result: xr.Dataset) -> tuple[Figure, Any]:
    """A logarithmic panel for each configuration; the first says the colours of the distances."""
    figure, axes = one_panel_each(2.7, sharey=True)
    for panel, kind in zip(axes, CONFIGURATIONS.values(), strict=True):
        panel.set(xlabel=f"{kind.symbol} ({kind.unit})", yscale="log")
    for distance, color in zip(result["distance"].values, PALETTE, strict=False):
        axes[0].plot([], [], color=color, label=f"{1e3 * distance:g} mm below")
    axes[0].legend(loc="lower left", ncols=2, columnspacing=1.0)
    return figure, axes


def _component(axes: Axes, part: xr.Dataset, quantity: str) -> None:
    for k, color in zip(range(part.sizes["distance"]), PALETTE, strict=False):
        for model in DRAWN_MODELS:
            value, field = _curve(part, model, quantity, k)
            axes.plot(value, 1e3 * field, "+" if model == "article" else DASHES[model], color=color, ms=4)
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


STUDY = Study(
    name="field-components",
    summary="off-axis and on-axis field against the parameter of each rotor of the article, by four models",
    points=field_points,
    compute=field_components,
    gather=by_case,
    figures=FIGURES,
    report=components_lines,
)
