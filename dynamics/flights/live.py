"""A flight that goes on piece by piece, and whose floater can be pushed and put elsewhere on the way."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fem.rotor.table import FieldTable
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import Scene
from ..equilibria.equilibrium import Equilibrium
from ..motion.plate import PlateMemory
from ..motion.state import State, turned_about_z
from .balls import compile_local_flight
from .compiled import TOLERANCE
from .flight import PLATE_TOLERANCE, StartError, begun, check_free, fly_on, in_plate_range, initial_state
from .pieces import Log
from .trajectory import DURATION, Recorder

FEWEST, MOST, A_SECOND = 8, 256, 400
"""Samples of a piece at least and at most, and between that so many a second."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Samples of a piece of a flight.

    Parameters
    ----------
    time : (n,) s
    lab : motion (n, 3) along the laboratory's axes, SI units
    angle : of the rotor at the last sample, rad
    ended_by : "duration" where the flight can go on, else "contact", "lost", or "beyond" the range of the plate's table
    """

    time: Array
    lab: State
    angle: float
    ended_by: str


class LiveFlight:
    """A flight of a scene's floater, with the plate's memory if there is one.

    Parameters
    ----------
    scene, table : the problem
    equilibria : of this scene
    memory : the plate's currents; None where the plate is only an obstacle

    Raises
    ------
    EquilibriumError : it shall begin near a stable equilibrium and there is none
    StartError : it would begin in contact, or where the plate's table does not reach
    """

    def __init__(
        self, scene: Scene, table: FieldTable, equilibria: Sequence[Equilibrium], memory: PlateMemory | None = None
    ) -> None:
        start, currents = initial_state(scene, table, equilibria, memory)
        tolerance = TOLERANCE if memory is None else PLATE_TOLERANCE
        self.scene, self.memory = scene, memory
        self.flight = compile_local_flight(scene, table, np.inf, tolerance, True, memory)
        self.log = Log()
        self.values = begun(self.flight, start, currents, self.log)
        self.state = self.flight.part(self.values).whole
        self.time = 0.0
        """Since the flight began, s."""
        self._check_range(self.now.position)

    @property
    def now(self) -> State:
        """Motion along the laboratory's axes, SI units."""
        return self.flight.scales.unpack(self.state).to_lab(self.scene.angular_velocity * self.time)

    def onward(self, seconds: float) -> Piece:
        """Fly on so long (s), or to contact or loss, after which there is nothing to fly.

        Raises
        ------
        InputError : `seconds` is not positive
        IntegrationError : the state became infinite
        """
        if not seconds > 0:
            raise InputError(f"Input seconds must be positive; instead received {seconds}.")
        if self.log.ended_by != DURATION:
            return self._piece(np.array([self.time]), self.state[None])
        unit, number = self.flight.scales.time, int(np.clip(A_SECOND * seconds, FEWEST, MOST))
        recorder = _Samples(np.append(self.state[:12], 0.0), self.time / unit, seconds / number / unit)
        self._go(self.time + seconds, recorder)
        return self._piece(recorder.times[1:] * unit, recorder.states[1:])

    def push(self, velocity: Array) -> None:
        """Add a velocity (3,) m/s, along the laboratory's axes, as a blow does."""
        self._become(replace(self.now, velocity=self.now.velocity + velocity))

    def put(self, position: Array) -> None:
        """Hold the floater at a position (3,) m, rotor's frame, at rest there, and let go; moment and spin stay.

        Raises
        ------
        StartError : it would overlap a magnet or the plate, or the field of the plate's currents is not known there;
            nothing is changed
        """
        check_free("position", self.scene, np.asarray(position, float), self.time)
        place = turned_about_z(position, self.scene.angular_velocity * self.time)
        self._check_range(place)
        turning = np.cross([0.0, 0.0, self.scene.angular_velocity], place)
        self.log.ended_by = DURATION
        self._become(replace(self.now, position=place, velocity=turning))

    def _check_range(self, place: Array) -> None:
        """Raises StartError where the plate's table does not know the field at a place (3,) m in the laboratory."""
        if not in_plate_range(self.memory, replace(self.now, position=place), self.time):
            where = ", ".join(f"{1e3 * c:.4g}" for c in place)
            raise StartError(
                f"Input position must be where the field of the plate's currents was computed; instead received "
                f"({where}) mm. Put it nearer to where it began, choose no plate model, or begin there: "
                "start.position_mm."
            )

    def _become(self, lab: State) -> None:
        state = lab.to_rotor(self.scene.angular_velocity * self.time)
        self.state[:12] = self.flight.scales.pack(state)
        self.flight.enter(state, self.values, self.time / self.flight.scales.time)

    def _go(self, end: float, recorder: Recorder) -> None:
        unit, log = self.flight.scales.time, self.log
        fly_on(self.scene, self.flight, self.values, self.time / unit, self.state, end, recorder, log)
        self.state, self.time = self.flight.part(self.values).whole, float(recorder.times[-1]) * unit

    def _piece(self, times: Array, states: Array) -> Piece:
        turned = self.scene.angular_velocity * times
        lab = self.flight.scales.unpack(states).to_lab(turned)
        return Piece(times, lab, float(turned[-1]), self.log.ended_by)


class _Samples(Recorder):
    """Samples from now on; those before are forgotten."""

    def __init__(self, state: Array, now: float, interval: float) -> None:
        super().__init__(state, interval, 4 * MOST, now)
