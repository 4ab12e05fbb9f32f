"""Integration of the motion by Taylor's method, to round-off.

A. Jorba and M. Zou, Exp. Math. 14 (2005) 99; heyoka: F. Biscani and D. Izzo, MNRAS 504 (2021) 2614.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

import heyoka as hy
import numpy as np

from ...geometry.basics import Array, ComputationError
from ...geometry.scenes import Scene
from ..motion import CONTACT, Parameter, State, clearance, plate_legs, plate_places
from .checkpoint import Checkpoint, Progress
from .compiled_flight import Flight
from .local_flight import LEFT, LocalFlight
from .recorder import Recorder
from .trajectory import DURATION, STOPPED, FieldChanges, FlightStopped, Trajectory

PIECE_TURNS, PIECE_SAMPLES = 256, 256
"""The most turns and samples between two looks at what has been flown.

A step ends where a piece does, so that pieces must not depend on how fast the machine is.
"""
CHECKPOINT_SECONDS = 5.0
"""Wall time between two checkpoints."""
MOST_SAMPLES = 20000
SAMPLES_PER_TURN = 32


class IntegrationError(ComputationError):
    """The motion could not be integrated."""


@dataclass
class _Log:
    """What is known of a flight while it lasts."""

    ended_by: str = DURATION
    steps: int = 0
    latest: Progress | None = None
    changes: FieldChanges = field(default_factory=FieldChanges)


def integrate(
    scene: Scene,
    flight: Flight | LocalFlight,
    start: State,
    duration: float,
    progress: Callable[[float], None] | None = None,
    currents: Array | None = None,
    checkpoint: Checkpoint | None = None,
) -> Trajectory:
    """Fly from `start` (rotor's frame, t = 0) until `duration` (s), contact or loss.

    Parameters
    ----------
    scene, flight : the problem and its compiled form
    progress : called with the finished part, 0 to 1, a few times a second
    currents : states of the plate at the start, √J, if the flight has a plate's memory
    checkpoint : where the flight is kept while it lasts; it goes on from there if there is something. Remove it when
        the trajectory is safe.

    Accuracy: a step errs by round-off, so that energy and |m̂| drift by about 1e-14 in a thousand turns;
    `Trajectory.energy_error` tells.

    Raises
    ------
    FlightStopped : by a keyboard interrupt; it has what is finished, and so has the checkpoint
    IntegrationError : the state became infinite
    """
    scales, log, began = flight.scales, _Log(), perf_counter()
    values = _begin(flight, start, np.zeros(0) if currents is None else currents, log)
    turn = 1 / abs(scene.frequency) if scene.frequency else np.inf
    interval = min(turn / SAMPLES_PER_TURN, duration / 1000) / scales.time
    first = _booked(scene, flight.part(values), values, np.zeros(1), flight.part(values).integrator.state[None])
    scale = _scale(scene, flight.part(values), values)
    recorder = Recorder(first[0], interval, MOST_SAMPLES)
    known = checkpoint.read() if checkpoint else None
    if known is not None:
        values, log.steps, log.changes = known.restore(flight, recorder)
    began_at, compiled = recorder.times[-1], flight.compile_seconds
    try:
        _fly(scene, flight, values, duration, recorder, log, progress, checkpoint)
    except KeyboardInterrupt:
        log.ended_by = STOPPED
        if checkpoint and log.latest:
            checkpoint.write(log.latest)
    seconds = perf_counter() - began - (flight.compile_seconds - compiled)
    time = np.minimum(recorder.times * scales.time, duration)
    flown = Trajectory(
        time=time,
        lab=scales.unpack(recorder.states).to_lab(scene.angular_velocity * time),
        angular_velocity=scene.angular_velocity,
        ended_by=log.ended_by,
        energy_error=_violation(recorder.states, scale),
        realtime_factor=float((recorder.times[-1] - began_at) * scales.time / seconds),
        steps=log.steps,
        compile_seconds=flight.compile_seconds,
        field_changes=log.changes.relative(scale),
    )
    if log.ended_by == STOPPED:
        raise FlightStopped(flown)
    return flown


def _begin(flight: Flight | LocalFlight, start: State, currents: Array, log: _Log) -> Array:
    """Set the integrator to the start; the runtime parameters with the distance at which the floater is lost."""
    values = flight.values.copy()
    values[Parameter.LOST_DISTANCE] = max(0.1, 2 * float(np.linalg.norm(start.position))) / flight.scales.length
    log.changes = FieldChanges(error=flight.enter(start, values))
    integrator = flight.part(values).integrator
    integrator.time = 0.0
    integrator.state[:] = flight.state(start, currents)
    integrator.reset_cooldowns()
    return values


def _booked(scene: Scene, flight: Flight, values: Array, times: Array, states: Array) -> Array:
    """States whose last is the ledger's sum, at scaled times."""
    needed = values[: max(len(Parameter), flight.ledger.nparams)]
    return flight.books(times, states, plate_places(scene, needed, times))


def _scale(scene: Scene, flight: Flight, values: Array) -> float:
    """Of the ledger, at the start: its sum, or its largest term where the terms nearly cancel."""
    start = np.zeros(1)
    terms = flight.terms(start, flight.integrator.state[None], plate_places(scene, values, start))
    largest, whole = float(np.abs(terms).max()), abs(float(terms.sum()))
    return whole if whole > 1e-3 * largest else largest


def _violation(states: Array, scale: float) -> float:
    """Largest relative violation of J - work = constant or of |m̂| = 1."""
    length = np.linalg.norm(states[:, 6:9], axis=1)
    return float(max(np.abs(states[:, -1] - states[0, -1]).max() / scale, np.abs(length - 1).max()))


def _fly(
    scene: Scene,
    flight: Flight | LocalFlight,
    values: Array,
    duration: float,
    recorder: Recorder,
    log: _Log,
    progress: Callable[[float], None] | None,
    checkpoint: Checkpoint | None,
) -> None:
    """Propagate in pieces until something ends the flight."""
    scales, kept = flight.scales, perf_counter()
    for end, depth, speed in plate_legs(scene.plate, duration):
        values[Parameter.PLATE_DEPTH] = depth / scales.length
        values[Parameter.PLATE_SPEED] = speed * scales.time / scales.length
        while flight.part(values).integrator.time < end / scales.time:
            log.changes = flight.onward(values, log.changes)
            times, states = _piece(scene, flight.part(values), values, end / scales.time, recorder, log)
            over = log.ended_by not in (DURATION, LEFT) or times[-1] * scales.time >= duration * (1 - 1e-12)
            recorder.add(times[1:], states[1:], over)
            if checkpoint:
                log.latest = Progress.of(flight.part(values), values, recorder, log.steps, log.changes)
            if progress is not None:
                progress(min(1.0, times[-1] * scales.time / duration))
            if over:
                return
            if checkpoint and log.latest and perf_counter() - kept > CHECKPOINT_SECONDS:
                checkpoint.write(log.latest)
                kept = perf_counter()


def _piece(
    scene: Scene, flight: Flight, values: Array, end: float, recorder: Recorder, log: _Log
) -> tuple[Array, Array]:
    """Fly on to the end of a piece or to an event: scaled times and states, of which the last is the ledger's sum."""
    flight.integrator.pars[:] = values[: len(flight.integrator.pars)]
    count = int(np.clip(PIECE_TURNS * 2 * np.pi / recorder.interval, 1, PIECE_SAMPLES))
    grid = recorder.grid(flight.integrator.time, end, count)
    outcome, _, _, steps, _, states = flight.integrator.propagate_grid(grid)
    times, states, log.ended_by = _ending(scene, flight, outcome, grid, states)
    log.steps += steps
    return times, _booked(scene, flight, values, times, states)


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
    if flight.meanings == [LEFT]:
        return times, states, ended_by
    gap = clearance(scene, times * flight.scales.time, states[:, :3] * flight.scales.length)
    touching = np.flatnonzero(gap < -1e-9)
    if len(touching):
        return times[: touching[0] + 1], states[: touching[0] + 1], CONTACT
    return times, states, ended_by
