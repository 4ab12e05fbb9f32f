"""What moves the body spin: torques along the floater's own moment, on which magnetic torque has no part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.box import Array
from ..geometry.scene import Scene
from .air_torque import beyond_stokes, reynolds
from .equations import parameters
from .rates import Rates
from .state import Scales
from .symbols import Parameter


@dataclass(frozen=True, eq=False)
class SlowTorque:
    """Rate of the body spin at rest in the rotor's frame: air drag towards 0, own eddy currents towards cos θ.

    In this frame nothing changes within a turn, so that the average over it is the value itself:

        ds/dt = -f γ s / I + κ B⊥² (cos θ - s) / I,   B⊥² = B² - (m̂·B)²,

    with γ and κ those of `equations`, which are compiled and evaluated here, and f the factor of `air_torque` at the
    Reynolds number of the whole spin |Ω| = ω √(s² + sin²θ); f = 1 where the air is Stokes's.

    Parameters
    ----------
    rates : compiled equations
    values : their parameters, all slow torques included
    radius : of the floater, m
    stokes : whether drag is proportional to the spin at any Reynolds number
    """

    rates: Rates
    values: Array
    radius: float
    stokes: bool

    @classmethod
    def of(cls, scene: Scene, rates: Rates, stokes: bool = False) -> SlowTorque:
        """The slow torques of a scene."""
        return cls(rates, parameters(scene, Scales.of(scene)), scene.floater.radius, stokes)

    @property
    def absent(self) -> bool:
        """Whether nothing moves the spin."""
        return not np.any(self.values[[Parameter.SPIN_DRAG, Parameter.SPIN_EDDY]])

    def __call__(self, state: Array) -> float:
        """ds/dt, 1/s, at a scaled state (12,) at rest in the rotor's frame."""
        moment, spin = state[6:9], state[9:]
        change = self.rates(state[None], self.values)[0][0]
        time, turning = self.values[Parameter.TIME], self.values[Parameter.RATE]
        along = moment @ spin
        excess = 0.0 if self.stokes else float(beyond_stokes(reynolds(self.radius, np.linalg.norm(spin) / time))) - 1
        rate = change[9:] @ moment + spin @ change[6:9] - excess * self.values[Parameter.SPIN_DRAG] * along
        return float(rate / turning / time)
