"""A flight through small balls in which the rotor's field is an expansion with runtime parameters as coefficients.

The same compiled code flies everywhere.  A floater that leaves its ball goes over to another one, by an event; where
a body is so near that there is no room for one, or where it does not turn with the rotor, to the full table, which
alone knows contact and loss.  The fields of a plate's currents go over in the same way, about the place in the
laboratory; while the plate moves and where the rotor's field is the full table's, they are their own table's.

Each change moves the floater's energy by U_new - U_old = -m·(B_new - B_old) at the same state, about 1e-8 of it.
It goes into the integrated work, so that the ledger tells what the motion between changes does, and is summed up by
itself in `FieldChanges`.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...fem.harmonics import BallField
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..effects import with_effects
from ..local_plates import KEY, PlateBall, PlateBalls
from ..motion import Parameter, PlateMemory, Scales, State, parameters
from .ball_parts import DEGREE, LARGE, SMALL, Parts, fitted, is_long
from .balls import MOST, Balls
from .compiled_flight import TOLERANCE, Flight, compile_flight, scaled_state
from .trajectory import FieldChanges

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
