"""A trajectory that goes on piece by piece, and whose floater can be pushed and put elsewhere on the way."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import Scene
from ..equilibria.equilibrium import Equilibrium
from ..motion.plate import PlateMemory
from ..motion.state import State, turned_about_z
from .flight import Flight, StartError, check_free, initial_state
from .trajectory import DURATION, Recorder

FEWEST, MOST, A_SECOND = 8, 256, 400  # Samples of a piece at least and at most, and between that so many a second


@dataclass(frozen=True, eq=False)
class Piece:
    """Samples of a piece of a trajectory."""

    time: Array  # (n,) s
    lab: State  # motion (n, 3) along the laboratory's axes, SI units
    angle: float  # of the rotor at the last sample, rad
    # "duration" where the trajectory can go on, else "contact", "lost", or "beyond" the range of the plate's table
    ended_by: str


class LiveFlight:
    """A trajectory of a scene's floater, with the plate's currents if they are modelled.

    `equilibria` are those of the scene, and `memory` is None where the plate is only an obstacle. Raises
    EquilibriumError: it shall begin near a stable equilibrium and there is none; StartError: it would begin in contact,
    or where the plate's table does not reach.
    """

    def __init__(
        self, scene: Scene, table: FieldTable, equilibria: Sequence[Equilibrium], memory: PlateMemory | None = None
    ) -> None:
        if scene.moving:
            raise InputError("Input drive must have no center_mm and no axis in live motion; instead it has.")
        start, currents = initial_state(scene, table, equilibria, memory)
        self.scene = scene
        flight = Flight(scene, table, np.inf, tolerance=None, compact=True, memory=memory)
        self._course = flight.begin(start, np.inf, currents, offset=flight.offset)
        flight.part(flight.degree(self._course.values))  # compiled now, so that the first piece is not late
        self._check_range(self.now.position)

    @property
    def time(self) -> float:
        return self._course.seconds

    @property
    def ended_by(self) -> str:
        return self._course.ended_by

    @property
    def now(self) -> State:
        """Motion along the laboratory's axes, SI units."""
        return self._course.flight.scales.unpack(self._course.state).to_lab(self.scene.angle(self.time))

    def onward(self, seconds: float) -> Piece:
        """Integrate on so long (s), or to contact or loss. Raises InputError (not positive), IntegrationError."""
        if not seconds > 0:
            raise InputError(f"Input seconds must be positive; instead received {seconds}.")
        course, unit = self._course, self._course.flight.scales.time
        times, states = np.array([course.time[0]]), course.state[None]
        if course.ended_by == DURATION:
            interval = seconds / int(np.clip(A_SECOND * seconds, FEWEST, MOST)) / unit
            first = course.flight.balanced(course.values, times, states)[0]
            course.recorder = Recorder(first, interval, 4 * MOST, course.time[0])
            course.duration = self.time + seconds
            course.fly()
            times, states = course.recorder.times[1:], course.recorder.states[1:]
            course.time = float(times[-1]), 0.0
        turned = self.scene.angle(times * unit)
        lab = course.flight.scales.unpack(states).to_lab(turned)
        return Piece(times * unit, lab, float(turned[-1]), course.ended_by)

    def push(self, velocity: Array) -> None:
        """Add a velocity (3,) m/s, along the laboratory's axes, as a blow does."""
        self._become(replace(self.now, velocity=self.now.velocity + velocity))

    def put(self, position: Array) -> None:
        """Put the floater at a position (3,) m, rotor's frame, at rest there, and release it; moment and spin stay.

        Raises StartError: it would overlap a magnet or the plate, or the field of the plate's currents is not known
        there; nothing is changed.
        """
        angle = self.scene.angle(self.time)
        check_free("position", self.scene, np.asarray(position, float), self.time, self.now.to_rotor(angle).orientation)
        place = turned_about_z(position, angle)
        self._check_range(place)
        turning = np.cross([0.0, 0.0, float(self.scene.rate(self.time))], place)
        self._course.ended_by = DURATION
        self._become(replace(self.now, position=place, velocity=turning))

    def _check_range(self, place: Array) -> None:
        memory = self._course.flight.memory
        if memory and not memory.in_range(place[None], self.time)[0]:
            where = ", ".join(f"{1e3 * c:.4g}" for c in place)
            raise StartError(
                f"Input position must be where the field of the plate's currents was computed; instead received "
                f"({where}) mm. Put it nearer to where it began, choose no plate model, or begin there: "
                "start.position_mm."
            )

    def _become(self, lab: State) -> None:
        state, course = lab.to_rotor(self.scene.angle(self.time)), self._course
        own = course.flight.own_states(state)
        course.state[: len(own)] = own
        self._course.enter_ball()
