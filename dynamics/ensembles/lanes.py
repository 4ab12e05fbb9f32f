"""Flights side by side in the lanes of a processor, each in a ball of its own, all by the same code.

Taylor steps of the lanes are taken together, but each lane has its own time and step, and no lane's numbers enter
another's.  A lane whose flight has ended takes the next one.  A floater that leaves its ball gets another; near a
body or on a fast way there is none, and its flight is finished by itself (`flights.fly_on`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.storage import compiled
from ...geometry.basics import Array
from ..flights import (
    DEGREE,
    DURATION,
    LOOSER,
    SMALL,
    TOLERANCE,
    IntegrationError,
    LocalFlight,
    ball_equations,
    fly_on,
)
from ..motion import CONTACT, Parameter, State, clearance, lost_distance

LANES = 8
"""Measured: a flight in eight lanes takes a quarter of the time of one alone, in four a half, in 16 a third."""
TOGETHER = 200
"""Steps between two looks for lanes whose flights have ended; a hundred are about 16 turns."""


@dataclass
class End:
    """How a flight ended: scaled time and state (12,)."""

    ended_by: str
    time: float
    state: Array
    changes: int


class Lanes:
    """Flies many flights of one scene.

    Parameters
    ----------
    flight : gives the balls, and flies where there are none
    duration : of a flight, s
    """

    def __init__(self, flight: LocalFlight, duration: float) -> None:
        self.flight, self.duration = flight, duration
        equations, inside = ball_equations(flight.scene, SMALL)
        self._integrator = compiled(
            hy.taylor_adaptive_batch,
            list(zip(equations.variables, equations.rates, strict=True)),
            np.zeros((len(equations.variables), LANES)),
            tol=LOOSER * TOLERANCE,
            compact_mode=True,
            opt_level=1,
            t_events=[hy.t_event_batch(inside, direction=hy.event_direction.negative)],
        )
        self._values = np.tile(flight.values, (LANES, 1))
        self._changes = np.zeros(LANES, int)
        self._ends = np.zeros(LANES)

    def fly(self, starts: State) -> list[End]:
        """Fly from all starts (n, 3), rotor's frame, t = 0.

        Raises
        ------
        IntegrationError : a state became infinite
        """
        found: dict[int, End] = {}
        waiting = iter(range(len(starts.position)))
        flying = {lane: k for lane in range(LANES) if (k := self._next(lane, waiting, starts, found)) is not None}
        while flying:
            self._integrator.propagate_until(self._ends, max_steps=TOGETHER)
            for lane, (outcome, *_) in enumerate(self._integrator.propagate_res):
                if lane in flying and (end := self._ended(lane, outcome)) is not None:
                    found[flying.pop(lane)] = end
                    following = self._next(lane, waiting, starts, found)
                    if following is not None:
                        flying[lane] = following
        return [found[k] for k in range(len(found))]

    def _next(self, lane: int, waiting: Iterator[int], starts: State, found: dict[int, End]) -> int | None:
        """Put the next flight that begins in a ball on a lane; its number. Others are flown by themselves."""
        flight, now = self.flight, np.zeros(1)
        for k in waiting:
            start, values = State(*(v[k] for v in starts.vectors)), flight.values
            values[Parameter.LOST_DISTANCE] = lost_distance(start.position) / flight.scales.length
            state = flight.scales.pack(start)
            if clearance(flight.scene, now, start.position[None])[0] < 0:
                found[k] = End(CONTACT, 0.0, state, 0)
                continue
            flight.enter(start, values)
            if not values[DEGREE]:
                found[k] = self._alone(values, 0.0, state, 0)
                continue
            self._changes[lane], self._ends[lane] = 0, self.duration / flight.scales.time
            self._integrator.state[:, lane] = state
            self._put(lane, values, 0.0)
            return k
        self._ends[lane] = self._integrator.time[lane]
        return None

    def _put(self, lane: int, values: Array, time: float | None = None) -> None:
        """Runtime parameters of a lane, and its time if it is another one."""
        self._values[lane] = values
        self._integrator.pars[:, lane] = values[: len(self._integrator.pars)]
        self._integrator.reset_cooldowns(lane)
        if time is not None:
            whole, rest = (part.copy() for part in self._integrator.dtime)
            whole[lane], rest[lane] = time, 0.0
            self._integrator.set_dtime(whole, rest)

    def _ended(self, lane: int, outcome: hy.taylor_outcome) -> End | None:
        """How the flight on a lane ended, if it did; one that left its ball goes on in another."""
        integrator, scales = self._integrator, self.flight.scales
        time, state = float(integrator.time[lane]), integrator.state[:, lane].copy()
        if outcome == hy.taylor_outcome.err_nf_state:
            raise IntegrationError(f"A floater's state became infinite at t = {time * scales.time:.6g} s.")
        if outcome == hy.taylor_outcome.time_limit:
            return End(DURATION, time, state, int(self._changes[lane]))
        if outcome in (hy.taylor_outcome.success, hy.taylor_outcome.step_limit):
            return None
        values = self._values[lane].copy()
        self._changes[lane] += 1
        self.flight.enter_ball(SMALL, state[:3] * scales.length, state, values)
        if not values[DEGREE]:
            return self._alone(values, time, state, int(self._changes[lane]))
        self._put(lane, values)
        return None

    def _alone(self, values: Array, time: float, state: Array, changes: int) -> End:
        flight = self.flight
        return End(*fly_on(flight.scene, flight, values, time, state, self.duration), changes)
