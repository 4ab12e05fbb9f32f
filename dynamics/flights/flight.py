"""From a scene to a flight: where it starts, and the flight itself."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array, InputError
from ...geometry.scenes import AbsoluteStart, Scene
from ..branches import way_out
from ..equilibria import find_equilibria
from ..motion import Parameter, PlateForce, PlateMemory, Scales, State, clearance, parameters, plate_depth
from ..steady import Equilibrium, EquilibriumError
from .checkpoint import Checkpoint
from .compiled_flight import TOLERANCE
from .integration import integrate
from .local_flight import compile_local_flight
from .trajectory import Trajectory

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
