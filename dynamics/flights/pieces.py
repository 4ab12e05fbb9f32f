"""A flight's next piece, to its end or to what ends it; what was recorded of all of them as a trajectory; the ledger.

The ledger of a flight is J - work, which never changes, and |m̂| = 1.
"""

from dataclasses import dataclass, field

import heyoka as hy
import numpy as np

from ...geometry.basics import Array, ComputationError
from ...geometry.scenes import Scene
from ..motion import BEYOND, CONTACT, LOST, Parameter, Scales, clearance, plate_places
from .ball_parts import LEFT
from .checkpoint import Progress
from .compiled_flight import Flight
from .recorder import Recorder
from .trajectory import DURATION, FieldChanges, Trajectory

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
