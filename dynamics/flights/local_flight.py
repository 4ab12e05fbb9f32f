"""A flight through small balls in which the rotor's field is an expansion with runtime parameters as coefficients.

The same compiled code flies everywhere.  A floater that leaves its ball goes over to another one, by an event; where
a body is so near that there is no room for one, or where it does not turn with the rotor, to the full table, which
alone knows contact and loss.

Each change moves the floater's energy by U_new - U_old = -m·(B_new - B_old) at the same state, about 1e-8 of it.
It goes into the integrated work, so that the ledger tells what the motion between changes does, and is summed up by
itself in `FieldChanges`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import heyoka as hy
import numpy as np

from ...fem.harmonics import BallField
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import Parameter, PlateMemory, Scales, State, equations_of_motion, parameters
from .balls import Balls
from .compiled_flight import TOLERANCE, Flight, compile_flight, flight_of
from .trajectory import FieldChanges

LEFT = "left"
DEGREE = len(Parameter)
"""Number of the runtime parameter that says of which degree the ball is: 0 where there is none."""
SMALL, LARGE = BallField(DEGREE + 1, 7), BallField(DEGREE + 1, 9)
"""The second kind, twice as wide and half again as slow, is for a floater that has left a small ball."""
INSIDE = 1 - 1e-9
"""Square of the distance from a ball's centre, in radii, from which on the floater has left it."""
LOOSER = 300
"""A step's error is relative to the largest of states and events: 250 and more by the event of loss, 3 in a ball.

Measured: in a ball J drifts by 3e-14 in 1100 turns at 3e-14, and by 2e-14 in the table's field at 1e-16.
"""
STAY = 4.0
"""A ball is worth its making if the floater needs so many radians of the rotor's turn for its radius."""
STRAIGHT_TURNS = 1.5e5
"""Turns from which on straight code saves more time (15 of 36 µs a step) than its compilation takes (13 s)."""
WORTH = 200
"""Length of a field's decomposed expressions from which on balls are faster.

A dipole has 41, a cuboid's closed form 113, two of them 189, a cube's table 206 from 11.5 mm off the faces on and 390
from contact on; small balls 87, with more coefficients.
"""


