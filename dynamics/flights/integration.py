"""Integration of the motion by Taylor's method, to round-off.

A. Jorba and M. Zou, Exp. Math. 14 (2005) 99; heyoka: F. Biscani and D. Izzo, MNRAS 504 (2021) 2614.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import heyoka as hy
import numpy as np

from ...geometry.basics import Array, ComputationError
from ...geometry.scenes import Scene
from ..motion import CONTACT, Parameter, State, clearance, plate_legs, plate_places
from .checkpoint import Checkpoint, Progress
from .compiled_flight import Flight
from .recorder import Recorder
from .trajectory import DURATION, STOPPED, FlightStopped, Trajectory

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


def integrate(
    scene: Scene,
    flight: Flight,
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
    scales = flight.scales
    values = _begin(flight, start, np.zeros(0) if currents is None else currents)
    turn = 1 / abs(scene.frequency) if scene.frequency else np.inf
    interval = min(turn / SAMPLES_PER_TURN, duration / 1000) / scales.time
    recorder, log, began = Recorder(flight.integrator.state, interval, MOST_SAMPLES), _Log(), perf_counter()
    known = checkpoint.read() if checkpoint else None
    if known is not None:
        values, log.steps = known.restore(flight, recorder)
    first = recorder.times[-1]
    try:
        _fly(scene, flight, values, duration, recorder, log, progress, checkpoint)
    except KeyboardInterrupt:
        log.ended_by = STOPPED
        if checkpoint and log.latest:
            checkpoint.write(log.latest)
    seconds = perf_counter() - began
    time = np.minimum(recorder.times * scales.time, duration)
    flown = Trajectory(
        time=time,
        lab=scales.unpack(recorder.states).to_lab(scene.angular_velocity * time),
        angular_velocity=scene.angular_velocity,
        ended_by=log.ended_by,
        energy_error=flight.energy_error(recorder.times, recorder.states, plate_places(scene, values, recorder.times)),
        realtime_factor=float((recorder.times[-1] - first) * scales.time / seconds),
        steps=log.steps,
        compile_seconds=flight.compile_seconds,
    )
    if log.ended_by == STOPPED:
        raise FlightStopped(flown)
    return flown


def _begin(flight: Flight, start: State, currents: Array) -> Array:
    """Set the integrator to the start; the runtime parameters with the distance at which the floater is lost."""
    flight.integrator.time = 0.0
    values = flight.values.copy()
    flight.integrator.state[:] = flight.state(start, currents)
    flight.integrator.reset_cooldowns()
    values[Parameter.LOST_DISTANCE] = max(0.1, 2 * float(np.linalg.norm(start.position))) / flight.scales.length
    return values


def _fly(
    scene: Scene,
    flight: Flight,
    values: Array,
    duration: float,
    recorder: Recorder,
    log: _Log,
    progress: Callable[[float], None] | None,
    checkpoint: Checkpoint | None,
) -> None:
    """Propagate in pieces until something ends the flight."""
    integrator, scales, kept = flight.integrator, flight.scales, perf_counter()
    for end, depth, speed in plate_legs(scene.plate, duration):
        values[Parameter.PLATE_DEPTH] = depth / scales.length
        values[Parameter.PLATE_SPEED] = speed * scales.time / scales.length
        integrator.pars[:] = values[: len(integrator.pars)]
        while integrator.time < end / scales.time:
            count = int(np.clip(PIECE_TURNS * 2 * np.pi / recorder.interval, 1, PIECE_SAMPLES))
            grid = recorder.grid(integrator.time, end / scales.time, count)
            outcome, _, _, steps, _, states = integrator.propagate_grid(grid)
            times, states, log.ended_by = _ending(scene, flight, outcome, grid, states)
            log.steps += steps
            over = log.ended_by != DURATION or times[-1] * scales.time >= duration * (1 - 1e-12)
            recorder.add(times[1:], states[1:], over)
            if checkpoint:
                log.latest = Progress.of(flight, values, recorder, log.steps)
            if progress is not None:
                progress(min(1.0, times[-1] * scales.time / duration))
            if over:
                return
            if checkpoint and log.latest and perf_counter() - kept > CHECKPOINT_SECONDS:
                checkpoint.write(log.latest)
                kept = perf_counter()


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
    gap = clearance(scene, times * flight.scales.time, states[:, :3] * flight.scales.length)
    touching = np.flatnonzero(gap < -1e-9)
    if len(touching):
        return times[: touching[0] + 1], states[: touching[0] + 1], CONTACT
    return times, states, ended_by
