"""Synchronous equilibria as periodic motions: what a plate or tilted gravity makes of the fixed points without them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.box import Array
from ..geometry.scene import Scene
from .equilibrium import Equilibrium
from .events import clearance
from .floquet import floquet_modes
from .memory import PlateMemory
from .orbit import Orbit, periodic_orbit
from .plate_force import PlateForce
from .rates import Rates
from .state import Scales, State
from .symbols import Parameter

SMALLEST_STEP = 1 / 64
"""Of the way from no plate and gravity along the axis to the whole plate and the true gravity."""
SHAKING = [Parameter.GRAVITY_X, Parameter.GRAVITY_Y]


@dataclass(frozen=True, eq=False)
class Shaken:
    """A scene in which something makes the motion periodic.

    Parameters
    ----------
    scene : gravity may have any direction
    rates : compiled equations in the rotor's field
    values : their parameters, with the drag along the moment left out
    memory : the plate's currents, if they are modelled
    """

    scene: Scene
    rates: Rates
    values: Array
    memory: PlateMemory | None

    def reaches(self, position: Array) -> bool:
        """Whether the plate's table knows a place (3,) m, in the rotor's frame, through a whole turn."""
        if self.memory is None:
            return True
        around = State(*[np.broadcast_to(position, (16, 3))] * 4).to_lab(np.arange(16) * np.pi / 8).position
        return bool(np.all(self.memory.table.in_range(self.memory.plate.box.to_body(around))))

    def equilibrium(self, fixed: Equilibrium, doubt: Array) -> Equilibrium | None:
        """What a fixed point becomes; None where it ceases to be, or would touch a body.

        Parameters
        ----------
        doubt : (6,) acceleration of position and spin that the rotor's table may be wrong by, scaled
        """
        scales = Scales.of(self.scene)
        orbit = self._followed(scales.pack(fixed.state), fixed.spin)
        if orbit is None:
            return None
        turn, motion = scales.unpack(orbit.states), floquet_modes(orbit)
        times = np.arange(len(orbit.states)) / (len(orbit.states) * self.scene.frequency)
        if clearance(self.scene, times, turn.position).min() < 0:
            return None
        return Equilibrium(
            state=scales.unpack(orbit.mean),
            spin=fixed.spin,
            residual=orbit.error,
            position_error=self._position_error(orbit, doubt) * scales.length,
            stable=motion.stable,
            growth_per_s=motion.growth / scales.time,
            growth_error_per_s=float(motion.errors.max()) / scales.time,
            frequencies_hz=motion.angular_frequencies / (2 * np.pi * scales.time),
            turn=turn,
            currents=orbit.plate / self.values[Parameter.PLATE_SHARE] if self.memory else None,
            without=fixed,
        )

    def _followed(self, start: Array, spin: float) -> Orbit | None:
        """The orbit that a fixed point (12,) becomes while plate and lateral gravity grow to their full size."""
        orbit, done, step, states = None, 0.0, 1.0, start
        while done < 1.0:
            values = self.values.copy()
            part = min(1.0, done + step)
            values[SHAKING] *= part
            values[[Parameter.PLATE_MOMENT, Parameter.PLATE_SHARE]] *= np.sqrt(part)
            plate = None if self.memory is None else PlateForce(self.memory, values)
            found = periodic_orbit(self.rates, values, spin, plate, states)
            if found is None:
                step /= 2
                if step < SMALLEST_STEP:
                    return None
                continue
            orbit, done, states = found, part, found.states
        return orbit

    def _position_error(self, orbit: Orbit, doubt: Array) -> float:
        """From what the tables may be wrong by, and the rigidity of the orbit as a whole."""
        if self.memory is not None:
            plate = PlateForce(self.memory, self.values)
            heard = plate(2 * np.pi * np.arange(len(orbit.states)) / len(orbit.states), orbit.states)
            push = np.einsum("aix,ai->ax", heard.fields, orbit.plate - heard.signals)
            doubt = doubt + self.memory.error * np.sqrt(np.mean(push**2, axis=0))
        slope = orbit.derivatives.mean(axis=0)
        wrong = np.zeros((len(slope), 6))
        wrong[[3, 4, 5, 9, 10, 11], range(6)] = doubt
        answer = np.linalg.lstsq(slope, wrong, rcond=1e-10)[0]
        return float(np.linalg.norm(np.abs(answer[:3]).sum(axis=1)) + orbit.error)
