"""One of many flights, where it is now."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...geometry.basics import Array
from ..flights import (
    DEGREE,
    MOST_SAMPLES,
    FieldChanges,
    LocalFlight,
    Log,
    Recorder,
    Trajectory,
    booked,
    first_interval,
    flown,
    fly_on,
    ledger_scale,
)
from ..motion import CONTACT, Parameter, State, clearance, lost_distance


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
