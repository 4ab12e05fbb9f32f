"""The compiled parts of a flight through balls: one for balls of each kind, and one for the table's own field.

A plate's currents have balls of their own (`local_plates`), in the laboratory, while the plate stands still.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import cast

import heyoka as hy
import numpy as np

from ...fem.harmonics.interior import Ball
from ...fem.harmonics.local import BallField
from ...fem.rotor.table import FieldTable, RangeError
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..motion.effect import Effect, Fittable, InBall, Interaction, interaction_of
from ..motion.effects import with_effects
from ..motion.equations import Equations, equations_of_motion, parameters
from ..motion.events import clearance, flight_events, range_events, rotor_gap
from ..motion.plate import PlateFormula, PlateMemory, seen_by_plate
from ..motion.state import Parameter, Scales, State, turned_about_z
from .compiled import STRAIGHT_TURNS, TOLERANCE, Flight, compile_flight, flight_of, scaled_state
from .plate_balls import KEY, PlateBall, PlateBalls
from .plate_formula import PlateInBall, PlateKind, WholePlate
from .trajectory import FieldChanges

LEFT = "left"
DEGREE = len(Parameter)
"""Number of the runtime parameter that says of which degree the ball is: 0 where there is none."""
SMALL, LARGE = BallField(DEGREE + 1, 7), BallField(DEGREE + 1, 9)
"""The second kind, twice as wide and half again as slow, is for a floater that has left a small ball."""
FIRST = DEGREE + 1 + LARGE.count
"""Number of the first runtime parameter of the effects in a ball."""
LOOSER = 300
"""A step's error is relative to the largest of states and events: 250 and more by the event of loss, 3 in a ball.

Measured: in a ball J drifts by 3e-14 in 1100 turns at 3e-14, and by 2e-14 in the table's field at 1e-16.
"""
WORTH = 5e6
"""Length of a field's expressions, written out, from which on balls are faster.

