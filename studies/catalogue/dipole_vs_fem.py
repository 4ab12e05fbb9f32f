"""How wrong is the dipole? Levitation of the article's rotors by dipoles and by finite magnets, cause by cause."""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...dynamics.continuation.frequencies import StableRange, at_frequency, reference_state, stable_range
from ...dynamics.equilibria.modes import named_modes
from ...dynamics.motion.rates import Rates
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.style import PALETTE, legend_below, styled
from ..result import Columns, columns, variable
from ..study import Point, Study, case_with, each_case, one_case
from .article import article_scene, levitated_rotors, levitation_of, polar_angle, rotor_label
from .drawing import (
    by_configuration,
    configuration_panels,
    explain,
    range_text,
    rotor_colors,
    rotor_places,
    text_table,
    uncertain,
)

MODELS = ("article", "dipole", "cuboid", "fem", "mutual")
"""Point dipoles of the full remanence; the floater's moment lowered by its own permeability; the rotor's shape; its
permeability; both bodies magnetise each other."""
COLUMNS: Columns = {
    "distance": (("model", "step"), "m", "distance from the rotor"),
    "polar_angle": (("model", "step"), "°", "polar angle of the moment"),
    "mode_frequency": (("model", "step", "mode"), "Hz", "frequency of a mode, rotor's frame"),
    "lowest": (("model",), "Hz", "lowest frequency of stable levitation"),
    "highest": (("model",), "Hz", "highest frequency of stable levitation"),
}
ERRORS: Columns = {f"{key}_error": (dims, unit, f"error of the {of}") for key, (dims, unit, of) in COLUMNS.items()}
MODES = ("bounce", "side, backward", "side, forward", "precession", "nutation")
SIDES = ("low", "high")
RTOL, COARSE = 1e-5, 1e-4
"""Accuracy of the finite elements, and of those whose distance from them is the error estimate."""
ROUND_OFF = 1e-10  # Relative error of what needs no finite elements


def points(quick: bool) -> list[Point]:
    """The rotors that levitated; quick: one frequency."""
    return [{**rotor, "steps": 1 if quick else 4, "rtols": [RTOL, COARSE]} for rotor in levitated_rotors(quick)]


