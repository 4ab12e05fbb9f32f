"""Many flights over a plate whose currents are in the motion: from a launch to what becomes of the floater.

As in `lanes`, Taylor steps of the lanes are taken together, but each lane has its own time and step and no lane's
numbers enter another's.  The field is the table's own expressions, so that a short one (dipoles, closed forms) is fast.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np

from ...fem.compiled_code import compiled
from ...fem.rotor.table import FieldFormula
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import Scene
from ..motion.effects import with_effects
from ..motion.equations import equations_of_motion, parameters
from ..motion.events import (
    BEYOND,
    CONTACT,
    clearance,
    flight_events,
    lost_distance,
    plate_depth,
    plate_legs,
    range_events,
)
from ..motion.plate import PlateForce, PlateMemory
from ..motion.state import Parameter, Scales, State, Vector
from .batch import LANES, Endings
from .pieces import IntegrationError
from .plate_formula import WholePlate
from .trajectory import DURATION

STEP_ERROR = 1e-9
"""Relative error of a Taylor step: a launch is chaotic, so that single flights depend on it, but not their shares."""
TOGETHER = 200
"""Steps between two looks for lanes whose flights have ended."""
FLAT = 1e-9
"""Sine of the angle to the horizontal that a plate may have."""


def launched(
    scene: Scene,
    table: FieldFormula,
    memory: PlateMemory,
    starts: State,
    duration: float,
    step_error: float = STEP_ERROR,
    currents: Array | None = None,
) -> Endings:
    """Fly a scene's floater over its plate from many starts, for `duration` (s) each, or until contact or loss.

    A flight's numbers are the same to the last bit whichever flights fly beside it.  Contact with the rotor is that of
    `flight_events`; where a step misses an edge, contact is told at the latest where the sphere meets the largest one
    inside the magnet.  The plate is an obstacle without edges.

    Parameters
    ----------
    scene : has the plate of `memory`, which may be lowered
    table : the rotor's field, with effects if it is an `Interaction`
    memory : the plate's currents
    starts : states (n, 3) at t = 0, SI units
    step_error : relative, of a Taylor step
    currents : (n, k) the plate's states then, √J; if not given, those under a floater long held at rest

    Accuracy: that of the tables; beyond the range of the plate's the currents' field is continued as it is, and
    `Endings.left_plate_table` says which flights went there.

    Raises
    ------
    InputError : `duration` is not positive, there is no start, the plate does not lie flat, or the floater is no sphere
    """
    scene.floater.must_be("sphere", where="where many fly side by side", instead="Fly them one by one.")
    if not duration > 0:
        raise InputError(f"Input duration must be positive; instead received {duration} s.")
    if not len(starts.position):
        raise InputError("Input starts must have one state at least; instead received none.")
    return _Launches(scene, table, memory, duration, step_error).flown(starts, currents)


def obstacles(scene: Scene, memory: PlateMemory, position: Vector) -> list[hy.expression]:
    """What becomes negative in contact, and is a polynomial of the scaled position, so that no step misses it.

    Raises
    ------
    InputError : the plate does not lie flat
    """
    box, length = memory.plate.box, hy.par[Parameter.LENGTH]
    normal = int(np.argmin(box.size))
    if abs(abs(box.rotation[2, normal]) - 1) > FLAT:
        raise InputError("Input plate must lie flat under the rotor; instead it is turned. Leave out rotation_deg.")
    face = float(box.center[2] + box.size[normal] / 2)
    depth = hy.par[Parameter.PLATE_DEPTH] + hy.par[Parameter.PLATE_SPEED] * hy.time
    found = [position[2] + depth - face / length - 1.0]
    for body in scene.turning_bodies:
        apart = [length * position[i] - float(body.center[i]) for i in range(3)]
        near = float(np.min(body.size)) / 2 + scene.floater.radius
        found.append((hy.sum([a * a for a in apart]) - near**2) / (length * length))
    return found


@dataclass
class _One:
    """A flight on a lane: its number, and the leg of the plate's way that it flies."""

    number: int
    leg: int = 0


