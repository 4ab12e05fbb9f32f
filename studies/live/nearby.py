"""Equilibria that follow a slider: carried from a scene in which all were searched for to one nearby.

A rotor of the article is a family with frequency and displacement or tilt left open, compiled once. Its edge is left
open by similarity: lengths times s, the floater's density over s², gravity times s and the drags times s and s³ leave
B, all times and all scaled motions as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...dynamics.equilibria import SearchRange, field_doubts, told
from ...dynamics.maps import RotorFamily, rotor_family
from ...dynamics.motion import Parameter, Rates, Scales, parameters
from ...dynamics.steady import EVERY, Balance, Survey, solve
from ...fem.rotor_tables import ROUND_OFF, RotorTable
from ...geometry.basics import Array, SpinlevError
from ...geometry.scenes import Drag, Scene
from ..one_scene import Levitation
from .sliders import MEASURES
from .state import QUICK, PageState

JUMP = 0.3
"""An equilibrium that moves farther in one step (radii and rad together) may be another one."""
PARTS = (1, 4, 16)
"""Steps in which the way to a scene is tried."""
APART = 1e-6
"""Equilibria nearer than this are one."""


class Nearby:
    """What is known around a scene: its equilibria, and compiled equations that hold for its neighbours.

    Parameters
    ----------
    state : of the page; its plate's currents are left out
    """

    def __init__(self, state: PageState) -> None:
        self.state = state
        self.levitation = _without_plate(state)
        self._family = _family(state)
        self._known: Survey | None = None

    def searched(self) -> Levitation:
        """The scene with all its equilibria, searched for once."""
        if self._known is not None:
            self.levitation.adopt(self._known)
        self._known = self.levitation.without_plate
        return self.levitation

    def learn(self, known: Survey) -> None:
        """Equilibria of the scene that were searched for elsewhere."""
        self._known = known

    def at(self, state: PageState) -> Levitation | None:
        """The scene of another state with equilibria carried to it, or None where they cannot be.

        Raises EquilibriumError for a rotor at rest, as a search does.
        """
        if state.model != self.state.model or not state.scene.frequency or not self.state.scene.frequency:
            return None
        levitation = _without_plate(state)
        levitation.share(self.levitation)
        problem, before = self._problem(levitation, state), self._problem(self.levitation, self.state)
        if problem is None or before is None or np.any(state.scene.gravity[:2]):
            return None
        known = self.searched().without_plate.equilibria
        size = self.state.scene.floater.radius
        position = np.reshape([e.position / size for e in known], (-1, 3))
        moment = np.reshape([e.state.moment for e in known], (-1, 3))
        points = _carried(before, problem, position, moment)
        if points is None:
            return None
        points = points[SearchRange(state.scene, 0.1).holds(points[:, :3])]
        there, doubts = self._doubts(levitation, problem, points[:, :3] * state.scene.floater.radius)
        levitation.adopt(told(state.scene, problem.balance, points[there], doubts), searched=False)
        return levitation

    def _doubts(self, levitation: Levitation, problem: _Problem, places: Array) -> tuple[NDArray[np.bool_], Array]:
        """Which places (n, 3) m the table knows, and errors (k, 2) there of B and of its gradient as compiled."""
        family, measure = problem.family, float(problem.values[Parameter.MEASURE])
        if family is None:
            return field_doubts(levitation.table, places)
        like = self.levitation.elsewhere(**vars(family.at(levitation.scene.frequency, measure)))
        table, places = like.table, places * problem.likeness
        there = table.in_range(places)
        assert isinstance(table, RotorTable)  # QUICK ones are
        field, slope = family.field.evaluate(places[there], measure)
        sizes = np.linalg.norm(field, axis=1), np.linalg.norm(slope, axis=(1, 2))
        return there, np.stack(table.absolute_error(places[there]), axis=1) + ROUND_OFF * np.stack(sizes, axis=1)

    def _problem(self, levitation: Levitation, state: PageState) -> _Problem | None:
        """The balance of a scene in the equations that are compiled here; None where it needs others."""
        scene, spin = levitation.scene, levitation.spin
        if self._family is None:
            if levitation.equations_key != self.levitation.equations_key:
                return None
            values = parameters(scene, Scales.of(scene), frozen_spin=True)
            return _Problem(self.levitation.rates, values, spin, 1.0)
        return self._family.problem(state)


@dataclass(frozen=True, eq=False)
class _Problem:
    """Rates, their parameters, the body spin, how many times larger their scene is than the true one, its family."""

    rates: Rates
    values: Array
    spin: float
    likeness: float
    family: RotorFamily | None = None

    @property
    def balance(self) -> Balance:
        return Balance(self.rates, self.values, self.spin)


@dataclass(frozen=True, eq=False)
class _Family:
    """A family of rotors, and of what else is the same in all scenes for which its equations hold."""

    family: RotorFamily
    configuration: str
    edge: float
    rest: str

    def problem(self, state: PageState) -> _Problem | None:
        rotor, scene = state.keys["rotor"], state.scene
        if rotor.get("configuration") != self.configuration or _rest(state) != self.rest:
            return None
        likeness = self.edge / rotor["edge_mm"]
        if likeness != 1 and not _scalable(scene):
            return None
        key = MEASURES[self.configuration][0].partition(".")[2]
        measure = np.radians(rotor[key]) if key == "angle_deg" else 1e-3 * likeness * rotor[key]
        like = replace(self.family, scene=_similar(scene, likeness))
        return _Problem(self.family.rates, like.values(scene.frequency, measure)[0], state.spin, likeness, like)


def _family(state: PageState) -> _Family | None:
    rotor = state.keys["rotor"]
    configuration = rotor.get("configuration")
    if configuration not in MEASURES or state.model not in QUICK:
        return None
    try:
        family = rotor_family(replace(state.scene, plate=None), configuration, state.model)
    except SpinlevError:  # conductors that do not move with the magnets
        return None
    return _Family(family, configuration, rotor["edge_mm"], _rest(state))


def _rest(state: PageState) -> str:
    """What no parameter of a family's equations can change."""
    open_ones = ("edge_mm", "displacement_mm", "angle_deg")
    rotor = {key: value for key, value in state.keys["rotor"].items() if key not in open_ones}
    return f"{rotor} {bool(state.scene.floater.conductivity)} {state.scene.drag.air}"


