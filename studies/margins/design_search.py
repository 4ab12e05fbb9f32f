"""The search for the displacement or tilt that holds the floater at a wanted distance and frequency."""

from dataclasses import dataclass

import numpy as np

from ...dynamics.branches import HIGHEST, LOWEST, BranchPoint, by_frequency, levitates, stability_end
from ...dynamics.motion import Rates, Scales, parameters, rotor_gap
from ...dynamics.steady import AXIAL, LATERAL, Balance, EquilibriumError, solve
from ...geometry.basics import MU_0, Array
from ...geometry.scenes import Scene
from ..article import FLOATER, REMANENCE, article_scene, levitation_of


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
    here: BranchPoint
    low: BranchPoint
    high: BranchPoint

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
        least = 1e3 * edge if configuration == "vertical" else 0.0
        if not least <= measure < (90 if configuration == "tilt" else 100) or measure == 0:
            raise EquilibriumError(f"The rotor would need a measure of {measure:.3g}.")
        scene = article_scene(configuration, measure, frequency, drag=False, edge=edge, permeability=1.0)
        rates = levitation_of(scene, "cuboid").rates
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
    family = by_frequency(scene, rates)
    here = family.point(place / scene.floater.radius, moment, scene.frequency)
    if rotor_gap(scene, here.position) < 0:
        raise EquilibriumError("The floater would overlap with the rotor.")
    if not levitates(here):
        return Design(measure, here, here, here)
    low, high = (stability_end(scene, family, here.state, scene.frequency, end) for end in (LOWEST, HIGHEST))
    return Design(measure, here, low, high)
