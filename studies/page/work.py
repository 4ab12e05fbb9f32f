"""Equilibria that follow a slider: carried from a scene in which all were searched for to one nearby.

A rotor of the article is a family with frequency and displacement or tilt left open, compiled once. Its size is left
open by similarity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import check_floater_metal
from ...dynamics.equilibria import Found, SearchRange, carried, field_doubts, told
from ...dynamics.maps import RotorFamily, article_measure, rotor_family
from ...dynamics.motion import Parameter, Rates, Scales, has_likes, like, parameters
from ...dynamics.steady import Balance, Survey
from ...fem.rotor_losses import check_slow_enough, pieces_of
from ...fem.rotor_tables import ROUND_OFF, RotorTable
from ...geometry.basics import Array, SpinlevError
from ..one_scene import Levitation
from .sliders import MEASURES, ROTOR_SIZES
from .state import QUICK, PageState


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

        Raises EquilibriumError for a rotor at rest, as a search does, and InputError where it turns too fast for metal.
        """
        if state.model != self.state.model or not state.scene.frequency or not self.state.scene.frequency:
            return None
        check_floater_metal(state.scene)  # equations are shared, their limits are not
        check_slow_enough(pieces_of(state.scene.rotor, state.scene.conductors), state.scene.frequency)
        levitation = _without_plate(state)
        levitation.share(self.levitation)
        problem, before = self._problem(levitation, state), self._problem(self.levitation, self.state)
        if problem is None or before is None or np.any(state.scene.gravity[:2]):
            return None
        known = self.searched().without_plate.equilibria
        size = self.state.scene.floater.radius
        position = np.reshape([e.position / size for e in known], (-1, 3))
        moment = np.reshape([e.state.moment for e in known], (-1, 3))
        points = carried(before.balance, problem.balance, position, moment)
        if points is None:
            return None
        points = points[SearchRange(state.scene, 0.1).holds(points[:, :3])]
        there, doubts = self._doubts(levitation, problem, points[:, :3] * state.scene.floater.radius)
        found = Found.at(problem.balance, points[there], doubts)
        levitation.adopt(told(state.scene, problem.balance, found), searched=False)
        return levitation

    def _doubts(self, levitation: Levitation, problem: _Problem, places: Array) -> tuple[NDArray[np.bool_], Array]:
        """Which places (n, 3) m the table knows, and its doubts there, see `field_doubts`, of the field as compiled."""
        family, measure = problem.family, float(problem.values[Parameter.MEASURE])
        if family is None:
            return field_doubts(levitation.table, places)
        alike = self.levitation.elsewhere(**vars(family.at(levitation.scene.frequency, measure)))
        table, places = alike.table, places * problem.likeness
        there = table.in_range(places)
        assert isinstance(table, RotorTable)  # QUICK ones are
        field, slope = family.field.evaluate(places[there], measure)
        sizes = np.linalg.norm(field, axis=1), np.linalg.norm(slope, axis=(1, 2))
        unsigned, left_out = table.without_left_out.absolute_error(places[there]), table.left_out(places[there])
        errors = np.column_stack(unsigned) + ROUND_OFF * np.column_stack(sizes)
        return there, np.concatenate([errors, left_out.reshape(len(left_out), -1)], axis=1)

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
    sizes: Array
    rest: str

    def problem(self, state: PageState) -> _Problem | None:
        rotor, scene = state.keys["rotor"], state.scene
        found = article_measure(rotor)
        if found is None or found[0] != self.configuration or _rest(state) != self.rest:
            return None
        ratios = self.sizes / _sizes(rotor)
        likeness = float(ratios[0])
        if likeness != 1 and not (np.allclose(ratios, likeness, rtol=ROUND_OFF, atol=0.0) and has_likes(scene)):
            return None
        measure = found[1] if self.configuration == "tilt" else likeness * found[1]
        family = replace(self.family, scene=like(scene, likeness))
        return _Problem(self.family.rates, family.values(scene.frequency, measure)[0], state.spin, likeness, family)


def _family(state: PageState) -> _Family | None:
    rotor = state.keys["rotor"]
    configuration = rotor.get("configuration")
    round_floater = state.scene.floater.body is None  # of another one, size and shape are compiled
    if configuration not in MEASURES or state.model not in QUICK or not round_floater:
        return None
    try:
        family = rotor_family(replace(state.scene, plate=None), configuration, state.model)
    except SpinlevError:  # conductors that do not move with the magnets
        return None
    return _Family(family, configuration, _sizes(rotor), _rest(state))


def _sizes(rotor: Mapping[str, Any]) -> Array:
    """What makes a body of the rotor as large as it is, mm."""
    return np.array([rotor[key] for key in ROTOR_SIZES if key in rotor])


def _rest(state: PageState) -> str:
    """What no parameter of a family's equations can change."""
    open_ones = (*ROTOR_SIZES, "displacement_mm", "angle_deg")
    rotor = {key: value for key, value in state.keys["rotor"].items() if key not in open_ones}
    return f"{rotor} {state.scene.floater.shape} {bool(state.scene.floater.conductivity)} {state.scene.drag.air}"


def _without_plate(state: PageState) -> Levitation:
    return Levitation(state.scene, replace(state.models, plate_model="none"), state.spin)
