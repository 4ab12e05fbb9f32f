"""Which parameter matters? Derivatives of distance and limits of stability, and what tolerances make of them."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from scipy.special import ndtri

from ...dynamics.branches import at_frequency
from ...geometry.basics import Array
from ..article import levitated_rotors, levitation_of
from ..results import Point, Study, by_case, one_case, variable
from .sensitivity_figure import FIGURES, sensitivity_lines
from .tolerances import (
    FRACTIONS,
    MODEL,
    PARAMETERS,
    PLACE,
    QUANTITIES,
    TILT_SPREAD,
    TILTS,
    Nominal,
    levitation,
    nominal,
    scene_of,
)

STEP = 1e-3
"""Relative step of the central differences; twice that for their error."""
SEED = 20250706


def points(quick: bool) -> list[Point]:
    """The rotors that levitated, how many samples of the tolerances are drawn, and steps of the differences.

    One step alone gives derivatives without an estimate of their error, which is then NaN.
    """
    more = {"field": MODEL, "samples": 4 if quick else 32, "steps": [1] if quick else [1, 2]}
    return [{**rotor, **more} for rotor in levitated_rotors(quick)]


def derivatives(base: Nominal, factors: Sequence[int] = (1, 2)) -> tuple[Array, Array]:
    """Derivatives (parameter, quantity) by each parameter in SI units (measure: mm or °), and their errors."""
    rows = []
    for name in PARAMETERS:
        size = float(base.grid[1]) if name == PLACE else base.values[name]
        slopes = [slope_by(base, name, STEP * size * factor) for factor in factors]
        rows.append((slopes[0], np.abs(slopes[1] - slopes[0]) / 3 if len(slopes) > 1 else np.nan * slopes[0]))
    values, errors = np.array(rows).swapaxes(0, 1)
    return values, errors


def slope_by(base: Nominal, name: str, step: float) -> Array:
    """Derivatives (quantity,) by one parameter, as a central difference of `step` (SI; measure: mm or °)."""
    if name == PLACE:
        ends = [levitation(base, base.values, sign * step) for sign in (1, -1)]
    else:
        ends = [levitation(base, base.values | {name: base.values[name] + sign * step}) for sign in (1, -1)]
    return np.asarray((ends[0] - ends[1]) / (2 * step))


def drawn(base: Nominal, samples: int) -> tuple[Array, Array]:
    """What `samples` draws of the tolerances give (sample, quantity), and the draws (sample, parameter).

    A Latin hypercube: each parameter's draws are spread evenly (McKay, Beckman, Conover, Technometrics 21 (1979) 239).
    """
    generator = np.random.default_rng(SEED)
    ranks = generator.permuted(np.tile(np.arange(samples)[:, None], len(PARAMETERS)), axis=0)
    levels = (ranks + generator.random(ranks.shape)) / samples
    draws = np.zeros((samples, len(PARAMETERS)))
    for k, (name, known) in enumerate(PARAMETERS.items()):
        unit = ndtri(levels[:, k]) if known.normal else 2 * levels[:, k] - 1
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
    levitation = levitation_of(scene, base.model)
    here = at_frequency(scene, levitation.rates, base.range.near(scene.frequency), scene.frequency)
    found = []
    for tilt in np.radians([0.0, *TILTS]):
        gravity = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
        near = [
            e for e in levitation.elsewhere(gravity=gravity).equilibria
            if abs(e.distance - here.distance) < 1e-3
        ]  # fmt: skip
        found.append((near[0].distance, near[0].growth_per_s) if near else (np.nan, np.nan))
    distance, growth = np.array(found).T
    return distance, growth


def compute(point: Point) -> xr.Dataset:
    """Derivatives, tolerance band and tilt of one rotor."""
    base = nominal(point["configuration"], point["measure"], point["field"])
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
    }
    lean = variable(("lean",), np.array([0.0, *TILTS]), "°", "tilt of the axis from the vertical")
    axes = {"parameter": list(PARAMETERS), "quantity": list(QUANTITIES), "fraction": list(FRACTIONS), "lean": lean}
    return one_case(point, xr.Dataset({name: variable(*column) for name, column in data.items()}, axes))


STUDY = Study(
    name="sensitivity",
    summary="which parameter matters: derivatives of distance and limits, and bands of realistic tolerances",
    points=points,
    compute=compute,
    gather=by_case,
    figures=FIGURES,
    report=sensitivity_lines,
)
