"""Which parameter matters? Derivatives of distance and limits of stability, and what tolerances make of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from ..dynamics import EquilibriumError, Family, Rates, find_equilibria
from ..dynamics.branch import frequencies
from ..fem.models import rotor_table
from ..geometry.box import Array
from ..geometry.scene import Floater, Scene
from . import study
from .results import variable
from .rotor_points import levitated, rotor_scene
from .stable_range import HIGHEST, LOWEST, UNIT, StableRange, at_frequency, reference_state, stability_end, stable_range

MODEL = "cuboid"
FRACTIONS = (0.1, 0.5, 0.9)
"""Places in the range of stable frequencies at which the distance is asked for."""
STEP = 1e-3
"""Relative step of the central differences; twice that for their error."""
TILTS = (1.0, 2.0)
"""Of the axis from the vertical, degrees."""
SEED = 20250706


@dataclass(frozen=True)
class Known:
    """A parameter as it is known: its nominal value, unit, scale of the unit in SI and realistic tolerance.

    `spread` is half the width of an even distribution, or the standard deviation of a normal one.
    """

    nominal: float
    unit: str
    scale: float
    spread: float
    normal: bool = False


PARAMETERS = {
    "measure": Known(np.nan, "mm or °", 1.0, 0.1, True),
    "rotor_remanence": Known(1.305, "T", 1.0, 0.015),
    "floater_remanence": Known(1.305, "T", 1.0, 0.015),
    "density": Known(7500.0, "kg/m³", 1.0, 100.0),
    "edge": Known(10e-3, "mm", 1e-3, 0.1e-3),
    "diameter": Known(12.7e-3, "mm", 1e-3, 0.05e-3),
    "gravity": Known(9.81, "m/s²", 1.0, 0.0),
    "frequency": Known(np.nan, "Hz", 1.0, 0.5, True),
}
"""Remanence: the article's 1.29 to 1.32 T. Size: what makers of magnets give. Place of the cube: 0.1 mm, tilt 0.5°."""
TILT_SPREAD = 0.5
QUANTITIES = ("lowest", "highest", *(f"distance at {f:.0%}" for f in FRACTIONS))
PLACE = "frequency"


def points(quick: bool) -> list[study.Point]:
    """The rotors that levitated, how many samples of the tolerances are drawn, and steps of the differences.

    One step alone gives derivatives without an estimate of their error, which is then NaN.
    """
    return [{**point, "samples": 4 if quick else 50, "steps": [1] if quick else [1, 2]} for point in levitated(quick)]


@dataclass(frozen=True, eq=False)
class Nominal:
    """What one rotor does with all parameters as they should be.

    Parameters
    ----------
    configuration, measure : of the rotor
    values : of the parameters
    range : its stable frequencies
    """

    configuration: str
    measure: float
    values: dict[str, float]
    range: StableRange

    @property
    def grid(self) -> Array:
        """Frequencies at which the distance is asked for, Hz."""
        low, high = self.range.low.parameter, self.range.high.parameter
        return low + (high - low) * np.array(FRACTIONS)


def scene_of(configuration: str, values: dict[str, float], frequency: float = 100.0) -> Scene:
    """The scene with all parameters given."""
    floater = Floater(values["diameter"] / 2, values["floater_remanence"], 1.05, values["density"])
    scene = rotor_scene(
        configuration, values["measure"], frequency, values["edge"], values["rotor_remanence"], 1.0, floater
    )
    return replace(scene, gravity=np.array([0.0, 0.0, -values["gravity"]]))


def nominal(configuration: str, measure: float) -> Nominal:
    """The rotor as it should be. Raises EquilibriumError where it does not levitate."""
    values = {name: known.nominal for name, known in PARAMETERS.items() if name != PLACE} | {"measure": measure}
    scene = scene_of(configuration, values)
    found = stable_range(scene, Rates.of(scene, rotor_table(scene.rotor, MODEL)), *reference_state(scene))
    if found is None:
        raise EquilibriumError("There is no stable levitation on the branch of the point dipoles.")
    return Nominal(configuration, measure, values, found)


def levitation(base: Nominal, values: dict[str, float], shift: float = 0.0) -> Array:
    """Lowest and highest frequency (Hz) and the distances (m) with other values of the parameters; NaN where none.

    Parameters
    ----------
    shift : of the frequencies at which the distance is asked for, Hz
    """
    scene = scene_of(base.configuration, values)
    rates = Rates.of(scene, rotor_table(scene.rotor, MODEL))
    middle = base.range.near(base.grid[1])
    family = Family(rates, frequencies(scene), UNIT)
    row = np.full(len(QUANTITIES), np.nan)
    try:
        ends = [stability_end(scene, family, middle.state, middle.parameter, end) for end in (LOWEST, HIGHEST)]
    except EquilibriumError:
        return row
    row[:2] = [end.parameter for end in ends]
    for k, frequency in enumerate(base.grid + shift, 2):
        if row[0] < frequency < row[1]:
            row[k] = at_frequency(scene, rates, middle, float(frequency)).distance
    return row