A dipole has 6e3, a cuboid's closed form 2e4, two of them 4e4, moments up to degree 9 4e6 (as fast as a ball), a cube's
table by finite elements 9e6 from 3 mm off contact on and 1e8 from contact on.
"""


@dataclass(frozen=True, eq=False)
class Parts:
    """What flies in balls of a degree, or in the table's own field; compiled when it is first needed.

    Parameters
    ----------
    scene, table : the problem
    duration, tolerance, compact, memory : as of `compile_flight`
    """

    scene: Scene
    table: FieldTable
    duration: float
    tolerance: float
    compact: bool | None
    memory: PlateMemory | None
    _known: dict[tuple[int, PlateKind | None], Flight] = field(default_factory=dict)

    def of(self, degree: int, kind: PlateKind | None = None) -> Flight:
        """The part for balls of a degree, 0: in none; and for a kind of a plate's, None: in its table's own fields."""
        if (degree, kind) not in self._known:
            self._known[degree, kind] = self._compiled(degree, kind)
        return self._known[degree, kind]

    @property
    def first(self) -> int:
        """Number of the first runtime parameter of a plate."""
        return FIRST + sum(effect.count for effect in fitted(with_effects(self.scene, self.table), LARGE)) + KEY

    @property
    def compile_seconds(self) -> float:
        """Time that compilation took so far."""
        return sum(part.compile_seconds for part in self._known.values())

    def _compiled(self, degree: int, kind: PlateKind | None) -> Flight:
        scene, memory = self.scene, self.memory
        if not degree:
            return compile_flight(scene, self.table, self.duration, self.tolerance, True, memory)
        plate: PlateFormula | None = None
        if memory is not None:
            plate = PlateInBall(memory, kind, self.first) if kind else WholePlate(memory, self.first)
        equations, inside = ball_equations(scene, self.table, BallField(DEGREE + 1, degree), plate)
        leaves = [inside]
        if isinstance(plate, PlateInBall):
            offset = plate.offset(seen_by_plate(plate, equations.variables[:3]))
            leaves.append(1.0 - hy.sum([t * t for t in offset]))
        events = [hy.t_event(each, direction=hy.event_direction.negative) for each in leaves]
        meanings, tolerance = [LEFT] * len(events), LOOSER * self.tolerance
        if plate is not None:
            lost, meaning = flight_events(replace(scene, rotor=(), conductors=(), plate=None), equations.variables[:3])
            ends, told = range_events(plate, equations.variables[:3])
            events, meanings, tolerance = [*events, *lost, *ends], [*meanings, *meaning, *told], self.tolerance
        long = memory is None and degree == SMALL.degree and scene.frequency * self.duration > STRAIGHT_TURNS
        straight = long if self.compact is None else not self.compact
        return flight_of(scene, equations, (events, meanings), self.duration, tolerance, not straight, plate)


def ball_equations(
    scene: Scene, table: FieldTable, formula: BallField, plate: PlateFormula | None = None
) -> tuple[Equations, hy.expression]:
    """The motion in a ball, with the effects of the table, and what becomes negative outside of it."""
    tilted, inside = bool(np.any(scene.gravity[:2])), in_ball(with_effects(scene, table), formula)
    equations = equations_of_motion(inside, tilted, plate)
    offset = formula.offset([hy.par[Parameter.LENGTH] * x for x in equations.variables[:3]])
    return equations, 1.0 - hy.sum([t * t for t in offset])


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
    return Interaction(formula, tuple(effects))


def fitted(whole: Interaction, formula: BallField) -> list[InBall]:
    """Those of the effects in a ball that have numbers of their own."""
    pairs = zip(whole.effects, in_ball(whole, formula).effects, strict=True)
    return [cast(InBall, local) for effect, local in pairs if isinstance(effect, Fittable)]


def is_long(table: FieldTable) -> bool:
    """Whether a field's or an effect's expressions are longer than those of a ball."""
    if any(isinstance(effect, Fittable) for effect in interaction_of(table).effects):
        return True
    field, gradient = table.expressions(hy.make_vars("x", "y", "z"))
    return sum(len(e) for e in [*field, *(e for row in gradient for e in row)]) > WORTH


ERROR = 1e-6
"""Of a ball's field and its gradient, relative; the gradient of a table by finite elements is known to 4e-5."""
SPACING = 1 / 32
"""Of the lattice, in radii of the floater."""
LEAST = 1.5
"""Smallest radius of a ball in spacings: a floater that enters it is at most 0.87 of them from the centre."""
TRIALS = 5
ANGLES, DEPTHS = 72, 400
MOST = 4096
"""Balls that are remembered, 2.6 kB each."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Runtime parameters of the ball for any place; they depend on its cell alone, so that a flight can be repeated.

    Parameters
    ----------
    scene : whose bodies the floater must not touch while it is in a ball
    evaluate : B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m
    formula : of the field in a ball
    reach : distance from the origin at which the floater is lost, m
    effects : that have numbers of their own in a ball; these follow those of the largest formula's field
    """

    scene: Scene
    evaluate: Callable[[Array], tuple[Array, Array]]
    formula: BallField
    reach: float
    effects: Sequence[InBall] = ()
    _known: dict[tuple[int, ...], tuple[Array, float] | None] = field(default_factory=dict)

    def at(self, place: Array) -> tuple[Array, float] | None:
        """Parameters and error of the ball for `place` (3,) m; None where a body or the end of the flight is near."""
        spacing = SPACING * self.scene.floater.radius
        cell = tuple(int(k) for k in np.round(place / spacing))
        if cell not in self._known:
            if len(self._known) >= MOST:
                self._known.clear()
            self._known[cell] = self._made(np.array(cell) * spacing, LEAST * spacing)
        return self._known[cell]

    def _made(self, center: Array, least: float) -> tuple[Array, float] | None:
        """The largest ball about `center` whose expansion has at most the error allowed."""
        room = _room(self.scene, center, self.reach)
        near = rotor_gap(self.scene, center) + self.scene.floater.radius
        radius = min(room, near / 10)
        error = np.inf
        for _ in range(TRIALS):
            if radius < least:
                return None
            try:
                values, error = self._fit(Ball(center, radius))
            except RangeError:
                radius = room = radius / 2
                continue
            if error <= ERROR and (error > ERROR / 4 or radius >= room):
                break
            radius = min(radius * min(0.9 * (ERROR / max(error, 1e-15)) ** (1 / (self.formula.degree - 1)), 2.0), room)
        return (values, error) if error <= ERROR else None

    def _fit(self, ball: Ball) -> tuple[Array, float]:
        """Parameters of a ball, and the largest error, those of effects by what they may have."""
        values, error = self.formula.fit(self.evaluate, ball)
        if not self.effects:
            return values, error
        gradient = self.evaluate(ball.center[None])[1][0]
        found = [effect.fit(ball, gradient) for effect in self.effects]
        padded = np.concatenate([values, np.zeros(FIRST - DEGREE - 1 - len(values))])
        return np.concatenate([padded, *(numbers for numbers, _ in found)]), max(
            error, *(ERROR * share for _, share in found)
        )


