"""A long flight kept on disk while it lasts, so that it can go on where it was stopped, to the last bit.

What determines the rest of a flight is the integrator's state at the end of a piece, its time (two numbers, so that
it loses nothing over millions of turns) and what has been recorded.
"""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
import zlib
from dataclasses import astuple, dataclass, field
from pathlib import Path

import heyoka as hy
import numpy as np

from ...fem.files import write_whole
from ...geometry.common import Array, ComputationError, InputError
from ...geometry.files import regular_file
from ...geometry.scene.contents import Scene
from ..motion.events import BEYOND, CONTACT, LOST, clearance, plate_places
from ..motion.state import Parameter, Scales
from .balls import LEFT, LocalFlight
from .compiled import Flight
from .trajectory import DURATION, FieldChanges, Recorder, Trajectory

MOST = 2_000_000_000
"""Bytes of a checkpoint."""
BROKEN = (OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError, MemoryError)
"""What damage to a file of arrays is told by; its header may say any size."""


@dataclass(frozen=True, eq=False)
class Progress:
    """How far a flight is.

    Parameters
    ----------
    time : (2,) scaled time as a sum of two numbers
    state : of the integrator
    values : runtime parameters
    times, states : samples so far
    interval : of the samples
    steps : Taylor steps so far
    changes : (4,) numbers of `FieldChanges` so far, energies scaled
    region : (2, 3) bounds of the plate's table, m, in the plate's frame; zeros without one
    """

    time: Array
    state: Array
    values: Array
    times: Array
    states: Array
    interval: float
    steps: int
    changes: Array
    region: Array

    @classmethod
    def of(cls, flight: Flight, values: Array, recorder: Recorder, steps: int, changes: FieldChanges) -> Progress:
        """Where a flight is now."""
        integrator, known = flight.integrator, flight.memory
        region = np.zeros((2, 3)) if known is None else np.array([known.table.region.lower, known.table.region.upper])
        return cls(
            np.array(integrator.dtime), integrator.state.copy(), values.copy(),
            recorder.times.copy(), recorder.states.copy(), recorder.interval, steps, np.array(astuple(changes)),
            region,
        )  # fmt: skip

    def restore(self, flight: Flight | LocalFlight, recorder: Recorder) -> tuple[Array, int, FieldChanges]:
        """Put everything back to where it was; the runtime parameters, the steps and the changes so far."""
        integrator = flight.part(self.values).integrator
        integrator.dtime = (float(self.time[0]), float(self.time[1]))
        integrator.state[:] = self.state
        integrator.reset_cooldowns()
        recorder.put(self.times, self.states)
        recorder.interval = self.interval
        count, *rest = self.changes.tolist()
        return self.values.copy(), self.steps, FieldChanges(int(count), *rest)


@dataclass(frozen=True)
class Checkpoint:
    """The file of a flight.

    Parameters
    ----------
    path : where it is
    identity : everything that the flight depends on, as text; another flight's checkpoint is refused
    every : seconds between two writings
    """

    path: Path
    identity: str
    every: float = 5.0

    @property
    def _key(self) -> str:
        return hashlib.sha256(self.identity.encode()).hexdigest()

    def write(self, progress: Progress) -> None:
        """Keep the progress; the file is whole or as it was."""
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, key=np.array(self._key), **vars(progress))
        write_whole(self.path, stream.getvalue())

    def read(self) -> Progress | None:
        """What was kept, or None if there is nothing.

        Raises
        ------
        InputError : the file is damaged, or belongs to another flight
        """
        if not os.path.lexists(self.path):
            return None
        try:
            with regular_file(self.path, MOST, "checkpoint", "a regular file") as stream, np.load(stream) as data:
                content = {name: data[name] for name in data.files}
            key = str(content.pop("key"))
            found = Progress(**{**content, "interval": float(content["interval"]), "steps": int(content["steps"])})
        except InputError:
            raise
        except (*BROKEN, zipfile.BadZipFile, zlib.error) as error:
            raise InputError(f"Input {self.path} must be a checkpoint; instead it is damaged: delete it.") from error
        if key != self._key:
            raise InputError(
                f"Input {self.path} must be a checkpoint of this flight; instead it was kept by another scene, model, "
                "duration or version: delete it, choose another --out, or leave out --resume."
            )
        return found

    def remove(self) -> None:
        """The flight is over."""
        self.path.unlink(missing_ok=True)


PIECE_TURNS, PIECE_SAMPLES = 256, 256
"""The most turns and samples between two looks at what has been flown.

A step ends where a piece does, so that pieces must not depend on how fast the machine is.
"""
MOST_SAMPLES = 20000
SAMPLES_PER_TURN = 32


