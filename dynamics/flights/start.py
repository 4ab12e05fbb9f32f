"""Where a trajectory begins."""

from collections.abc import Sequence

import numpy as np

from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import AbsoluteStart, Scene
from ..continuation.frequencies import way_out
from ..equilibria.equilibrium import Equilibrium, EquilibriumError
from ..equilibria.search import find_equilibria
from ..motion.equations import parameters
from ..motion.events import clearance, plate_depth
from ..motion.plate import PlateForce, PlateMemory
from ..motion.state import Parameter, Scales, State

SLOWLY = 1 / 3  # Growth (1/s) with which a flight may still begin: an e-fold in the shortest flight that counts, 3 s


class StartError(InputError):
    """The flight cannot begin where it was asked to."""


def initial_state(
    scene: Scene, table: FieldTable, equilibria: Sequence[Equilibrium] | None = None, memory: PlateMemory | None = None
) -> tuple[State, Array]:
    """State at t = 0, when the rotor's frame is the laboratory's, and the plate's states (k,), √J.

    An `OffsetStart` displaces the stable equilibrium in the rotor's frame and keeps the floater at rest in it; among
    several it takes the nearest; where there is none, what `starting_point` says.  An absolute start finds the plate as
    if the floater had long turned with the rotor there.  `equilibria` are found if they are not given. Raises
    EquilibriumError: no equilibrium to start from; it says why and which frequency has one; StartError: the floater
    would overlap a magnet or the plate.
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


def in_plate_range(memory: PlateMemory | None, lab: State, time: float = 0.0) -> bool:
    """Whether a plate's table, if there is one, knows the field at a place along the laboratory's axes at a time, s."""
    return memory is None or bool(memory.in_range(lab.position, plate_depth(memory.plate, np.array([time])))[0])