def _room(scene: Scene, center: Array, reach: float) -> float:
    """Radius of a ball in the rotor's frame in which the floater neither touches a body nor is lost, m."""
    rotor = rotor_gap(scene, center) if scene.turning_bodies else np.inf
    room = min(rotor, reach - float(np.linalg.norm(center)))
    if scene.plate is None:
        return room
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    places, slack = turned_about_z(center, angles), float(np.hypot(*center[:2])) * np.pi / ANGLES
    lowering, still = (
        scene.plate.lowering,
        replace(scene, rotor=(), conductors=(), plate=replace(scene.plate, lowering=None)),
    )
    way = lowering.distance if lowering else 0.0
    depths = np.linspace(0.0, way, DEPTHS if way else 1)
    seen = (places[:, None] + depths[:, None] * [0.0, 0.0, 1.0]).reshape(-1, 3)
    return min(room, float(clearance(still, np.zeros(len(seen)), seen).min()) - slack - way / DEPTHS / 2)


INSIDE = 1 - 1e-9
"""Square of the distance from a ball's centre, in radii, from which on the floater has left it."""
STAY = 4.0
"""A ball is worth its making if the floater needs so many radians of the rotor's turn for its radius, up or down."""
SNUG = 0.97
"""Largest part of a ball's radius to which the circle may reach on which the rotor sees the floater."""