def derivatives(base: Nominal, factors: Sequence[int] = (1, 2)) -> tuple[Array, Array]:
    """Derivatives (parameter, quantity) by each parameter in SI units (measure: mm or °), and their errors."""
    rows = []
    for name in PARAMETERS:
        size = float(base.grid[1]) if name == PLACE else base.values[name]
        slopes = [_slope(base, name, STEP * size * factor) for factor in factors]
        rows.append((slopes[0], np.abs(slopes[1] - slopes[0]) / 3 if len(slopes) > 1 else np.nan * slopes[0]))
    values, errors = np.array(rows).swapaxes(0, 1)
    return values, errors


def _slope(base: Nominal, name: str, step: float) -> Array:
    if name == PLACE:
        ends = [levitation(base, base.values, sign * step) for sign in (1, -1)]
    else:
        ends = [levitation(base, base.values | {name: base.values[name] + sign * step}) for sign in (1, -1)]
    return np.asarray((ends[0] - ends[1]) / (2 * step))


def drawn(base: Nominal, samples: int) -> tuple[Array, Array]:
    """What `samples` draws of the tolerances give (sample, quantity), and the draws (sample, parameter)."""
    generator = np.random.default_rng(SEED)
    draws = np.zeros((samples, len(PARAMETERS)))
    for k, (name, known) in enumerate(PARAMETERS.items()):
        unit = generator.normal(size=samples) if known.normal else generator.uniform(-1, 1, samples)
        tilted = name == "measure" and base.configuration == "tilt"
        draws[:, k] = (TILT_SPREAD if tilted else known.spread) * unit
    rows = []
    for draw in draws:
        off = dict(zip(PARAMETERS, draw, strict=True))
        rows.append(levitation(base, {k: v + off[k] for k, v in base.values.items()}, off[PLACE]))
    return np.array(rows), draws


def leaning(base: Nominal) -> tuple[Array, Array]:
    """Distance (m) and largest growth (1/s) in the middle of the range, upright and with the axis tilted by `TILTS`."""
    scene = scene_of(base.configuration, base.values, float(base.grid[1]))
    table = rotor_table(scene.rotor, MODEL)
    rates = Rates.of(scene, table)
    here = at_frequency(scene, rates, base.range.near(scene.frequency), scene.frequency)
    found = []
    for tilt in np.radians([0.0, *TILTS]):
        gravity = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
        near = [
            e for e in find_equilibria(replace(scene, gravity=gravity), table, rates=rates)
            if abs(e.distance - here.distance) < 1e-3
        ]  # fmt: skip
        found.append((near[0].distance, near[0].growth_per_s) if near else (np.nan, np.nan))
    distance, growth = np.array(found).T
    return distance, growth


def compute(point: study.Point) -> xr.Dataset:
    """Derivatives, tolerance band and tilt of one rotor."""
    base = nominal(point["configuration"], point["measure"])
    slopes, errors = derivatives(base, point["steps"])
    samples, draws = drawn(base, point["samples"])
    distance, growth = leaning(base)
    data = {
        "nominal": (("quantity",), levitation(base, base.values), "Hz or m", "as it should be"),
        "derivative": (("parameter", "quantity"), slopes, "of the quantity by SI, mm or °", "derivative"),
        "derivative_error": (("parameter", "quantity"), errors, "as the derivative", "estimated error"),
        "sample": (("draw", "quantity"), samples, "Hz or m", "with a draw of the tolerances"),
        "drawn": (("draw", "parameter"), draws, "SI, mm or °", "deviation of the parameter"),
        "frequency": (("fraction",), base.grid, "Hz", "frequency at which the distance is asked for"),
        "leaning_distance": (("lean",), distance, "m", "mean distance with the axis tilted from the vertical"),
        "leaning_growth": (("lean",), growth, "1/s", "largest growth rate with the axis tilted"),
        "measure": ((), base.measure, "mm or °", "displacement or tilt"),
    }
    found = {k: variable(("case", *dims), np.asarray(v)[None], u, w) for k, (dims, v, u, w) in data.items()}
    found["configuration"] = xr.Variable(("case",), np.array([base.configuration]))
    lean = variable(("lean",), np.array([0.0, *TILTS]), "°", "tilt of the axis from the vertical")
    axes = {"parameter": list(PARAMETERS), "quantity": list(QUANTITIES), "fraction": list(FRACTIONS), "lean": lean}
    return xr.Dataset(found, axes)
