"""The inverse question: which rotor holds the floater at a wanted distance and frequency, with the most to spare?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..dynamics import EquilibriumError, Family, Point, Rates, find_equilibria
from ..dynamics.balance import AXIAL, LATERAL, Balance, solve
from ..dynamics.branch import frequencies
from ..dynamics.equations import parameters
from ..dynamics.state import Scales
from ..fem.cache import cached_rotor_table
from ..fem.models import rotor_table
from ..geometry.box import Array
from ..geometry.magnet import MU_0
from ..geometry.scene import Scene
from . import study
from .console import note
from .results import variable
from .rotor_points import CONFIGURATIONS, FLOATER, REMANENCE, rotor_scene
from .stable_range import HIGHEST, LOWEST, UNIT, gap, is_stable, stability_end

EDGES = (6.0, 8.0, 10.0, 12.7, 16.0)
"""Edges of the cubes that are tried, mm."""
RTOL = 1e-4
CLOSE_ENOUGH = 1e-6
"""To which the true field shall meet the wanted distance, m."""


def points(quick: bool) -> list[study.Point]:
    """Wanted distances (mm) and frequencies (Hz) for each configuration."""
    wanted = [(20.0, 120.0)] if quick else [(d, f) for d in (20.0, 25.0, 30.0) for f in (80.0, 120.0)]
    edges = [10.0] if quick else list(EDGES)
    return [
        {"configuration": c, "distance_mm": d, "frequency": f, "edges_mm": edges}
        for d, f in wanted for c in CONFIGURATIONS
    ]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Design:
    """A rotor that holds the floater where it is wanted.

    Parameters
    ----------
    measure : displacement, mm, or tilt, °
    here : the equilibrium
    low, high : where its stability ends below and above the wanted frequency; `here` where it is not stable
    """

    measure: float
    here: Point
    low: Point
    high: Point

    @property
    def margin(self) -> float:
        """Smallest relative change of the frequency that ends stable levitation; zero where it is not stable."""
        frequency = self.here.parameter
        return min(frequency - self.low.parameter, self.high.parameter - frequency) / frequency


def first_guess(configuration: str, edge: float, distance: float, frequency: float) -> tuple[float, float, float]:
    """Displacement (mm) or tilt (°), side orbit's radius (m) and polar angle (rad) by the article's formulas.

    Balance of the axial force of point dipoles to first order in the polar angle, solved for the measure; gravity kept.
    """
    rate, moments = 2 * np.pi * frequency, FLOATER.moment * REMANENCE * edge**3 / MU_0
    strength = MU_0 * moments / (4 * np.pi)
    force = 3 * strength / distance**4
    angle = strength / (distance**3 * FLOATER.inertia * rate**2)
    radius = force / (FLOATER.mass * rate**2)
    pull = angle + 9.81 * FLOATER.mass / force
    if configuration == "horizontal":
        return 1e3 * (radius + distance * pull / 4), radius, angle
    if configuration == "tilt":
        return float(np.degrees((pull + 4 * radius / distance) / 2)), radius, angle
    ratio = max(2 / (pull + 4 * radius / distance), 1.0)
    return 1e3 * distance * (ratio**0.25 - 1), radius, angle


def designed(configuration: str, edge: float, distance: float, frequency: float) -> Design:
    """The measure that gives a distance (m) at a frequency (Hz) with cubes of an edge (m), by the closed form.

    Raises
    ------
    EquilibriumError : there is none, or the bodies would overlap
    """
    measure, radius, angle = first_guess(configuration, edge, distance, frequency)
    place, moment = np.array([radius, 0.0, -distance]), np.array([np.sin(angle), 0.0, np.cos(angle)])
    known: list[tuple[float, float]] = []
    for _ in range(30):
        scene = _checked(rotor_scene(configuration, measure, frequency, edge, permeability=1.0), configuration, measure)
        rates = Rates.of(scene, rotor_table(scene.rotor, "cuboid"))
        place, moment, force = _lateral(scene, rates, place * distance / np.linalg.norm(place), moment)
        if known and abs(measure - known[-1][0]) < 1e-9 * measure:
            return _judged(scene, rates, measure, place, moment)
        known.append((measure, force))
        measure = _secant(known)
    raise EquilibriumError("The search for the measure did not settle.")


def _secant(known: list[tuple[float, float]]) -> float:
    here, miss = known[-1]
    if len(known) == 1:
        return 1.01 * here
    before, missed = known[-2]
    step = -miss * (here - before) / (miss - missed)
    return here + float(np.clip(step, -0.2 * here, 0.2 * here))


def _checked(scene: Scene, configuration: str, measure: float) -> Scene:
    edge = 1e3 * float(scene.rotor[0].box.size[0])
    if not 0 < measure < (90 if configuration == "tilt" else 100) or (configuration == "vertical" and measure < edge):
        raise EquilibriumError(f"The rotor would need a measure of {measure:.3g}.")
    return scene


def _lateral(scene: Scene, rates: Rates, place: Array, moment: Array) -> tuple[Array, Array, float]:
    """Place (3,) m at the same height and moment (3,) where all but the axial force is balanced, and that force.

    There is no fold at a given height, so that this always leads on.
    """
    balance = Balance(rates, parameters(scene, Scales.of(scene), frozen_spin=True), 0.0)
    places, moments, step = solve(balance, place[None] / scene.floater.radius, moment[None], LATERAL)
    if not step[0] < 1e-8:
        raise EquilibriumError("There is no lateral balance at the wanted distance.")
    return places[0] * scene.floater.radius, moments[0], float(balance(places, moments)[0][0, AXIAL])


def _judged(scene: Scene, rates: Rates, measure: float, place: Array, moment: Array) -> Design:
    family = Family(rates, frequencies(scene), UNIT)
    here = family.point(place / scene.floater.radius, moment, scene.frequency)
    if gap(scene, here) < 0:
        raise EquilibriumError("The floater would overlap with the rotor.")
    if not is_stable(here):
        return Design(measure, here, here, here)
    low, high = (stability_end(scene, family, here.state, scene.frequency, end) for end in (LOWEST, HIGHEST))
    return Design(measure, here, low, high)


def checked_by_elements(configuration: str, edge: float, distance: float, frequency: float, first: float) -> Array:
    """Measure corrected for the true field, and what a forward search then gives.

    Returns
    -------
    Measure (mm or °), distance (m) and its error (m) of the equilibrium nearest to the wanted distance, 1 if it is
    stable, its growth (1/s).
    """
    measure, slope = first, None
    known: list[tuple[float, float]] = []
    for _ in range(5):
        scene = rotor_scene(configuration, measure, frequency, edge)
        table = cached_rotor_table(scene.rotor, "fem", RTOL, note, FLOATER.radius)[0]
        found = find_equilibria(scene, table)
        best = min(found, key=lambda e: abs(e.distance - distance), default=None)
        if best is None:
            raise EquilibriumError("The true field has no equilibrium there.")
        known.append((measure, best.distance - distance))
        if abs(known[-1][1]) < CLOSE_ENOUGH:
            break
        slope = _shifted(configuration, edge, distance, frequency, first) if slope is None else slope
        measure = measure - known[-1][1] / slope
    return np.array([measure, best.distance, best.position_error, float(best.stable), best.growth_per_s])


def _shifted(configuration: str, edge: float, distance: float, frequency: float, measure: float) -> float:
    """Change of the distance by the measure (m by mm or °), from the closed form."""
    step = 1e-5
    return step / (designed(configuration, edge, distance + step, frequency).measure - measure)


NAMES = {
    "measure": ("mm or °", "displacement or tilt"),
    "margin": ("1", "smallest relative change of frequency that ends stable levitation; 0 where unstable"),
    "lowest": ("Hz", "lower end of stability"),
    "highest": ("Hz", "upper end of stability"),
    "growth": ("1/s", "largest growth rate"),
    "polar_angle": ("°", "polar angle of the moment"),
}
CHECKED = {
    "true_measure": ("mm or °", "measure corrected for the true field"),
    "true_distance": ("m", "distance that a forward search in the true field gives"),
    "true_distance_error": ("m", "its estimated error"),
    "true_stable": ("1", "whether it is stable"),
    "true_growth": ("1/s", "largest growth rate in the true field"),
}


def compute(point: study.Point) -> xr.Dataset:
    """Measures and margins for each edge, and a forward check of the best of them by finite elements."""
    name, distance, frequency = point["configuration"], 1e-3 * point["distance_mm"], point["frequency"]
    rows = np.array([_row(name, 1e-3 * edge, distance, frequency) for edge in point["edges_mm"]])
    margin = rows[:, list(NAMES).index("margin")]
    best = int(np.nanargmax(margin)) if np.isfinite(margin).any() else -1
    true = np.full(len(CHECKED), np.nan)
    if best >= 0 and margin[best] > 0:
        true = checked_by_elements(name, 1e-3 * point["edges_mm"][best], distance, frequency, rows[best, 0])
    data = {k: variable(("case", "edge"), rows[None, :, i], *NAMES[k]) for i, k in enumerate(NAMES)}
    data |= {k: variable(("case",), true[None, i], *CHECKED[k]) for i, k in enumerate(CHECKED)}
    data["wanted_distance"] = variable(("case",), np.array([distance]), "m", "wanted distance")
    data["wanted_frequency"] = variable(("case",), np.array([frequency]), "Hz", "wanted frequency")
    data["best"] = variable(("case",), np.array([best]), "1", "which edge has the largest margin; -1 if none")
    data["configuration"] = xr.Variable(("case",), np.array([name]))
    return xr.Dataset(data, {"edge": variable(("edge",), 1e-3 * np.array(point["edges_mm"]), "m", "edge of the cubes")})


def _row(configuration: str, edge: float, distance: float, frequency: float) -> list[float]:
    try:
        found = designed(configuration, edge, distance, frequency)
    except EquilibriumError:
        return [np.nan] * len(NAMES)
    moment = found.here.state[6:9]
    angle = float(np.degrees(np.arctan2(np.hypot(moment[0], moment[1]), moment[2])))
    ends = found.low.parameter, found.high.parameter
    return [found.measure, found.margin, *ends, found.here.growth_per_s, angle]