@dataclass(frozen=True, eq=False)
class LocalFlight:
    """A flight in balls, and beside bodies in the table's own field.

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
    _parts: dict[int, Flight] = field(default_factory=dict)
    _balls: dict[tuple[int, float], Balls] = field(default_factory=dict)

    @property
    def scales(self) -> Scales:
        """Units of the state."""
        return Scales.of(self.scene)

    @property
    def values(self) -> Array:
        """Runtime parameters, without a ball."""
        return np.concatenate([parameters(self.scene, self.scales), np.zeros(1 + LARGE.count)])

    @property
    def compile_seconds(self) -> float:
        """Time that compilation took so far."""
        return sum(part.compile_seconds for part in self._parts.values())

    def state(self, start: State, currents: Array) -> Array:
        """See `Flight.state`."""
        return self.compile(SMALL.degree).state(start, currents)

    def part(self, values: Array) -> Flight:
        """What flies on with these runtime parameters."""
        return self.compile(int(values[DEGREE]))

    def enter(self, start: State, values: Array) -> float:
        """Set the runtime parameters to the small ball of where the flight starts, if it has one; its error."""
        return self._enter(SMALL, start.position, self.scales.pack(start), values)

    def onward(self, values: Array, changes: FieldChanges) -> FieldChanges:
        """Go over to another ball once the floater has left its own; what has been done of that.

        From a small ball to the large one of the same place, later to that of the floater's place.
        """
        before, (degree, *center, inverse) = self.part(values), values[DEGREE : DEGREE + 5]
        place = before.integrator.state[:3] * self.scales.length
        if degree and np.sum((place - center) ** 2) * inverse**2 < INSIDE:
            return changes
        after = values.copy()
        asked = np.array(center) if degree == SMALL.degree else place
        error = self._enter(LARGE, asked, before.integrator.state, after)
        if degree == after[DEGREE] == 0:
            return changes
        jump = self._change(before, values, after)
        values[:] = after
        return FieldChanges(
            changes.count + 1, changes.energy + jump, changes.total + abs(jump), max(changes.error, error)
        )

    def _enter(self, formula: BallField, asked: Array, state: Array, values: Array) -> float:
        """Set the ball of the place `asked` if it holds a scaled state, else that of its place, else none; its error.

        None either for a floater that would leave it at once.
        """
        length, (x, y, _) = self.scales.length, state[:3]
        drift = state[3:6] - values[Parameter.RATE] * np.array([-y, x, 0.0])
        place, way = state[:3] * length, STAY * float(np.linalg.norm(drift)) * length
        balls = self._balls_of(formula, float(values[Parameter.LOST_DISTANCE]) * length)
        values[DEGREE:] = 0.0
        for where in (asked, place):
            found = balls.at(where)
            if found is None:
                continue
            (*center, inverse), error = found[0][:4], found[1]
            if np.sum((place - center) ** 2) * inverse**2 < INSIDE and way * inverse < 1:
                values[DEGREE] = formula.degree
                values[DEGREE + 1 : DEGREE + 1 + formula.count] = found[0]
                return error
        return 0.0

    def _balls_of(self, formula: BallField, reach: float) -> Balls:
        key = formula.degree, reach
        if key not in self._balls:
            self._balls[key] = Balls(self.scene, self.table.evaluate, formula, reach)
        return self._balls[key]

    def _change(self, before: Flight, values: Array, after: Array) -> float:
        """Hand the state over to the part for the runtime parameters `after`; U_new - U_old."""
        time, state, following = before.integrator.dtime, before.integrator.state.copy(), self.part(after)
        now, row = np.array([sum(time)]), state[None]
        jump = float(following.terms(now, row, after[None]).sum() - before.terms(now, row, values[None]).sum())
        state[-1] += jump
        following.integrator.dtime = time
        following.integrator.state[:] = state
        following.integrator.reset_cooldowns()
        return jump

    def compile(self, degree: int) -> Flight:
        """The part for balls of a degree, or for none; compiled once."""
        if degree not in self._parts:
            self._parts[degree] = self._compiled(degree)
        return self._parts[degree]

    def _compiled(self, degree: int) -> Flight:
        scene, memory = self.scene, self.memory
        if not degree:
            return compile_flight(scene, self.table, self.duration, self.tolerance, True, memory)
        formula = BallField(DEGREE + 1, degree)
        tilted, conducting = bool(np.any(scene.gravity[:2])), bool(scene.floater.conductivity)
        equations = equations_of_motion(formula, tilted, memory, conducting, scene.angular_velocity)
        offset = formula.offset([hy.par[Parameter.LENGTH] * x for x in equations.variables[:3]])
        leaves = hy.t_event(1.0 - hy.sum([t * t for t in offset]), direction=hy.event_direction.negative)
        long = memory is None and degree == SMALL.degree and scene.frequency * self.duration > STRAIGHT_TURNS
        straight = long if self.compact is None else not self.compact
        return flight_of(scene, equations, ([leaves], [LEFT]), LOOSER * self.tolerance, not straight, memory)


def compile_local_flight(
    scene: Scene,
    table: FieldTable,
    duration: float,
    tolerance: float = TOLERANCE,
    compact: bool | None = None,
    memory: PlateMemory | None = None,
) -> Flight | LocalFlight:
    """Compile the motion of a scene in balls, if its table's own expressions are longer than theirs.

    Parameters as of `compile_flight`.
    """
    if not is_long(table):
        return compile_flight(scene, table, duration, tolerance, compact, memory)
    flight = LocalFlight(scene, table, duration, tolerance, compact, memory)
    flight.compile(SMALL.degree)
    return flight


def is_long(table: FieldTable) -> bool:
    """Whether a field's expressions are longer than those of a ball."""
    position = hy.make_vars("x", "y", "z")
    b, gradient = table.expressions(position)
    outputs = [*b, *(e for row in gradient for e in row)]
    return len(hy.cfunc(outputs, position, compact_mode=True, opt_level=0).dc) > WORTH