@dataclass(frozen=True, eq=False)
class LocalFlight:
    """A flight of a scene in a table's field: its parts fly in balls, and beside bodies in the table's own field."""

    scene: Scene
    table: FieldTable
    parts: Parts
    _balls: dict[tuple[int, float], Balls] = field(default_factory=dict)
    _over_plate: dict[bytes, Flight] = field(default_factory=dict)

    @property
    def scales(self) -> Scales:
        """Units of the state."""
        return Scales.of(self.scene)

    @property
    def values(self) -> Array:
        """Runtime parameters, without a ball."""
        known = parameters(self.scene, self.scales)
        return np.concatenate([known, np.zeros(self.parts.first - len(known))])

    @property
    def compile_seconds(self) -> float:
        """Time that compilation took so far."""
        return self.parts.compile_seconds

    def state(self, start: State, currents: Array) -> Array:
        """See `Flight.state`."""
        return scaled_state(self.scene, self.parts.memory, start, currents)

    def part(self, values: Array) -> Flight:
        """What flies on with these runtime parameters."""
        degree, key = int(values[DEGREE]), values[-KEY:]
        if self.plates is None or not key[0]:
            return self.parts.of(degree)
        known = np.array([degree, *key, values[Parameter.PLATE_DEPTH]]).tobytes()
        if known not in self._over_plate:
            if len(self._over_plate) >= MOST:
                self._over_plate.clear()
            ball, part = PlateBall.of(key), self.parts
            kind, numbers = self.plates.told(ball, part.first, values)
            reduction = self.plates.reduction(ball, values)
            self._over_plate[known] = replace(part.of(degree, kind), numbers=numbers, reduction=reduction)
        return self._over_plate[known]

    @cached_property
    def plates(self) -> PlateBalls | None:
        """Balls of the plate's currents, if it has some."""
        memory = self.parts.memory
        return None if memory is None else PlateBalls(memory, self.scene.floater.radius)

    def enter(self, start: State, values: Array, time: float = 0.0) -> float:
        """Set the runtime parameters to a ball, a small one if it will do, for a start at a scaled time; its error."""
        state, error = self.scales.pack(start), 0.0
        values[DEGREE] = 0.0
        for formula in (SMALL, LARGE):
            if not values[DEGREE]:
                error = self.enter_ball(formula, state, values)
        self.enter_plate_ball(time, state, values)
        return error

    def onward(self, values: Array, changes: FieldChanges) -> FieldChanges:
        """Go over to another ball once the floater has left its own; what has been done of that.

        To a large one, from a small ball as well.
        """
        before, (degree, *center, inverse) = self.part(values), values[DEGREE : DEGREE + 5]
        time, place = before.integrator.dtime, before.integrator.state[:3]
        inside = bool(degree) and np.sum((place * self.scales.length - center) ** 2) * inverse**2 < INSIDE
        if inside and (self.plates is None or self.plates.holds(sum(time), before.integrator.state, values)):
            return changes
        after, state = values.copy(), before.whole
        error = 0.0 if inside else self.enter_ball(LARGE, state, after)
        self.enter_plate_ball(sum(time), state, after)
        return self._changed(time, state, values, after, error, changes)

    def leg(self, values: Array, depth: float, speed: float, changes: FieldChanges) -> FieldChanges:
        """See `Flight.leg`: a plate that moves is told by its own table."""
        if self.plates is None or (depth, speed) == (values[Parameter.PLATE_DEPTH], values[Parameter.PLATE_SPEED]):
            values[Parameter.PLATE_DEPTH], values[Parameter.PLATE_SPEED] = depth, speed
            return changes
        before, after = self.part(values), values.copy()
        after[Parameter.PLATE_DEPTH], after[Parameter.PLATE_SPEED] = depth, speed
        time, state = before.integrator.dtime, before.whole
        self.enter_plate_ball(sum(time), state, after)
        return self._changed(time, state, values, after, 0.0, changes)

    def enter_plate_ball(self, time: float, state: Array, values: Array) -> None:
        """Set the ball of a plate's currents for a scaled state at a time, if there is one and the rotor has one."""
        if self.plates is None:
            return
        ball = self.plates.around(time, state, values) if values[DEGREE] else None
        values[-KEY:] = 0.0 if ball is None else ball.key

    def _changed(
        self, time: tuple[float, float], state: Array, values: Array, after: Array, error: float, changes: FieldChanges
    ) -> FieldChanges:
        """Fly on with other runtime parameters; what that does to the energy is booked in the work."""
        if np.array_equal(values, after):
            return changes
        changes = self.booked(sum(time), state, values, after, error, changes)
        self.part(values).take(time, state)
        return changes

    def go_over(self, time: float, state: Array, values: Array, changes: FieldChanges) -> FieldChanges:
        """Set the ball for a scaled state at a time, and book in its work what that does to the energy."""
        after = values.copy()
        error = self.enter_ball(LARGE, state, after)
        if values[DEGREE] == after[DEGREE] == 0:
            return changes
        return self.booked(time, state, values, after, error, changes)

    def booked(
        self, time: float, state: Array, values: Array, after: Array, error: float, changes: FieldChanges
    ) -> FieldChanges:
        """Take other runtime parameters for a scaled state at a time, and book what that does to the energy."""
        now, parts = np.array([time]), [(self.part(each), each[None]) for each in (after, values)]
        energies = [part.terms(now, part.own(state)[None], pars).sum() for part, pars in parts]
        jump = float(energies[0] - energies[1])
        state[-1] += jump
        values[:] = after
        return FieldChanges(
            changes.count + 1, changes.energy + jump, changes.total + abs(jump), max(changes.error, error)
        )

    def enter_ball(self, formula: BallField, state: Array, values: Array) -> float:
        """Set the ball of the circle on which the rotor sees a floater in a scaled state, if there is one; its error.

        A floater that turns less than the rotor, or not at all, goes round such a circle once a turn, backwards.
        """
        length, rate, (x, y, _) = self.scales.length, values[Parameter.RATE], state[:3]
        drift = state[3:6] - rate * np.array([-y, x, 0.0])
        arm = rate * np.array([-drift[1], drift[0], 0.0])
        middle, way = (state[:3] - arm) * length, float(abs(drift[2]) if rate else np.linalg.norm(drift)) * length
        found = self._balls_of(formula, float(values[Parameter.LOST_DISTANCE]) * length).at(middle)
        values[DEGREE:-KEY] = 0.0
        if found is None:
            return 0.0
        (*center, inverse), error = found[0][:4], found[1]
        reach = float(np.linalg.norm(arm)) * length + float(np.linalg.norm(middle - center))
        if reach * inverse > SNUG or STAY * way * inverse > 1:
            return 0.0
        values[DEGREE] = formula.degree
        values[DEGREE + 1 : DEGREE + 1 + len(found[0])] = found[0]
        return error

    def _balls_of(self, formula: BallField, reach: float) -> Balls:
        key = formula.degree, reach
        if key not in self._balls:
            effects = fitted(with_effects(self.scene, self.table), formula)
            self._balls[key] = Balls(self.scene, self.table.evaluate, formula, reach, effects)
        return self._balls[key]


def compile_local_flight(
    scene: Scene,
    table: FieldTable,
    duration: float,
    tolerance: float = TOLERANCE,
    compact: bool | None = None,
    memory: PlateMemory | None = None,
) -> Flight | LocalFlight:
    """Compile the motion of a scene in balls, if its table's own expressions are longer than theirs or beside a plate.

    Parameters as of `compile_flight`.
    """
    if memory is None and not is_long(table):
        return compile_flight(scene, table, duration, tolerance, compact, memory)
    parts = Parts(scene, table, duration, tolerance, compact, memory)
    if memory is None:
        parts.of(SMALL.degree)
    return LocalFlight(scene, table, parts)
