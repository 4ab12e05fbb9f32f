"""Balls about a floater's place in which the rotor's field is a short sum of harmonics: 3.5 times faster trajectories.

A table by finite elements is written with 1e7 characters of expressions, a ball of degree 7 with 2e5.  A ball is a set
of runtime parameters, so that the code is compiled once, and depends on its cell of a lattice alone: a trajectory
can be repeated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import heyoka as hy
import numpy as np

from ...fem.harmonics.interior import Ball, BallField
from ...fem.rotor.table import FieldTable, RangeError
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..motion.coils import BesideCoils
from ..motion.effect import SMALLEST, Effect, Fittable, Interaction, interaction_of
from ..motion.events import clearance, rotor_gap
from ..motion.state import Parameter, turned_about_z

DEGREE = len(Parameter)  # Number of the runtime parameter that is the `number` of the ball's kind; 0: in no ball
# The second kind, twice as wide and half again as slow, is for a floater that has left a small ball.
SMALL, LARGE = BallField(DEGREE + 1, 7), BallField(DEGREE + 1, 9)
FIRST = DEGREE + 1 + LARGE.count  # Number of the first runtime parameter of the effects in a ball
# Length of a field's expressions, written out, from which on balls are faster. A dipole has 6e3, a cuboid's closed form
# 2e4, two of them 4e4, moments up to degree 9 4e6 (as fast as a ball), a cube's table by finite elements 9e6 from 3 mm
# off contact on and 1e8 from contact on.
WORTH = 5e6
# Of a ball's field and its gradient, relative; the gradient of a table by finite elements is known to 4e-5.
ERROR = 1e-6
# Kinds of balls and their errors for a body that is not round, whose multipoles are left out up to some 5e-3 of the
# force. The first two are about an equilibrium: there a ball is so much smaller than its distance from the magnets that
# the field's error is 2e-5 where the floater is, and its multipoles' 1e-4. In the plane in which the rotor is its own
# mirror image half of what a ball's sums add up is zero. A cube asks for 636, 831, 1398 and 2358 operations.
OF_BODIES = BallField(DEGREE + 1, SMALLEST, True), *(BallField(DEGREE + 1, degree) for degree in (SMALLEST, 6, 8))
ERROR_OF_BODIES = {SMALLEST: 1.5e-3, 6: 1e-5, 8: 1e-5}
SPACING = 1 / 32  # Of the lattice, in radii of the floater
FINE = 1 / 128  # Of that about an equilibrium, where a place in the middle counts: what multipoles miss is its cube
LEAST = 1.5  # Smallest radius of a ball in spacings: a floater that enters it is at most 0.87 of them from the centre
TRIALS = 5
WIDEST = 1 / 4  # No ball is larger, of the distance from a body: at degree 9 it would err by 1e-5 at least
FITTED = 1 / 10  # Of that distance: about the radius up to which effects in a ball err as much as is allowed
ANGLES, DEPTHS = 72, 400
MOST = 4096  # Balls that are remembered, 2.6 kB each
# A ball is worth its making if the floater needs so many radians of the rotor's turn for its radius, up or down.
STAY = 4.0
SNUG = 0.97  # Largest part of a ball's radius to which the circle may reach on which the rotor sees the floater
# A ball ahead is worth its making (1 to 4 ms) if the floater stays for so many radians of the rotor's turn: with mutual
# magnetisation twenty of them cost what a turn in the table's own field does, and most of them are met again.
PART = 0.3
# Largest spacing of their lattice in tenths of the distance from a body: the coarser, the fewer balls there are (half
# of those at 0.4), but above 0.8 a floater would often be near the surface of the nearest one.
COARSE = 0.78
NEIGHBOURS = np.indices((3, 3, 3)).reshape(3, -1).T - 1.0  # (27, 3) of a cell, and itself


def is_long(table: FieldTable) -> bool:
    """Whether a field's or an effect's expressions are longer than those of a ball."""
    whole = interaction_of(table)
    if isinstance(whole.field, BesideCoils) or any(isinstance(effect, Fittable) for effect in whole.effects):
        return True
    field, gradient = table.expressions(hy.make_vars("x", "y", "z"))
    return sum(len(e) for e in [*field, *(e for row in gradient for e in row)]) > WORTH


def in_ball(whole: Interaction, formula: BallField) -> Interaction:
    """A field and its effects as they are in a ball."""
    effects: list[Effect] = []
    first = FIRST
    for effect in whole.effects:
        if isinstance(effect, Fittable):
            effects.append(local := effect.in_ball(formula, first))
            first += local.count
        else:
            effects.append(effect)
    return replace(whole, field=formula, effects=tuple(effects))


@dataclass(frozen=True, eq=False)
class Balls:
    """The balls of a scene."""

    scene: Scene  # whose bodies the floater must not touch while it is in a ball
    whole: Interaction  # the rotor's table with its effects
    largest: bool = False  # whether there is no kind but the largest
    _known: dict[tuple[float, ...], tuple[Array, float] | None] = field(default_factory=dict)

    @property
    def kinds(self) -> tuple[BallField, ...]:
        """From the smallest to the largest."""
        return (OF_BODIES if self.whole.turning else (SMALL, LARGE))[-1 if self.largest else 0 :]

    @property
    def usual(self) -> tuple[BallField, ...]:
        """Those for a floater of which it is not known that it moves about an equilibrium."""
        return tuple(kind for kind in self.kinds if kind.degree > SMALLEST)

    def after(self, number: int) -> tuple[BallField, ...]:
        """The larger kinds than that of a number, and at least the largest; 0: in none."""
        return tuple(kind for kind in self.kinds if kind.degree > abs(number) > 0) or self.kinds[-1:]

    def allowed(self, formula: BallField) -> float:
        return ERROR_OF_BODIES[formula.degree] if self.whole.turning else ERROR

    @cached_property
    def end(self) -> int:
        """Number of the first runtime parameter that is not a ball's."""
        return FIRST + sum(effect.count for effect in _fitted(self.whole, LARGE))

    def enter(
        self, formulas: Sequence[BallField], state: Array, values: Array, time: float = 0.0, offset: Array | None = None
    ) -> float:
        """Set the runtime parameters `values` to the first ball of `formulas` that will do for a scaled state; error.

        It must hold the circle on which the rotor sees a floater that turns less than the rotor, or not at all: once a
        turn, backwards, at the rate of a scaled `time`.  Where no ball does, those of the last of `formulas` hold a
        part of the way each.  `offset` (3,) m is how far the state is from what the floater moves about.
        """
        length, (x, y, _) = values[Parameter.LENGTH], state[:3]
        rate = values[Parameter.RATE] + values[Parameter.ACCELERATION] * time
        lost = float(values[Parameter.LOST_DISTANCE]) * length
        drift = state[3:6] - rate * np.array([-y, x, 0.0])
        arm = rate * np.array([-drift[1], drift[0], 0.0])
        offset = np.zeros(3) if offset is None else offset
        middle = (state[:3] - arm) * length - offset
        way = float(abs(drift[2]) if rate else np.linalg.norm(drift)) * length
        values[DEGREE : self.end] = 0.0
        held = float(np.linalg.norm(arm)) * length <= WIDEST * self._distance(middle)  # else none is fitted in vain
        for formula in formulas:
            found = self.at(formula, self._spacing(formula), lost, middle) if held else None
            if found is None:
                continue
            numbers, error = found
            reach = float(np.linalg.norm(arm)) * length + float(np.linalg.norm(offset))
            reach += float(np.linalg.norm(middle - numbers[:3]))
            if reach * numbers[3] <= SNUG and STAY * way * numbers[3] <= 1:
                break
        else:
            found = self._ahead(formulas[-1], lost, state[:3] * length, drift * length, arm * length)
            if found is None:
                return 0.0
            formula, (numbers, error) = formulas[-1], found
        values[DEGREE], values[DEGREE + 1 : DEGREE + 1 + len(numbers)] = formula.number, numbers
        return error

    def centre(self, values: Array, ways: Array) -> float | None:
        """Put `values` into a ball of their kind about the middle of `ways` (n, 3) m: its error; None without one."""
        formula = next(kind for kind in self.kinds if kind.number == values[DEGREE])
        lost, middle = float(values[Parameter.LOST_DISTANCE] * values[Parameter.LENGTH]), ways.mean(axis=0)
        found = self.at(formula, self._spacing(formula), lost, middle)
        if found is None or np.linalg.norm(ways - found[0][:3], axis=1).max() * found[0][3] > SNUG:
            return None
        values[DEGREE + 1 : DEGREE + 1 + len(found[0])] = found[0]
        return found[1]

    def _spacing(self, formula: BallField) -> float:
        fine = self.whole.turning and formula.degree == SMALLEST
        return (FINE if fine else SPACING) * self.scene.floater.radius

    def _ahead(
        self, formula: BallField, lost: float, place: Array, drift: Array, arm: Array
    ) -> tuple[Array, float] | None:
        """The ball of a coarse lattice in which a floater at a `place` (3,) m stays longest; None where that is short.

        Its velocity is `drift` (3,) as seen from the rotor, m in a unit of time, which turns it about `place` - `arm`;
        `arm` is zero where it goes straight on.
        """
        speed = float(np.linalg.norm(drift))
        near = min(_room(self.scene, place, lost), FITTED * self._distance(place))
        if near <= 0 or not speed:
            return None
        spacing = float(2 ** (np.floor(2 * np.log2(COARSE * near)) / 2))  # of few sizes, so that cells are met again
        here = self.at(formula, spacing, lost, place)
        if here is None:
            return None
        radius = 1 / here[0][3]  # those around are about as large
        times, level = np.linspace(0.0, 2.2 * radius / speed, 25)[:, None], drift * [1.0, 1.0, 0.0]
        bent = np.sin(times) if arm.any() else times
        way = place + (drift - level) * times + bent * level - (1 - np.cos(times)) * arm
        cells = spacing * (np.round(way[9] / spacing) + NEIGHBOURS)
        gone = np.linalg.norm(way - cells[:, None], axis=2) > SNUG * radius
        gone[:, -1] = True
        left = np.argmax(gone, axis=1)
        best = int(np.argmax(left))
        if float(times[left[best], 0]) < PART:
            return None
        for ball in (self.at(formula, spacing, lost, cells[best]), here):
            if ball is not None and np.linalg.norm(place - ball[0][:3]) * ball[0][3] <= SNUG:
                return ball
        return None

    def at(self, formula: BallField, spacing: float, lost: float, place: Array) -> tuple[Array, float] | None:
        """Parameters and error of a `formula`'s ball for `place` (3,) m; None near a body or loss.

        It is about the nearest point of a lattice of a `spacing` (m); at a distance `lost` (m) the floater is lost.
        """
        cell = np.round(place / spacing)
        key = formula.number, spacing, lost, *cell.tolist()
        if key not in self._known:
            if len(self._known) >= MOST:
                self._known.clear()
            self._known[key] = self._largest(formula, lost, cell * spacing)
        return self._known[key]

    def _distance(self, place: Array) -> float:
        return rotor_gap(self.scene, place) + self.scene.floater.radius

    def _largest(self, formula: BallField, lost: float, center: Array) -> tuple[Array, float] | None:
        """The largest ball about `center` whose expansion has at most the error allowed."""
        room, least = _room(self.scene, center, lost), LEAST * SPACING * self.scene.floater.radius
        # first so large that the terms left out, (radius / distance)^(degree - 1) nearly, are about the error allowed
        allowed = self.allowed(formula)
        part = (allowed / 4) ** (1 / (formula.degree - 1))
        radius = min(room, self._distance(center) * (min(part, FITTED) if _fitted(self.whole, formula) else part))
        error = np.inf
        for _ in range(TRIALS):
            if radius < least:
                return None
            try:
                values, error = self._fit(formula, Ball(center, radius))
            except RangeError:
                radius = room = radius / 2
                continue
            if error <= allowed and (error > allowed / 4 or radius >= room):
                break
            radius = min(radius * min(0.9 * (allowed / max(error, 1e-15)) ** (1 / (formula.degree - 1)), 2.0), room)
        return (values, error) if error <= allowed else None

    def _fit(self, formula: BallField, ball: Ball) -> tuple[Array, float]:
        values, error = formula.fit(self.whole.evaluate, ball)
        effects = _fitted(self.whole, formula)
        if not effects:
            return values, error
        constants = 4 + 3 * formula.degree**2 + (formula.degree - 1) ** 2 * np.arange(5)  # those of the gradient
        xx, xy, xz, yy, yz = values[constants]
        gradient = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]])
        found = [effect.fit(ball, gradient) for effect in effects]
        padded = np.concatenate([values, np.zeros(FIRST - DEGREE - 1 - len(values))])
        return np.concatenate([padded, *(numbers for numbers, _ in found)]), max(
            error, *(self.allowed(formula) * share for _, share in found)
        )


def _fitted(whole: Interaction, formula: BallField) -> list[Fittable]:
    return [effect for effect in in_ball(whole, formula).effects if isinstance(effect, Fittable)]


def _room(scene: Scene, center: Array, reach: float) -> float:
    """Radius of a ball in the rotor's frame in which the floater neither touches a body nor is lost, m."""
    rotor = rotor_gap(scene, center) if scene.turning_bodies or scene.axial_coils else np.inf
    room = min(rotor, reach - float(np.linalg.norm(center)))
    if not scene.standing_bodies:
        return room
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    places, slack = turned_about_z(center, angles), float(np.hypot(*center[:2])) * np.pi / ANGLES
    plate = replace(scene.plate, lowering=None) if scene.plate else None
    still, way = replace(scene, rotor=(), conductors=(), plate=plate), scene.plate.way if scene.plate else 0.0
    seen = (places[:, None] + np.linspace(0.0, way, DEPTHS if way else 1)[:, None] * [0.0, 0.0, 1.0]).reshape(-1, 3)
    return min(room, float(clearance(still, np.zeros(len(seen)), seen).min()) - slack - way / DEPTHS / 2)