class _Launches:
    def __init__(self, scene: Scene, table: FieldFormula, memory: PlateMemory, duration: float, step_error: float):
        tilted = bool(np.any(scene.gravity[:2]))
        plate = WholePlate(memory)
        equations = equations_of_motion(with_effects(scene, table), tilted, plate)
        whole = flight_events(replace(scene, plate=None), equations.variables[:3])
        smooth = obstacles(scene, memory, equations.variables[:3])
        leaving = range_events(plate, equations.variables[:3])
        events = [*(event.expression for event in (*whole[0], *leaving[0])), *smooth]
        self.meanings = [*whole[1], *leaving[1], *[CONTACT] * len(smooth)]
        self.scene, self.scales, self.legs = scene, Scales.of(scene), plate_legs(scene.plate, duration)
        self.memory = memory
        self.integrator = compiled(
            hy.taylor_adaptive_batch,
            list(zip(equations.variables, equations.rates, strict=True)),
            np.zeros((len(equations.variables), LANES)),
            tol=step_error,
            compact_mode=True,
            opt_level=1,
            t_events=[hy.t_event_batch(e, direction=hy.event_direction.negative) for e in events],
        )
        values = parameters(scene, self.scales)
        self.values = np.concatenate([values, plate.numbers(values)])
        self.integrator.pars[:] = self.values[: len(self.integrator.pars), None]  # of empty lanes as well
        self.ends = np.zeros(LANES)

    def _begun(self, starts: State, currents: Array | None) -> Array:
        """Scaled states (n, 12 + k) of floater and plate at t = 0, the latter less what the rotor alone leaves."""
        unit = starts.moment / np.linalg.norm(starts.moment, axis=1)[:, None]
        states = self.scales.pack(replace(starts, moment=unit))
        if currents is not None:
            depth = float(plate_depth(self.memory.plate, np.zeros(1))[0])
            left = self.memory.driven(self.scene.angular_velocity).left.signals(0.0, depth)
            return np.concatenate([states, (currents - left) * self.values[Parameter.PLATE_SHARE]], axis=1)
        force, now, silent = PlateForce(self.memory, self.values), np.zeros(len(states)), states.copy()
        silent[:, 6:9] = 0.0
        return np.concatenate([states, force(now, states).signals - force(now, silent).signals], axis=1)

    def flown(self, starts: State, currents: Array | None) -> Endings:
        count = len(starts.position)
        states = self._begun(starts, currents)
        ended, times = np.full(count, CONTACT, dtype="<U8"), np.zeros(count)
        free = clearance(self.scene, np.zeros(count), starts.position) > 0
        waiting = iter(np.flatnonzero(free).tolist())
        box, depth = self.memory.plate.box, plate_depth(self.memory.plate, np.zeros(1))
        left = ~self.memory.table.in_range(box.to_body(starts.position + depth[:, None] * [0.0, 0.0, 1.0]))
        self.integrator.state[:] = states[0][:, None]  # empty lanes stay there
        flying = {lane: one for lane in range(LANES) if (one := self._next(lane, waiting, states))}
        while flying:
            self.integrator.propagate_until(self.ends, max_steps=TOGETHER)
            outcomes = [result[0] for result in self.integrator.propagate_res]
            for lane, one in list(flying.items()):
                end = self._end(lane, one, outcomes[lane])
                if end == BEYOND:
                    left[one.number] = True
                if end in (None, BEYOND):
                    continue
                ended[one.number], times[one.number] = end, self.integrator.time[lane] * self.scales.time
                states[one.number] = self.integrator.state[:, lane]
                following = self._next(lane, waiting, states)
                if following:
                    flying[lane] = following
                else:
                    del flying[lane]
        return Endings(
            ended, np.minimum(times, self.legs[-1][0]), self.scales.unpack(states), np.zeros(count, int), left
        )

    def _end(self, lane: int, one: _One, outcome: hy.taylor_outcome) -> str | None:
        """What has ended the flight on a lane, or `BEYOND`, with which it goes on as with None."""
        if outcome in (hy.taylor_outcome.success, hy.taylor_outcome.step_limit):
            return None
        if outcome == hy.taylor_outcome.err_nf_state:
            raise IntegrationError("A floater's state became infinite: the plate's table is too small for this start.")
        if outcome != hy.taylor_outcome.time_limit:
            return str(self.meanings[-outcome.value - 1])
        if one.leg + 1 == len(self.legs):
            return DURATION
        one.leg += 1
        self._set_leg(lane, one.leg)
        return None

    def _set_leg(self, lane: int, leg: int) -> None:
        end, depth, speed = self.legs[leg]
        self.ends[lane] = end / self.scales.time
        pars = self.integrator.pars
        if len(pars) > Parameter.PLATE_SPEED:
            pars[Parameter.PLATE_DEPTH, lane] = depth / self.scales.length
            pars[Parameter.PLATE_SPEED, lane] = speed * self.scales.time / self.scales.length

    def _next(self, lane: int, waiting: Iterator[int], states: Array) -> _One | None:
        """Put the next flight on a lane; an empty lane stays where it is."""
        number = next(waiting, None)
        if number is None:
            self.ends[lane] = self.integrator.time[lane]
            return None
        whole, rest = (part.copy() for part in self.integrator.dtime)
        whole[lane] = rest[lane] = 0.0
        self.integrator.set_dtime(whole, rest)
        self.integrator.state[:, lane] = states[number]
        self.integrator.pars[:, lane] = self.values[: len(self.integrator.pars)]
        reach = lost_distance(self.scales.unpack(states[number]).position) / self.scales.length
        self.integrator.pars[Parameter.LOST_DISTANCE, lane] = reach
        self._set_leg(lane, 0)
        self.integrator.reset_cooldowns(lane)
        return _One(number)
