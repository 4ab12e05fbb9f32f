"""Flights side by side in the lanes of a processor, each in a ball of its own, all by the same code.

Taylor steps of the lanes are taken together, but each lane has its own time and step, and no lane's numbers enter
another's.  A lane whose flight has ended, or goes on in balls of another kind or in none, takes the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np

from ...fem.harmonics import BallField
from ...fem.storage import compiled
from ...geometry.basics import Array
from ..flights import DEGREE, DURATION, LARGE, LOOSER, TOLERANCE, IntegrationError, LocalFlight, ball_equations

LANES = 8
"""Measured: a flight in eight lanes takes a quarter of the time of one alone, in four a half, in 16 a third."""
TOGETHER = 200
"""Steps between two looks for lanes whose flights have ended; a hundred are about 16 turns."""


@dataclass(frozen=True, eq=False)
class Flying:
    """A flight where it is now: scaled time and state (12,).

    Parameters
    ----------
    number : in the ensemble
    values : runtime parameters, with those of its ball
    changes : how often it went over to another ball
    ended_by : what ended it; nothing while it lasts
    """

    number: int
    values: Array
    time: float
    state: Array
    changes: int = 0
    ended_by: str = ""


class Lanes:
    """Flies many flights of one scene in balls of one kind.

    Parameters
    ----------
    flight : gives the balls
    formula : kind of the balls
    duration : of a flight, s
    """

    def __init__(self, flight: LocalFlight, formula: BallField, duration: float) -> None:
        self.flight, self.formula = flight, formula
        self._end = duration / flight.scales.time
        equations, inside = ball_equations(flight.scene, flight.table, formula)
        self._integrator = compiled(
            hy.taylor_adaptive_batch,
            list(zip(equations.variables, equations.rates, strict=True)),
            np.zeros((len(equations.variables), LANES)),
            tol=LOOSER * TOLERANCE,
            compact_mode=True,
            opt_level=1,
            t_events=[hy.t_event_batch(inside, direction=hy.event_direction.negative)],
        )

    def fly(self, flights: Sequence[Flying]) -> list[Flying]:
        """Fly on until flights are over or can go on in no ball of this kind.

        Raises
        ------
        IntegrationError : a state became infinite
        """
        done: list[Flying] = []
        waiting, ends = iter(flights), np.zeros(LANES)
        self._integrator.set_time(ends)
        flying = {lane: first for lane in range(LANES) if (first := self._next(lane, waiting, ends))}
        while flying:
            self._integrator.propagate_until(ends, max_steps=TOGETHER)
            for lane, (outcome, *_) in enumerate(self._integrator.propagate_res):
                if lane not in flying or outcome in (hy.taylor_outcome.success, hy.taylor_outcome.step_limit):
                    continue
                now = self._after(lane, flying.pop(lane), outcome)
                if now.ended_by or now.values[DEGREE] != self.formula.degree:
                    done.append(now)
                    following = self._next(lane, waiting, ends)
                else:
                    following = self._put(lane, now)
                if following:
                    flying[lane] = following
        return done

    def _next(self, lane: int, waiting: Iterator[Flying], ends: Array) -> Flying | None:
        """Put the next flight on a lane; an empty lane stays where it is."""
        following = next(waiting, None)
        ends[lane] = self._end if following else self._integrator.time[lane]
        if following is None:
            return None
        self._integrator.state[:, lane] = following.state
        whole, rest = (part.copy() for part in self._integrator.dtime)
        whole[lane], rest[lane] = following.time, 0.0
        self._integrator.set_dtime(whole, rest)
        return self._put(lane, following)

    def _put(self, lane: int, flight: Flying) -> Flying:
        """Give a lane the ball of its flight."""
        self._integrator.pars[:, lane] = flight.values[: len(self._integrator.pars)]
        self._integrator.reset_cooldowns(lane)
        return flight

    def _after(self, lane: int, before: Flying, outcome: hy.taylor_outcome) -> Flying:
        """A flight that is over, or has left its ball: with the next one, if there is one."""
        time, state = float(self._integrator.time[lane]), self._integrator.state[:, lane].copy()
        scales, values = self.flight.scales, before.values.copy()
        if outcome == hy.taylor_outcome.err_nf_state:
            raise IntegrationError(f"A floater's state became infinite at t = {time * scales.time:.6g} s.")
        if outcome == hy.taylor_outcome.time_limit:
            return replace(before, time=time, state=state, ended_by=DURATION)
        self.flight.enter_ball(LARGE, state, values)
        return replace(before, values=values, time=time, state=state, changes=before.changes + 1)
