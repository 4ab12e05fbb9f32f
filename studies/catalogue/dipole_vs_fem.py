"""How wrong is the dipole? Levitation of the article's rotors by point dipoles and by true fields, cause by cause."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from ...dynamics.branches import (
    BranchPoint,
    Family,
    StableRange,
    at_frequency,
    by_frequency,
    reference_state,
    stable_range,
)
from ...dynamics.motion import Rates
from ...dynamics.steady import named_modes
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..article import article_scene, levitated_rotors, levitation_of
from ..results import Point, Study, by_case, one_case, variable
from .dipole_vs_fem_figure import FIGURES
from .dipole_vs_fem_report import dipole_lines

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
