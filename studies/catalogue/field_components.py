"""On-axis and off-axis field at several places of the floater against the parameter of each of the article's rotors."""

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from ...geometry.common import Array
from ..figures.style import DASHES, NAMES, PALETTE, legend_below, styled
from ..result import Columns, columns, variable
from ..scene_tables import sources
from ..study import Point, Study, cases_with, one_case
from .article import CONFIGURATIONS, article_scene, field, label_of, levitation_of
from .drawing import by_configuration, configuration_panels, explain, text_table

DISTANCES = (15e-3, 20e-3, 25e-3, 30e-3, 40e-3)
"""Places of the floater on the axis below the rotor, m; the article's text does not give its own."""
MODELS = ("article", "dipole", "cuboid", "fem")
COLUMNS: Columns = {
    "off_axis": (("distance",), "T", "field across the axis"),
    "on_axis": (("distance",), "T", "field along the axis"),
    "field_error": (("distance",), "T", "estimated error of the field"),
}


def field_points(quick: bool) -> list[Point]:
    """Every rotor of the article; `quick` takes the first, the middle and the last of each configuration."""
    return [
        {"configuration": name, "value": value, "model": model}
        for name, kind in CONFIGURATIONS.items()
        for value in (kind.tested[:: (len(kind.tested) - 1) // 2] if quick else kind.tested)
        for model in MODELS
    ]


def field_components(point: Point) -> xr.Dataset:
    """Field of one rotor by one model over `distance`, with the model's own error (0 for the article's formula)."""
    distance = np.array(DISTANCES)
    if point["model"] == "article":
        across, along = field(point["configuration"], point["value"], distance)
        error = np.zeros_like(distance)
    else:
        scene = article_scene(point["configuration"], point["value"])
        model = sources(levitation_of(scene, point["model"]).table)
        places = distance[:, None] * np.array([0.0, 0.0, -1.0])
        b, _ = model.evaluate(places)
        across, along, error = np.hypot(b[:, 0], b[:, 1]), b[:, 2], model.absolute_error(places)[0]
    data = columns(COLUMNS, dict(zip(COLUMNS, (across, along, error), strict=True)))
    there = variable(("distance",), distance, "m", "distance below the rotor's origin")
    return one_case(point, xr.Dataset(data, {"distance": there}))


def _of(part: xr.Dataset, model: str) -> xr.Dataset:
    return cases_with(part, model=model).sortby("value")


def difference(part: xr.Dataset, model: str) -> Array:
    """|B - B_fem| / |B_fem| (rotor, distance) of a configuration's rotors."""
    simple, true = _of(part, model), _of(part, "fem")
    apart = np.hypot(*(simple[q].values - true[q].values for q in ("off_axis", "on_axis")))
    return np.asarray(apart / np.hypot(true["off_axis"].values, true["on_axis"].values))


def relative_error(part: xr.Dataset) -> Array:
    """The finite elements' own error (rotor, distance)."""
    true = _of(part, "fem")
    return np.asarray(true["field_error"].values / np.hypot(true["off_axis"].values, true["on_axis"].values))


@styled
def component_figure(result: xr.Dataset, quantity: str, ylabel: str) -> Figure:
    """One component of the field below the rotor against the parameter of each configuration."""
    figure, rows = configuration_panels(result, 2.7, ylabel=ylabel, sharey=True)
    for axes, configuration, part in rows:
        for model, style in (("fem", DASHES["fem"]), ("dipole", DASHES["dipole"]), ("article", "+")):
            found = _of(part, model)
            for k, color in zip(range(found.sizes["distance"]), PALETTE, strict=False):
                axes.plot(found["value"], 1e3 * found[quantity][:, k], style, color=color, ms=4)
        axes.set(xlabel=label_of(configuration), yscale="log")
    rows[0][0].yaxis.set_major_formatter(ScalarFormatter())
    _legend(figure, result, {"fem": NAMES["fem"], "dipole": NAMES["dipole"]}, {"formulas of the article": "+"})
    return figure


@styled
def differences_figure(result: xr.Dataset) -> Figure:
    """How far the simpler models are from the finite elements."""
    figure, rows = configuration_panels(result, 2.7, ylabel="deviation |ΔB| / |B| (%)", sharey=True)
    for axes, configuration, part in rows:
        value = _of(part, "fem")["value"]
        for k, color in zip(range(part.sizes["distance"]), PALETTE, strict=False):
            for model in ("dipole", "cuboid"):
                axes.plot(value, 100 * difference(part, model)[:, k], DASHES[model], color=color)
        worst = 100 * relative_error(part).max(axis=1)
        axes.plot(value, worst, ":", color="0.5", lw=1.6)
        axes.set(xlabel=label_of(configuration), yscale="log")
    names = {model: NAMES[model] for model in ("dipole", "cuboid")}
    _legend(figure, result, names, {"largest error of the finite elements": ":"})
    return figure


def _legend(figure: Figure, result: xr.Dataset, models: dict[str, str], more: dict[str, str]) -> None:
    axes = figure.axes[0]
    for distance, color in zip(result["distance"].values, PALETTE, strict=False):
        explain(axes, {f"{1e3 * distance:g} mm below": "-"}, color=color)
    explain(axes, {name: DASHES[model] for model, name in models.items()} | more)
    legend_below(figure, axes, columns=4)


FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "field-components-off-axis": partial(
        component_figure, quantity="off_axis", ylabel=r"off-axis field $B_\perp$ (mT)"
    ),
    "field-components-on-axis": partial(component_figure, quantity="on_axis", ylabel=r"on-axis field $B_z$ (mT)"),
    "field-components-differences": differences_figure,
}


def components_lines(result: xr.Dataset) -> list[str]:
    """Range of each component, and how far the simpler models are off, at each distance."""
    rows = []
    for configuration, part in by_configuration(result):
        true, error = _of(part, "fem"), relative_error(part)
        off = {model: difference(part, model) for model in ("dipole", "cuboid", "article")}
        for k, distance in enumerate(1e3 * result["distance"].values):
            ends = [" to ".join(f"{1e3 * true[q].values[n, k]:.3f}" for n in (0, -1)) for q in ("off_axis", "on_axis")]
            worst = [f"{100 * values[:, k].max():.2g}" for values in (*off.values(), error)]
            rows.append((f"{configuration}, {distance:g} mm", *ends, *worst))
    head = ("rotors, distance", "off-axis (mT)", "on-axis (mT)", "dipole", "μr = 1", "formula", "error")
    last = "Largest deviations from the finite elements, and their own estimated error, in per cent of |B|."
    return [*text_table(head, rows), last]


STUDY = Study(
    name="field-components",
    summary="off-axis and on-axis field against the parameter of each rotor of the article, by four models",
    points=field_points,
    compute=field_components,
    figures=FIGURES,
    report=components_lines,
)
