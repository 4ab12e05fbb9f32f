"""Integration of the motion by Taylor's method, to round-off.

A. Jorba and M. Zou, Exp. Math. 14 (2005) 99; heyoka: F. Biscani and D. Izzo, MNRAS 504 (2021) 2614.
"""

from collections.abc import Callable
from time import perf_counter

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import BEYOND, Parameter, PlateMemory, State, lost_distance, plate_depth, plate_legs
from .ball_parts import LEFT
from .checkpoint import Checkpoint, Progress
from .compiled_flight import Flight
from .local_flight import LocalFlight
from .pieces import MOST_SAMPLES, Log, booked, first_interval, flown, fly_piece, ledger_scale
from .recorder import Recorder
from .trajectory import DURATION, STOPPED, FieldChanges, FlightStopped, Trajectory


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
    scales, log, began, compiled = flight.scales, Log(), perf_counter(), flight.compile_seconds
    values = begun(flight, start, np.zeros(0) if currents is None else currents, log)
    interval = first_interval(scene, duration)
    at_first = flight.part(values).integrator.state
    first = booked(scene, flight.part(values), values, np.zeros(1), at_first[None])
    scale = ledger_scale(scene, flight.part(values), values, at_first)
    recorder = Recorder(first[0], interval, MOST_SAMPLES)
    known = checkpoint.read() if checkpoint else None
    if known is not None:
        values, log.steps, log.changes = known.restore(flight, recorder)
    began_at = recorder.times[-1]
    if known is None and not in_plate_range(flight.part(values).memory, start):
        log.ended_by = BEYOND  # no event tells of a range in which it never was
        return flown(scene, recorder, log, duration, scale, 0.0, flight.compile_seconds)
    try:
        fly(scene, flight, values, duration, recorder, log, progress, checkpoint)
    except KeyboardInterrupt:
        log.ended_by = STOPPED
        if checkpoint and log.latest:
            checkpoint.write(log.latest)
    seconds = perf_counter() - began - (flight.compile_seconds - compiled)
    speed = float((recorder.times[-1] - began_at) * scales.time / seconds)
    found = flown(scene, recorder, log, duration, scale, speed, flight.compile_seconds)
    if log.ended_by == STOPPED:
        raise FlightStopped(found)
    return found


def in_plate_range(memory: PlateMemory | None, lab: State, time: float = 0.0) -> bool:
    """Whether a plate's table, if there is one, knows the field at a place along the laboratory's axes at a time, s."""
    if memory is None:
        return True
    seen = lab.position + plate_depth(memory.plate, np.array([time])) * [0.0, 0.0, 1.0]
    return bool(memory.table.in_range(memory.plate.box.to_body(seen))[0])


def begun(flight: Flight | LocalFlight, start: State, currents: Array, log: Log) -> Array:
    """Set the integrator to the start; the runtime parameters with the distance at which the floater is lost."""
    values = flight.values.copy()
    values[Parameter.LOST_DISTANCE] = lost_distance(start.position) / flight.scales.length
    log.changes = FieldChanges(error=flight.enter(start, values))
    flight.part(values).take(0.0, flight.state(start, currents))
    return values


def fly(
    scene: Scene,
    flight: Flight | LocalFlight,
    values: Array,
    duration: float,
    recorder: Recorder,
    log: Log,
    progress: Callable[[float], None] | None,
    checkpoint: Checkpoint | None,
) -> None:
    """Propagate in pieces until something ends the flight."""
    scales, kept = flight.scales, perf_counter()
    for end, depth, speed in plate_legs(scene.plate, duration):
        if flight.part(values).integrator.time >= end / scales.time:
            continue
        log.changes = flight.leg(values, depth / scales.length, speed * scales.time / scales.length, log.changes)
        while flight.part(values).integrator.time < end / scales.time:
            log.changes = flight.onward(values, log.changes)
            times, states = fly_piece(scene, flight.part(values), values, end / scales.time, recorder, log)
            over = log.ended_by not in (DURATION, LEFT) or times[-1] * scales.time >= duration * (1 - 1e-12)
            recorder.add(times[1:], states[1:], over)
            if checkpoint:
                log.latest = Progress.of(flight.part(values), values, recorder, log.steps, log.changes)
            if progress is not None:
                progress(min(1.0, times[-1] * scales.time / duration))
            if over:
                return
            if checkpoint and log.latest and perf_counter() - kept > checkpoint.every:
                checkpoint.write(log.latest)
                kept = perf_counter()


def fly_on(
    scene: Scene,
    flight: Flight | LocalFlight,
    values: Array,
    time: float,
    state: Array,
    duration: float,
    recorder: Recorder,
    log: Log,
) -> None:
    """Fly from a scaled time and state, with all of a plate's, on until `duration` (s) after t = 0.

    The runtime parameters `values`, the samples and the log go on as well.
    """
    flight.part(values).take(time, state)
    fly(scene, flight, values, duration, recorder, log, None, None)
