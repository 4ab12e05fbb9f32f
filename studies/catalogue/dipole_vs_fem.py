"""How wrong is the dipole? Levitation of the article's rotors by point dipoles and by true fields, cause by cause."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.branch import BranchPoint, Family
from ...dynamics.continuation.frequencies import StableRange, at_frequency, by_frequency, reference_state, stable_range
from ...dynamics.equilibria.modes import named_modes
from ...dynamics.motion.rates import Rates
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.style import PAGE, PALETTE, panels, styled
from ..result import variable
from ..study import Point, Study, by_case, one_case
from .article import TITLES, article_scene, by_configuration, levitated_rotors, levitation_of, rotor_label, rotor_panels

MODELS = ("article", "dipole", "cuboid", "fem", "mutual")
"""Point dipoles of the full remanence; the floater's moment lowered by its own permeability; the rotor's shape; its
permeability; both bodies magnetise each other."""
MODES = ("bounce", "side, backward", "side, forward", "precession", "nutation")
SIDES = ("low", "high")
RTOL, COARSE = 1e-5, 1e-4
"""Accuracy of the finite elements, and of those whose distance from them is the error estimate."""
ROUND_OFF = 1e-10
"""Relative error of what needs no finite elements."""


def points(quick: bool) -> list[Point]:
    """The rotors that levitated; quick: one frequency."""
    return [{**rotor, "steps": 1 if quick else 4, "rtols": [RTOL, COARSE]} for rotor in levitated_rotors(quick)]


@dataclass(frozen=True, eq=False)
class InOneField:
    """A scene in the field of one model, and the frequencies at which it levitates."""

    scene: Scene
    rates: Rates
    range: StableRange

    @property
    def family(self) -> Family:
        """Its equilibria against frequency."""
        return by_frequency(self.scene, self.rates)

    def at(self, frequency: float) -> BranchPoint:
        """The equilibrium at a frequency, Hz."""
        return at_frequency(self.scene, self.rates, self.range.near(frequency), frequency)


def compute(point: Point) -> xr.Dataset:
    """Distance, polar angle, modes and limits of stability of one rotor, by every model and with errors."""
    scene = article_scene(point["configuration"], point["measure"], drag=False)
    bare = replace(scene, floater=replace(scene.floater, recoil_permeability=1.0))
    start, (fine, coarse) = reference_state(scene), point["rtols"]
    dipole = levitation_of(scene, "dipole").rates
    made = {
        "article": _levitation(bare, dipole, start),
        "dipole": _levitation(scene, dipole, start),
        "cuboid": _levitation(scene, levitation_of(scene, "cuboid").rates, start),
        "fem": _levitation(scene, levitation_of(scene, "fem", fine).rates, start),
        "coarse": _levitation(scene, levitation_of(scene, "fem", coarse).rates, start),
    }
    together = levitation_of(scene, "fem", fine, "mutual")
    made["mutual"] = _levitation(scene, together.rates, start)
    low = max(each.range.low.parameter for each in made.values())
    high = min(each.range.high.parameter for each in made.values())
    grid = low + (high - low) * (np.arange(point["steps"]) + 0.5) / point["steps"]
    rows = {name: _described(each.at, each.range.low, each.range.high, grid) for name, each in made.items()}
    middle = made["mutual"].range.near(float(grid[len(grid) // 2]))
    answers = together.answers[0]
    doubt = max(float(part[0]) for part in answers.relative_error(middle.position)) if answers else 0.0
    errors = {name: {key: ROUND_OFF * np.abs(value) for key, value in rows[name].items()} for name in MODELS[:3]}
    errors["fem"] = {key: np.abs(value - rows["coarse"][key]) for key, value in rows["fem"].items()}
    errors["mutual"] = {
        key: doubt * np.abs(value - rows["fem"][key]) + errors["fem"][key] for key, value in rows["mutual"].items()
    }
    data = {"frequency": variable(("step",), grid, "Hz", "frequency of the rotor")}
    for name, (dims, units, words) in LABELS.items():
        for suffix, source, what in (("", rows, ""), ("_error", errors, "estimated error of the ")):
            values = np.array([source[model][name] for model in MODELS])
            data[name + suffix] = variable(("model", *dims), values, units, what + words)
    for side in SIDES:
        data[f"{side}_kind"] = xr.Variable(("model",), [getattr(made[m].range, side).kind for m in MODELS])
    return one_case(point, xr.Dataset(data, {"model": list(MODELS), "mode": list(MODES)}))


def _levitation(scene: Scene, rates: Rates, start: tuple[Array, float]) -> InOneField:
    return InOneField(scene, rates, stable_range(scene, rates, *start))


def _described(
    at: Callable[[float], BranchPoint], low: BranchPoint, high: BranchPoint, grid: Array
) -> dict[str, Array]:
    found = [at(float(frequency)) for frequency in grid]
    moment = np.array([point.state[6:9] for point in found])
    modes = [named_modes(point.motion, point.time_unit) for point in found]
    return {
        "distance": np.array([point.distance for point in found]),
        "polar_angle": np.degrees(np.arctan2(np.hypot(moment[:, 0], moment[:, 1]), moment[:, 2])),
        "mode_frequency": np.array([[mode.frequency_hz for mode in row] for row in modes]),
        "lowest": np.array(low.parameter),
        "highest": np.array(high.parameter),
    }


LABELS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "distance": (("step",), "m", "distance from the rotor"),
    "polar_angle": (("step",), "°", "polar angle of the moment"),
    "mode_frequency": (("step", "mode"), "Hz", "frequency of a small motion, rotor's frame"),
    "lowest": ((), "Hz", "lowest frequency of stable levitation"),
    "highest": ((), "Hz", "highest frequency of stable levitation"),
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


@styled
def distances_figure(result: xr.Dataset) -> Figure:
    """The levitation distance by point dipoles and by true fields."""
    figure, (axes,) = panels(1, 3, (PAGE, 2.8), sharey=True)
    for panel, (configuration, part) in zip(axes, by_configuration(result), strict=False):
        _distances(panel, part)
        panel.set(xlabel="frequency of the rotor (Hz)", title=TITLES[configuration])
    axes[0].set_ylabel("levitation distance (mm)")
    return figure


@styled
def causes_figure(result: xr.Dataset) -> Figure:
    """By how much each cause changes the distance: mean and range over the frequencies."""
    figure, axes = _one_panel_each(result, _causes)
    axes[0].set_ylabel("change of the distance (mm)")
    axes[2].legend(loc="lower right")
    return figure


@styled
def ranges_figure(result: xr.Dataset) -> Figure:
    """The frequencies of stable levitation by point dipoles and by true fields."""
    figure, axes = _one_panel_each(result, _ranges)
    axes[0].set_ylabel("frequencies of stable levitation (Hz)")
    axes[1].legend(loc="upper right")
    return figure


FIGURES = {
    "dipole-vs-fem-distance": distances_figure,
    "dipole-vs-fem-causes": causes_figure,
    "dipole-vs-fem-ranges": ranges_figure,
}


def _one_panel_each(result: xr.Dataset, draw: Callable[[Axes, xr.Dataset], None]) -> tuple[Figure, Any]:
    """A panel for each configuration, drawn by `draw`."""
    figure, axes = rotor_panels(result, 2.8, sharey=True)
    for panel, (_, part) in zip(axes, by_configuration(result), strict=False):
        draw(panel, part)
    return figure, axes


def _distances(axes: Axes, part: xr.Dataset) -> None:
    kind = str(part["configuration"].values[0])
    for k, color in zip(range(part.sizes["case"]), PALETTE, strict=False):
        one = part.isel(case=k)
        for model, style in (("article", "--"), ("mutual", "-")):
            frequency, distance = one["frequency"], 1e3 * one["distance"].sel(model=model)
            text = rotor_label(kind, float(one["measure"])) if model == "mutual" else None
            fill = color if text else "white"
            axes.plot(frequency, distance, f"o{style}", ms=2.5, mfc=fill, color=color, label=text)
    axes.plot([], [], "--", color="0.3", label="point dipoles")
    axes.plot([], [], "-", color="0.3", label="true fields")
    axes.legend()


def _causes(axes: Axes, part: xr.Dataset) -> None:
    width = 0.8 / (len(CAUSES) + 1)
    for k, (cause, models) in enumerate([*CAUSES.items(), ("all together", TOTAL)]):
        value, error = (1e3 * values.values for values in change(part, "distance", models))
        places = np.arange(len(value)) + (k - len(CAUSES) / 2) * width
        mean = value.mean(axis=1)
        spread = np.array([mean - (value - error).min(axis=1), (value + error).max(axis=1) - mean])
        color = "0.3" if models == TOTAL else PALETTE[k]
        axes.bar(places, mean, width, color=color, label=cause, yerr=spread, error_kw={"lw": 0.7, "capsize": 1.5})
    axes.axhline(0.0, color="0.3", lw=0.8)


def _ranges(axes: Axes, part: xr.Dataset) -> None:
    for model, offset, color, name in (
        ("article", -0.2, PALETTE[5], "point dipoles"),
        ("mutual", 0.2, PALETTE[0], "true fields"),
    ):
        low, high = (part[name].sel(model=model).values for name in ("lowest", "highest"))
        places = np.arange(len(low)) + offset
        axes.bar(places, high - low, 0.35, bottom=low, color=color, label=name)
        for end, values in (("lowest", low), ("highest", high)):
            error = part[f"{end}_error"].sel(model=model).values
            axes.errorbar(places, values, error, fmt="none", ecolor="0.1", lw=1)
        axes.use_sticky_edges = False
        for kind, (marker, words) in ENDS.items():
            ends = part["high_kind"].sel(model=model).values == kind
            axes.plot(places[ends], high[ends], marker, color="k", ms=4, label=words if model == "article" else None)
    axes.margins(y=0.08)


def dipole_lines(result: xr.Dataset) -> list[str]:
    """Ranges of the changes for each configuration and cause, the limits of every rotor, and the sentence."""
    lines = []
    for configuration, part in by_configuration(result):
        lines.append(f"{configuration}:")
        for cause, models in [*CAUSES.items(), ("all together", TOTAL)]:
            lines.append(f"  {cause}: " + "; ".join(_quantities(part, models)))
        lines += [f"  {_limits(part.isel(case=k))}" for k in range(part.sizes["case"])]
    return [*lines, sentence(result)]


def _quantities(part: xr.Dataset, models: tuple[str, str]) -> list[str]:
    names = {"distance": ("distance", 1e3, "mm"), "polar_angle": ("polar angle", 1.0, "°")}
    names |= {"lowest": ("lowest", 1.0, "Hz"), "highest": ("highest", 1.0, "Hz")}
    words = [
        f"{word} {range_text(*change(part, name, models), scale)} {unit}" for name, (word, scale, unit) in names.items()
    ]
    value, error = change(part, "mode_frequency", models)
    relative = 100 / part["mode_frequency"].sel(model=models[0])
    bounce = {"mode": "bounce"}
    words.append(f"bounce {range_text((value * relative).sel(bounce), (error * relative).sel(bounce))} %")
    return words


def range_text(value: xr.DataArray, error: xr.DataArray, scale: float = 1.0) -> str:
    """A range of values and the largest error."""
    known: Array = scale * value.values[np.isfinite(value.values)]
    if not known.size:
        return "unknown"
    worst = scale * float(np.nanmax(error.values))
    digits = int(np.clip(1 - np.floor(np.log10(max(worst, 1e-6))), 1, 4))
    return f"{known.min():+.{digits}f} to {known.max():+.{digits}f} (± {worst:.1g})"


def _limits(one: xr.Dataset) -> str:
    kind = str(one["configuration"].values)
    words = []
    for model in ("article", "cuboid", "fem", "mutual"):
        ends = [f"{float(one[n].sel(model=model)):.2f} ± {float(one[f'{n}_error'].sel(model=model)):.1g} ({k})"
                for n, k in (("lowest", one["low_kind"].sel(model=model).item()),
                             ("highest", one["high_kind"].sel(model=model).item()))]  # fmt: skip
        words.append(f"{model} {ends[0]} to {ends[1]} Hz")
    return f"{rotor_label(kind, float(one['measure']))}: " + "; ".join(words)


def sentence(result: xr.Dataset) -> str:
    """The answer in one sentence, dipole less truth: ranges over rotors and frequencies, with the largest errors."""

    def wrong(name: str, models: tuple[str, str], scale: float = 1.0) -> str:
        value, error = change(result, name, models)
        return range_text(-value, error, scale)

    causes = ", ".join(f"{cause} {wrong('distance', models, 1e3)} mm" for cause, models in CAUSES.items())
    return (
        f"The dipole is wrong by {wrong('distance', TOTAL, 1e3)} mm in the levitation distance, because it leaves out: "
        f"{causes}; by {wrong('polar_angle', TOTAL)}° in the polar angle, and by {wrong('lowest', TOTAL)} Hz at the "
        f"lower and {wrong('highest', TOTAL)} Hz at the upper end of stable levitation."
    )


STUDY = Study(
    name="dipole-vs-fem",
    summary="what true fields change in distance, angle, modes and limits, split"
    " into shape, permeability, mutual answers",
    points=points,
    compute=compute,
    gather=by_case,
    figures=FIGURES,
    report=dipole_lines,
)
