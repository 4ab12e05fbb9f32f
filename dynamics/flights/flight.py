"""Integration of the motion by Taylor's method, to round-off.

A. Jorba and M. Zou, Exp. Math. 14 (2005) 99; heyoka: F. Biscani and D. Izzo, MNRAS 504 (2021) 2614.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import AbsoluteStart, Scene
from ..continuation.frequencies import way_out
from ..equilibria.equilibrium import Equilibrium, EquilibriumError
from ..equilibria.search import find_equilibria
from ..motion.equations import parameters
from ..motion.events import BEYOND, clearance, lost_distance, plate_depth, plate_legs
from ..motion.plate import PlateForce, PlateMemory
from ..motion.state import Parameter, Scales, State
from .balls import LEFT, LocalFlight, compile_local_flight
from .compiled import TOLERANCE, Flight
from .pieces import MOST_SAMPLES, Checkpoint, Log, Progress, booked, first_interval, flown, fly_piece, ledger_scale
from .trajectory import DURATION, STOPPED, FieldChanges, FlightStopped, Recorder, Trajectory


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


PLATE_TOLERANCE = 1e-13
"""Of a Taylor step with a plate, whose table is known to 1e-4 at best."""
SLOWLY = 1 / 3
"""Growth (1/s) with which a flight may still begin: an e-fold in the shortest flight that counts, 3 s."""


class StartError(InputError):
    """The flight cannot begin where it was asked to."""


def simulate(
    scene: Scene,
    table: FieldTable,
    duration: float,
    equilibria: Sequence[Equilibrium] | None = None,
    tolerance: float = TOLERANCE,
    compact: bool | None = None,
    progress: Callable[[float], None] | None = None,
    memory: PlateMemory | None = None,
    checkpoint: Checkpoint | None = None,
) -> Trajectory:
    """Simulate the flight of a scene's floater for `duration` (s), or until contact or loss.

    Parameters
    ----------
    equilibria : of this scene, if they are already known
    tolerance, compact : see `compile_local_flight`
    progress : called with the finished part, 0 to 1, a few times a second
    memory : the plate's currents; left out, the plate is only an obstacle
    checkpoint : where the flight is kept while it lasts; it goes on from there if there is something

    Raises
    ------
    EquilibriumError : the flight shall begin near a stable equilibrium and there is none
    StartError : it would begin in contact, or `duration` is not positive
    FlightStopped : by a keyboard interrupt; it has what is finished
    """
    if not duration > 0:
        raise StartError(f"Input duration must be positive; instead received {duration} s.")
    start, currents = initial_state(scene, table, equilibria, memory)
    if memory is not None:
        tolerance = max(tolerance, PLATE_TOLERANCE)
    flight = compile_local_flight(scene, table, duration, tolerance, compact, memory)
    flown = integrate(scene, flight, start, duration, progress, currents, checkpoint)
    return flown if memory is None else replace(flown, beyond_plate_table=_beyond(memory, flown))


def _beyond(memory: PlateMemory, flown: Trajectory) -> float:
    """Part of the samples at which the floater is out of the range of the plate's table."""
    seen = flown.lab.position + plate_depth(memory.plate, flown.time)[:, None] * [0.0, 0.0, 1.0]
    return float(1 - np.mean(memory.table.in_range(memory.plate.box.to_body(seen))))


def initial_state(
    scene: Scene,
    table: FieldTable,
    equilibria: Sequence[Equilibrium] | None = None,
    memory: PlateMemory | None = None,
) -> tuple[State, Array]:
    """State at t = 0, when the rotor's frame is the laboratory's, and the plate's states (k,), √J.

    An `OffsetStart` displaces the stable equilibrium in the rotor's frame and keeps the floater at rest in it; among
    several it takes the nearest; where there is none, what `starting_point` says.  An absolute start finds the plate as
    if the floater had long turned with the rotor there.  `equilibria` are found if they are not given.

    Raises
    ------
    EquilibriumError : no equilibrium to start from; it says why and which frequency has one
    StartError : the floater would overlap a magnet or the plate
    """
    currents = np.zeros(0)
    if isinstance(scene.start, AbsoluteStart):
        start = scene.start
        state = State(start.position, start.velocity, start.moment / np.linalg.norm(start.moment), start.spin)
        if memory is not None:
            scales = Scales.of(scene)
            plate = PlateForce(memory, parameters(scene, scales))
            currents = plate.settled(scales.pack(state)) / plate.values[Parameter.PLATE_SHARE]
    else:
        known = find_equilibria(scene, table, memory=memory) if equilibria is None else equilibria
        chosen = starting_point(known)
        if chosen is None:
            raise EquilibriumError(way_out(scene, table, known, memory=memory))
        state = displaced(chosen.start, scene.start.offset, scene.angular_velocity)
        currents = currents if chosen.currents is None else chosen.currents[0]
    check_free("start", scene, state.position, moment=state.moment)
    return state, currents


def check_free(name: str, scene: Scene, position: Array, time: float = 0.0, moment: Array | None = None) -> None:
    """Raises StartError where a floater at a position (3,) m, rotor's frame, would overlap a body at a time (s)."""
    pointing = None if moment is None else moment[None]
    gap = float(clearance(scene, np.array([time]), position[None], pointing)[0])
    if gap < 0:
        where = ", ".join(f"{1e3 * c:.6g}" for c in position)
        raise StartError(
            f"Input {name} must leave the floater free of the magnets and the plate; instead it begins at ({where}) "
            f"mm, {-1e3 * gap:.3g} mm inside one of them. Move the plate or the {name}."
        )


def starting_point(equilibria: Sequence[Equilibrium]) -> Equilibrium | None:
    """The nearest stable equilibrium, or else the nearest that only the plate, or only slowly something, undoes.

    The floater's own eddy currents do so slowly, in minutes.
    """
    stable = [e for e in equilibria if e.stable]
    without = [e for e in equilibria if e.without and e.without.stable]
    slowly = [e for e in equilibria if e.growth_per_s < SLOWLY]
    return next(iter([*stable, *without, *slowly]), None)


def most_like_levitation(equilibria: Sequence[Equilibrium]) -> Equilibrium | None:
    """Where a flight begins, or, where none may, the equilibrium whose small motions grow least; None without any.

    A brake undoes those near the rotor the most.
    """
    return starting_point(equilibria) or min(equilibria, key=lambda e: e.growth_per_s, default=None)


def displaced(start: State, offset: Array, angular_velocity: float) -> State:
    """A state moved by one or more offsets (..., 3) m, as much at rest in the frame that turns (rad/s) as it was."""
    turning = np.cross([0.0, 0.0, angular_velocity], offset)
    moment, spin = (np.broadcast_to(v, offset.shape) for v in (start.moment, start.spin))
    return State(start.position + offset, start.velocity + turning, moment, spin)