def compute(point: Point) -> xr.Dataset:
    """Distance, polar angle, modes and limits of stability of one rotor, by every model and with errors."""
    scene = article_scene(point["configuration"], point["measure"], drag=False)
    bare = replace(scene, floater=replace(scene.floater, recoil_permeability=1.0))
    start, (fine, coarse) = reference_state(scene), point["rtols"]
    dipole, together = levitation_of(scene, "dipole").rates, levitation_of(scene, "fem", fine, "mutual")
    made = {
        "article": (bare, dipole),
        "dipole": (scene, dipole),
        "cuboid": (scene, levitation_of(scene, "cuboid").rates),
        "fem": (scene, levitation_of(scene, "fem", fine).rates),
        "coarse": (scene, levitation_of(scene, "fem", coarse).rates),
        "mutual": (scene, together.rates),
    }
    ranges = {name: stable_range(*each, *start) for name, each in made.items()}
    low = max(each.low.parameter for each in ranges.values())
    high = min(each.high.parameter for each in ranges.values())
    grid = low + (high - low) * (np.arange(point["steps"]) + 0.5) / point["steps"]
    rows = {name: _described(*each, ranges[name], grid) for name, each in made.items()}
    middle, answers = ranges["mutual"].near(float(grid[len(grid) // 2])), together.answers[0]
    doubt = max(float(part[0]) for part in answers.relative_error(middle.position)) if answers else 0.0
    errors = {name: {key: ROUND_OFF * np.abs(value) for key, value in rows[name].items()} for name in MODELS[:3]}
    errors["fem"] = {key: np.abs(value - rows["coarse"][key]) for key, value in rows["fem"].items()}
    errors["mutual"] = {
        key: doubt * np.abs(value - rows["fem"][key]) + errors["fem"][key] for key, value in rows["mutual"].items()
    }
    data = columns(COLUMNS, {name: np.array([rows[model][name] for model in MODELS]) for name in COLUMNS})
    data |= columns(ERRORS, {f"{name}_error": np.array([errors[model][name] for model in MODELS]) for name in COLUMNS})
    data["frequency"] = variable(("step",), grid, "Hz", "frequency of the rotor")
    for side in SIDES:
        data[f"{side}_kind"] = xr.Variable(("model",), [getattr(ranges[model], side).kind for model in MODELS])
    return one_case(point, xr.Dataset(data, {"model": list(MODELS), "mode": list(MODES)}))


def _described(scene: Scene, rates: Rates, stable: StableRange, grid: Array) -> dict[str, Array]:
    """What one model gives at the frequencies of a grid, and between which it levitates."""
    found = [at_frequency(scene, rates, stable.near(float(f)), float(f)) for f in grid]
    modes = [named_modes(point.motion, point.time_unit) for point in found]
    return {
        "distance": np.array([point.distance for point in found]),
        "polar_angle": np.degrees(polar_angle(np.array([point.state[6:9] for point in found]))),
        "mode_frequency": np.array([[mode.frequency_hz for mode in row] for row in modes]),
        "lowest": np.array(stable.low.parameter),
        "highest": np.array(stable.high.parameter),
    }


CAUSES = {
    "floater's permeability": ("article", "dipole"),
    "shape": ("dipole", "cuboid"),
    "rotor's permeability": ("cuboid", "fem"),
    "mutual magnetisation": ("fem", "mutual"),
}
"""What lies between two models."""
TOTAL = ("article", "mutual")
ENDS = {"contact": ("v", "ends at the rotor"), "border": ("^", "goes on beyond")}
"""Upper ends that are no loss of stability."""


def change(result: xr.Dataset, name: str, models: tuple[str, str]) -> tuple[xr.DataArray, xr.DataArray]:
    """By how much a quantity is larger in the second model than in the first, and the estimated error."""
    first, second = models
    value = result[name].sel(model=second) - result[name].sel(model=first)
    return value, result[f"{name}_error"].sel(model=second) + result[f"{name}_error"].sel(model=first)


PAIR = {"article": ("--", PALETTE[5], "point dipoles"), "mutual": ("-", PALETTE[0], "finite magnets")}
"""Models that are compared in figures: line, colour, name."""


@styled
def distances_figure(result: xr.Dataset) -> Figure:
    """The levitation distance by point dipoles and in the field of the finite magnets."""
    figure, rows = configuration_panels(
        result, 3.0, "frequency of the rotor (Hz)", "levitation distance (mm)", sharey=True
    )
    for axes, configuration, part in rows:
        for value, color in rotor_colors(figure, axes, configuration, part["measure"]).items():
            one = case_with(part, measure=value)
            for model, (style, _, _) in PAIR.items():
                fill = color if model == "mutual" else "white"
                distance = 1e3 * one["distance"].sel(model=model)
                axes.plot(one["frequency"], distance, f"o{style}", ms=3, mfc=fill, color=color)
    explain(rows[0][0], {name: f"o{style}" for style, _, name in PAIR.values()}, ms=3)
    legend_below(figure, rows[0][0])
    return figure


@styled
def causes_figure(result: xr.Dataset) -> Figure:
    """By how much each cause changes the distance: mean and range over the frequencies."""
    figure, rows = configuration_panels(result, 2.8, ylabel="change of the distance (mm)", sharey=True)
    width = 0.8 / (len(CAUSES) + 1)
    for axes, configuration, part in rows:
        places = rotor_places(axes, configuration, part)
        for k, (cause, models) in enumerate([*CAUSES.items(), ("all together", TOTAL)]):
            value, error = (1e3 * values.values for values in change(part, "distance", models))
            mean = value.mean(axis=1)
            spread = np.array([mean - (value - error).min(axis=1), (value + error).max(axis=1) - mean])
            color = "0.3" if models == TOTAL else PALETTE[k]
            style: Any = {"color": color, "label": cause, "error_kw": {"lw": 0.7, "capsize": 1.5}}
            axes.bar(places + (k - len(CAUSES) / 2) * width, mean, width, yerr=spread, **style)
        axes.axhline(0.0, color="0.3", lw=0.8)
    explain(rows[0][0], {"bar: range over the frequencies": "|"})
    legend_below(figure, rows[0][0], columns=3)
    return figure


@styled
def ranges_figure(result: xr.Dataset) -> Figure:
    """The frequencies of stable levitation by point dipoles and in the field of the finite magnets."""
    figure, rows = configuration_panels(result, 2.8, ylabel="stable frequencies (Hz)", sharey=True)
    for axes, configuration, part in rows:
        for (model, (_, color, name)), offset in zip(PAIR.items(), (-0.2, 0.2), strict=True):
            places = rotor_places(axes, configuration, part) + offset
            low, high = (part[end].sel(model=model).values for end in ("lowest", "highest"))
            axes.bar(places, high - low, 0.35, bottom=low, color=color, label=name)
            for end, values in (("lowest", low), ("highest", high)):
                axes.errorbar(places, values, part[f"{end}_error"].sel(model=model), fmt="none", ecolor="0.1", lw=1)
            for kind, (marker, _) in ENDS.items():
                ends = part["high_kind"].sel(model=model).values == kind
                axes.plot(places[ends], high[ends], marker, color="k", ms=4)
        axes.use_sticky_edges = False
        axes.margins(y=0.08)
    explain(rows[0][0], {words: marker for marker, words in ENDS.values()}, color="k", ms=4)
    legend_below(figure, rows[0][0])
    return figure


FIGURES = {
    "dipole-vs-fem-distance": distances_figure,
    "dipole-vs-fem-causes": causes_figure,
    "dipole-vs-fem-ranges": ranges_figure,
}


def dipole_lines(result: xr.Dataset) -> list[str]:
    """Ranges of the changes for each configuration and cause, the limits of every rotor, and the sentence."""
    causes = [*CAUSES.items(), ("all together", TOTAL)]
    rows = [
        (f"{configuration}: {cause}", *_changes(part, models))
        for configuration, part in by_configuration(result)
        for cause, models in causes
    ]
    head = ("change by", "distance (mm)", "polar angle (°)", "lowest (Hz)", "highest (Hz)", "axial mode (%)")
    models = ("article", "cuboid", "fem", "mutual")
    limits = [
        (f"{rotor_label(name, float(one['measure']))}, {model}", *_limits(one.sel(model=model)))
        for name, part in by_configuration(result)
        for one in each_case(part)
        for model in models
    ]
    ends = text_table(("stable frequencies", "lowest (Hz)", "", "highest (Hz)", ""), limits)
    return [*text_table(head, rows), *ends, sentence(result)]


def _changes(part: xr.Dataset, models: tuple[str, str]) -> list[str]:
    """What lies between two models: range and largest error of distance, angle, ends of stability and axial mode."""
    scales = {"distance": 1e3, "polar_angle": 1.0, "lowest": 1.0, "highest": 1.0}
    cells = [range_text(*change(part, name, models), scale) for name, scale in scales.items()]
    relative, bounce = 100 / part["mode_frequency"].sel(model=models[0]), {"mode": "bounce"}
    value, error = ((each * relative).sel(bounce) for each in change(part, "mode_frequency", models))
    return [*cells, range_text(value, error)]


def _limits(one: xr.Dataset) -> list[str]:
    ends = (("lowest", "low_kind"), ("highest", "high_kind"))
    return [text for name, kind in ends for text in (uncertain(one[name], one[f"{name}_error"]), one[kind].item())]


def sentence(result: xr.Dataset) -> str:
    """The answer in one sentence, point dipoles less finite magnets: ranges over rotors and frequencies."""

    def wrong(name: str, scale: float = 1.0) -> str:
        value, error = change(result, name, TOTAL)
        return range_text(-value, error, scale)

    return (
        f"For the {result.sizes['case']} rotors that levitated, the dipole model errs by {wrong('distance', 1e3)} mm "
        f"in the levitation distance, {wrong('polar_angle')}° in the polar angle, and by {wrong('lowest')} Hz at the "
        f"lower and {wrong('highest')} Hz at the upper end of stable levitation."
    )


STUDY = Study(
    name="dipole-vs-fem",
    summary="what finite magnets change in distance, angle, modes, limits: shape, permeability, mutual magnetisation",
    points=points,
    compute=compute,
    figures=FIGURES,
    report=dipole_lines,
)