class IntegrationError(ComputationError):
    """The motion could not be integrated."""


@dataclass
class Log:
    """What is known of a flight while it lasts."""

    ended_by: str = DURATION
    steps: int = 0
    latest: Progress | None = None
    changes: FieldChanges = field(default_factory=FieldChanges)


def fly_piece(
    scene: Scene, flight: Flight, values: Array, end: float, recorder: Recorder, log: Log
) -> tuple[Array, Array]:
    """Fly on to the end of a piece or to an event: scaled times and states, of which the last is the ledger's sum."""
    flight.start(values)
    count = int(np.clip(PIECE_TURNS * 2 * np.pi / recorder.interval, 1, PIECE_SAMPLES))
    grid = recorder.grid(flight.integrator.time, end, count)
    outcome, _, _, steps, _, states = flight.integrator.propagate_grid(grid)
    times, states, log.ended_by = _ending(scene, flight, outcome, grid, states)
    log.steps += steps
    return times, booked(scene, flight, values, times, states)


def _ending(
    scene: Scene, flight: Flight, outcome: hy.taylor_outcome, grid: Array, states: Array
) -> tuple[Array, Array, str]:
    """Times and states of a finished piece up to its end, and what ended it."""
    if outcome == hy.taylor_outcome.err_nf_state:
        raise IntegrationError(
            f"The floater's state became infinite at t = {flight.integrator.time * flight.scales.time:.6g} s. "
            "Look whether the start lies inside a magnet or the table's range is too small."
        )
    times, ended_by = grid[: len(states)], DURATION
    if outcome != hy.taylor_outcome.time_limit:
        times = np.append(times, flight.integrator.time)
        states = np.vstack([states, flight.integrator.state])
        ended_by = flight.meanings[-outcome.value - 1]
    if LEFT in flight.meanings:
        return times, states, ended_by
    gap = clearance(scene, times * flight.scales.time, states[:, :3] * flight.scales.length, states[:, 6:9])
    touching = np.flatnonzero(gap < -1e-9)
    if len(touching):
        return times[: touching[0] + 1], states[: touching[0] + 1], CONTACT
    return times, states, ended_by


def flown(
    scene: Scene, recorder: Recorder, log: Log, duration: float, scale: float, speed: float, compile_seconds: float
) -> Trajectory:
    """The trajectory of samples whose last column is the ledger's sum.

    Parameters
    ----------
    duration : that was asked for, s
    scale : of the ledger
    speed : simulated seconds per second
    compile_seconds : time that compilation took
    """
    scales = Scales.of(scene)
    time = np.minimum(recorder.times * scales.time, duration)
    return Trajectory(
        time=time,
        lab=scales.unpack(recorder.states).to_lab(scene.angular_velocity * time),
        angular_velocity=scene.angular_velocity,
        ended_by=LOST if log.ended_by == BEYOND else log.ended_by,
        energy_error=violation(recorder.states, scale),
        realtime_factor=speed,
        steps=log.steps,
        compile_seconds=compile_seconds,
        left_plate_table=log.ended_by == BEYOND,
        field_changes=log.changes.relative(scale),
    )


def first_interval(scene: Scene, duration: float) -> float:
    """First scaled time between samples."""
    turn = 1 / abs(scene.frequency) if scene.frequency else np.inf
    return float(min(turn / SAMPLES_PER_TURN, duration / 1000) / Scales.of(scene).time)


def booked(scene: Scene, flight: Flight, values: Array, times: Array, states: Array) -> Array:
    """The floater's states (n, 12) at scaled times (n,), and J - work, from the integrator's (n, s)."""
    needed = values if len(flight.numbers) else values[: max(len(Parameter), flight.ledger.nparams)]
    books = flight.terms(times, states, plate_places(scene, needed, times)).sum(axis=0) - states[:, -1]
    return np.concatenate([states[:, :12], books[:, None]], axis=1)


def ledger_scale(scene: Scene, flight: Flight, values: Array, state: Array) -> float:
    """Of the ledger, at the start in a state (s,): its sum, or its largest term where the terms nearly cancel."""
    start = np.zeros(1)
    terms = flight.terms(start, state[None], plate_places(scene, values, start))
    largest, whole = float(np.abs(terms).max()), abs(float(terms.sum()))
    return whole if whole > 1e-3 * largest else largest


def violation(states: Array, scale: float) -> float:
    """Largest relative violation of J - work = constant or of |m̂| = 1 in booked states (n, s)."""
    length = np.linalg.norm(states[:, 6:9], axis=1)
    return float(max(np.abs(states[:, -1] - states[0, -1]).max() / scale, np.abs(length - 1).max()))
