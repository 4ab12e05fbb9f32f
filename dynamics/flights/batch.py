"""One of many flights, where it is now."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...fem.compiled_code import compiled
from ...fem.harmonics.local import BallField
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import Scene
from ...geometry.scene.files import startless_text
from ..motion.events import CONTACT, clearance, lost_distance
from ..motion.state import Parameter, State
from .balls import DEGREE, LARGE, LOOSER, SMALL, LocalFlight, Parts, ball_equations
from .compiled import TOLERANCE
from .flight import fly_on
from .pieces import MOST_SAMPLES, IntegrationError, Log, booked, first_interval, flown, ledger_scale
from .trajectory import DURATION, FieldChanges, Recorder, Trajectory


@dataclass(eq=False)
class Flying:
    """A flight; what is not fixed at its start changes as it flies.

    Parameters
    ----------
    flight : gives its balls
    values : runtime parameters, with those of its ball
    state : scaled (13,), with the work
    duration : of the flight, s
    time : scaled
    over : whether it has ended
    recorder, scale : samples with the ledger, and its scale; none where only the end is asked for
    """

    flight: LocalFlight
    values: Array
    state: Array
    duration: float
    time: float = 0.0
    over: bool = False
    log: Log = field(default_factory=Log)
    recorder: Recorder | None = None
    scale: float = 1.0

    @classmethod
    def begun(cls, flight: LocalFlight, start: State, duration: float, recorded: bool) -> Flying:
        """At t = 0; over if it begins in contact."""
        start = replace(start, moment=start.moment / np.linalg.norm(start.moment))
        values, state = flight.values, np.append(flight.scales.pack(start), 0.0)
        values[Parameter.LOST_DISTANCE] = lost_distance(start.position) / flight.scales.length
        found = cls(flight, values, state, duration)
        if clearance(flight.scene, np.zeros(1), start.position[None])[0] < 0:
            found.log.ended_by, found.over = CONTACT, True
            return found
        found.log.changes = FieldChanges(error=flight.enter(start, values))
        if recorded:
            row, part = state[None], flight.part(values)
            found.scale = ledger_scale(flight.scene, part, values, state)
            first = booked(flight.scene, part, values, np.zeros(1), row)[0]
            found.recorder = Recorder(first, first_interval(flight.scene, duration), MOST_SAMPLES)
        return found

    @property
    def end(self) -> float:
        """Scaled time of the end, if nothing ends it before."""
        return self.duration / self.flight.scales.time

    @property
    def seconds(self) -> float:
        """Time since the start, s."""
        return self.time * self.flight.scales.time

    @property
    def degree(self) -> int:
        """Of its ball; 0 where it is in none."""
        return int(self.values[DEGREE])

    def due(self, now: float) -> Array:
        """Scaled times (n,) of the samples since the last look."""
        return np.zeros(0) if self.recorder is None else self.recorder.due(self.time, now, self.end)

    def keep(self, times: Array, states: Array, last: bool = False) -> None:
        """Record samples (n, 13) at scaled times (n,)."""
        if self.recorder is not None:
            part = self.flight.part(self.values)
            self.recorder.add(times, booked(self.flight.scene, part, self.values, times, states), last)

    def finish(self, ended_by: str) -> None:
        """It is over."""
        self.log.ended_by, self.over = ended_by, True
        self.keep(np.array([self.time]), self.state[None], True)

    def go_over(self) -> None:
        """To another ball, or to none."""
        self.log.changes = self.flight.go_over(self.time, self.state, self.values, self.log.changes)

    def alone(self) -> None:
        """Fly on to the end outside of lanes."""
        recorder = self.recorder or Recorder(self.state, first_interval(self.flight.scene, self.duration), MOST_SAMPLES)
        fly_on(self.flight.scene, self.flight, self.values, self.time, self.state, self.duration, recorder, self.log)
        self.time, self.state, self.over = float(recorder.times[-1]), recorder.states[-1], True

    def trajectory(self, speed: float) -> Trajectory:
        """What was recorded, at so many simulated seconds per second."""
        assert self.recorder is not None
        return flown(self.flight.scene, self.recorder, self.log, self.duration, self.scale, speed, 0.0)


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


@dataclass(frozen=True, eq=False)
class Endings:
    """The ends of n flights.

    Parameters
    ----------
    ended_by : (n,) "duration", "contact" or "lost"
    levitated_s : (n,) when, s
    last : states (n, 3) then, along the rotor's axes, SI units
    changes : (n,) how often a floater went from one ball to another
    left_plate_table : (n,) whether it was ever beyond the range of the plate's table, where its field is a continuation
    """

    ended_by: NDArray[np.str_]
    levitated_s: Array
    last: State
    changes: NDArray[np.int_]
    left_plate_table: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: Sequence[Endings]) -> Endings:
        """The parts one after the other."""
        vectors = zip(*(part.last.vectors for part in parts), strict=True)
        return cls(
            np.concatenate([part.ended_by for part in parts]),
            np.concatenate([part.levitated_s for part in parts]),
            State(*(np.concatenate(same) for same in vectors)),
            np.concatenate([part.changes for part in parts]),
            np.concatenate([part.left_plate_table for part in parts]),
        )

    def __repr__(self) -> str:
        counts = ", ".join(f"{np.sum(self.ended_by == end)} by {end}" for end in np.unique(self.ended_by))
        left = int(np.sum(self.left_plate_table))
        beyond = f"; {left} left the range of the plate's table" if left else ""
        return f"Endings of {len(self.ended_by)} flights: {counts}{beyond}"


def ensemble(
    scene: Scene,
    table: FieldTable,
    starts: State,
    duration: float,
    mapped: Callable[[Callable[[State], Endings], Iterable[State]], Iterable[Any]] = map,
    together: int = 512,
) -> Endings:
    """Fly a scene's floater from many starts for `duration` (s) each, or until contact or loss.

    A plate is an obstacle only: its currents are not modelled.  A flight's numbers are the same to the last bit
    whichever flights fly beside it, in one worker or in many, where BLAS has one thread (the default).

    Parameters
    ----------
    scene, table : the problem
    starts : states (n, 3) at t = 0, SI units; the moments are made unit vectors
    mapped : as the built-in `map`; `concurrent.futures.ProcessPoolExecutor(2).map` uses two cores
    together : flights that a worker gets at once

    Accuracy: that of a flight in balls, whose field errs by 1e-6 of its gradient.

    Raises
    ------
    InputError : `duration` is not positive, there is no start, or the floater is no sphere
    IntegrationError : a state became infinite
    """
    scene.floater.must_be("sphere", where="where many fly side by side", instead="Fly them one by one.")
    count = len(starts.position)
    if not duration > 0:
        raise InputError(f"Input duration must be positive; instead received {duration} s.")
    if not count:
        raise InputError("Input starts must have one state at least; instead received none.")
    pieces = [slice(first, first + together) for first in range(0, count, together)]
    parts = mapped(partial(_ended, scene, table, duration), [State(*(v[p] for v in starts.vectors)) for p in pieces])
    return Endings.joined(list(parts))


def fly_together(
    scenes: Sequence[Scene], table: FieldTable, starts: Sequence[State], duration: float
) -> list[Trajectory | None]:
    """Flights of scenes whose equations are the same but for runtime parameters, from one start each, with samples.

    Each is what `simulate` gives without a plate's currents, but for round-off; None where the start is in contact.

    Raises
    ------
    IntegrationError : a state became infinite
    """
    known: dict[str, LocalFlight] = {}
    flights = []
    began = perf_counter()
    for scene, start in zip(scenes, starts, strict=True):
        key = startless_text(scene)
        if key not in known:
            known[key] = _local_flight(scene, table, duration)
        flights.append(Flying.begun(known[key], start, duration, True))
    _fly_all(flights)
    speed = sum(f.seconds for f in flights) / (perf_counter() - began)
    return [None if f.recorder is None else f.trajectory(speed) for f in flights]


def _local_flight(scene: Scene, table: FieldTable, duration: float) -> LocalFlight:
    """What flies in balls, without a plate's currents."""
    return LocalFlight(scene, table, Parts(scene, table, duration, TOLERANCE, True, None))


def _fly_all(flights: Sequence[Flying]) -> None:
    """In lanes, in small balls first, then in large ones; at last one by one near bodies, and where it is too fast."""
    for formula in (SMALL, LARGE):
        here = [f for f in flights if not f.over and f.degree == formula.degree]
        if here:
            Lanes(here[0].flight, formula).fly(here)
    for flight in flights:
        if not flight.over:
            flight.alone()


def _ended(scene: Scene, table: FieldTable, duration: float, starts: State) -> Endings:
    flight = _local_flight(scene, table, duration)
    count = len(starts.position)
    flights = [Flying.begun(flight, State(*(v[k] for v in starts.vectors)), duration, False) for k in range(count)]
    _fly_all(flights)
    return Endings(
        np.array([f.log.ended_by for f in flights]),
        np.minimum([f.seconds for f in flights], duration),
        flight.scales.unpack(np.array([f.state[:12] for f in flights])),
        np.array([f.log.changes.count for f in flights]),
        np.zeros(count, bool),
    )