def _scalable(scene: Scene) -> bool:
    """Whether a scene has a similar one of another size with the same rotor's material and air."""
    return not scene.drag.air and not any(magnet.conductivity for magnet in scene.rotor)


def _similar(scene: Scene, times: float) -> Scene:
    """The scene, all but its rotor, so many times as large, with the same motion."""
    floater, drag = scene.floater, scene.drag
    conductivity = None if floater.conductivity is None else floater.conductivity / times**2
    density = floater.density / times**2
    larger = replace(floater, radius=floater.radius * times, density=density, conductivity=conductivity)
    air = Drag(drag.linear * times, drag.angular * times**3, drag.air)
    return replace(scene, floater=larger, drag=air, gravity=scene.gravity * times, plate=None)


def _carried(start: _Problem, end: _Problem, position: Array, moment: Array) -> Array | None:
    """Scaled positions and moments (n, 6) at the end of the way; None where they cannot be followed."""
    if not len(position):
        return np.zeros((0, 6))
    for parts in PARTS:
        places, turned, good = position, moment, True
        for way in np.arange(1, parts + 1) / parts:
            values = start.values + way * (end.values - start.values)
            balance = Balance(end.rates, values, start.spin + way * (end.spin - start.spin))
            arrived, direction, size = solve(balance, places, turned, EVERY, 12)
            step = np.linalg.norm(np.concatenate([arrived - places, direction - turned], axis=1), axis=1)
            good = bool((size < 1e-8).all() and (step < JUMP).all())
            if not good:
                break
            places, turned = arrived, direction
        points = np.concatenate([places, turned], axis=1)
        if good and _all_apart(points):
            return points
    return None


def _all_apart(points: Array) -> bool:
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points))
    return bool((apart > APART).all())


def _without_plate(state: PageState) -> Levitation:
    return Levitation(state.scene, replace(state.models, plate_model="none"), state.spin)
