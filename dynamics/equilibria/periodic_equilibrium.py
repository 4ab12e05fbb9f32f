"""Synchronous equilibria as periodic motions: what a plate or tilted gravity makes of the fixed points without them."""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import Parameter, PlateForce, PlateMemory, Rates, Scales, State, clearance
from ..steady import Equilibrium, Orbit, floquet_modes, named_modes, periodic_orbit

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

    def equilibrium(self, fixed: Equilibrium) -> Equilibrium | None:
        """What a fixed point becomes; None where it ceases to be, or would touch a body."""
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
            position_error=self._position_error(orbit, fixed, scales),
            stable=motion.stable,
            growth_per_s=motion.growth / scales.time,
            growth_error_per_s=float(motion.errors.max()) / scales.time,
            frequencies_hz=motion.angular_frequencies / (2 * np.pi * scales.time),
            modes=named_modes(motion, scales.time),
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
            values[[Parameter.PLATE_MOMENT, Parameter.PLATE_SHARE, Parameter.INDUCED]] *= np.sqrt(part)
            plate = None if self.memory is None else PlateForce(self.memory, values)
            found = periodic_orbit(self.rates, values, spin, plate, states)
            if found is None:
                step /= 2
                if step < SMALLEST_STEP:
                    return None
                continue
            orbit, done, states = found, part, found.states
        return orbit

    def _position_error(self, orbit: Orbit, fixed: Equilibrium, scales: Scales) -> float:
        """The fixed point's own, m, and the part of what the plate moves that its table may be wrong by."""
        moved = np.linalg.norm(orbit.states[:, :3] * scales.length - fixed.position, axis=1).max()
        wrong = self.memory.error * float(moved) if self.memory else 0.0
        return fixed.position_error + wrong + orbit.error * scales.length
