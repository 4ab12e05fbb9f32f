"""Flights side by side in the lanes of a processor, each in a ball of its own, all by the same code.

Taylor steps of the lanes are taken together, but each lane has its own time and step, and no lane's numbers enter
another's.  A lane whose flight has ended, or goes on in balls of another kind or in none, takes the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import heyoka as hy
import numpy as np

from ...fem.harmonics import BallField
from ...fem.storage import compiled
from ...geometry.basics import Array
from ..flights import DEGREE, DURATION, LOOSER, TOLERANCE, IntegrationError, LocalFlight, ball_equations
from .flying import Flying

LANES = 8
"""Measured: a flight in eight lanes takes a quarter of the time of one alone, in four a half, in 16 a third."""
TOGETHER = 200
"""Steps between two looks for lanes whose flights have ended; a hundred are about 16 turns."""


class Lanes:
    """Flies many flights whose equations are the same but for runtime parameters, in balls of one kind.

    Parameters
    ----------
    like : one of them
    formula : kind of the balls
    """

    def __init__(self, like: LocalFlight, formula: BallField) -> None:
        self.formula = formula
        equations, inside = ball_equations(like.scene, like.table, formula)
        self._integrator = compiled(
            hy.taylor_adaptive_batch,
            [*zip(equations.variables, equations.rates, strict=True), (hy.expression("work"), equations.power)],
            np.zeros((len(equations.variables) + 1, LANES)),
            tol=LOOSER * TOLERANCE,
            compact_mode=True,
            opt_level=1,
            t_events=[hy.t_event_batch(inside, direction=hy.event_direction.negative)],
        )

    def fly(self, flights: Sequence[Flying]) -> None:
        """Fly on until flights are over or can go on in no ball of this kind.

        Raises
        ------
        IntegrationError : a state became infinite
        """
        waiting, ends = iter(flights), np.zeros(LANES)
        self._integrator.set_time(ends)
        for lane in range(LANES):  # one that stays empty must be finite too: the equations are not, where all is zero
            self._put(lane, flights[0])
        flying = {lane: first for lane in range(LANES) if (first := self._next(lane, waiting, ends))}
        while flying:
            recorded = any(flight.recorder for flight in flying.values())
            found, _ = self._integrator.propagate_until(ends, max_steps=TOGETHER, c_output=recorded)
            if recorded:
                self._record(flying, found)
            for lane, (outcome, _, _, steps) in enumerate(self._integrator.propagate_res):
                if lane not in flying:
                    continue
                flying[lane].log.steps += int(steps)
                if outcome in (hy.taylor_outcome.success, hy.taylor_outcome.step_limit):
                    flying[lane].time = float(self._integrator.time[lane])
                elif following := self._after(lane, flying.pop(lane), outcome) or self._next(lane, waiting, ends):
                    flying[lane] = following

    def _next(self, lane: int, waiting: Iterator[Flying], ends: Array) -> Flying | None:
        """Put the next flight on a lane; an empty lane stays where it is."""
        following = next(waiting, None)
        ends[lane] = following.end if following else self._integrator.time[lane]
        if following is None:
            return None
        whole, rest = (part.copy() for part in self._integrator.dtime)
        whole[lane], rest[lane] = following.time, 0.0
        self._integrator.set_dtime(whole, rest)
        return self._put(lane, following)

    def _put(self, lane: int, flying: Flying) -> Flying:
        """Give a lane the state and the ball of its flight."""
        self._integrator.state[:, lane] = flying.state
        self._integrator.pars[:, lane] = flying.values[: len(self._integrator.pars)]
        self._integrator.reset_cooldowns(lane)
        return flying

    def _record(self, flying: Mapping[int, Flying], found: Any) -> None:
        """Keep the samples of the steps just taken."""
        now = self._integrator.time
        due = {lane: flight.due(float(now[lane])) for lane, flight in flying.items()}
        most = max(len(times) for times in due.values())
        if not most:
            return
        grid = np.tile(now, (most, 1))
        for lane, times in due.items():
            grid[: len(times), lane] = times
        states = found(grid)
        for lane, times in due.items():
            if len(times):
                flying[lane].keep(times, states[: len(times), :, lane])

    def _after(self, lane: int, flying: Flying, outcome: hy.taylor_outcome) -> Flying | None:
        """A flight that goes on in another ball of this kind; none that is over or needs something else."""
        flying.time, flying.state = float(self._integrator.time[lane]), self._integrator.state[:, lane].copy()
        if outcome == hy.taylor_outcome.err_nf_state:
            raise IntegrationError(f"A floater's state became infinite at t = {flying.seconds:.6g} s.")
        if outcome == hy.taylor_outcome.time_limit:
            flying.finish(DURATION)
            return None
        flying.go_over()
        return self._put(lane, flying) if flying.values[DEGREE] == self.formula.degree else None
