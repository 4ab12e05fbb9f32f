"""What moves the body spin: torques along the floater's own moment, on which magnetic torque has no part.

That of air goes beyond Stokes' range (`effects.air`): 8πηR³Ω times f for a steady spin, times h for a small swing.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..effects import reynolds, spinning, swinging
from ..motion import Parameter, Rates, Scales, parameters


@dataclass(frozen=True, eq=False)
class SlowTorque:
    """Rate of the body spin at rest in the rotor's frame: air drag, and own eddy currents towards cos θ.

    In this frame nothing changes within a turn, so that the average over it is the value itself:

        ds/dt = -(γ/I) [f s_z cos θ + h (s - s_z cos θ)] + κ B⊥² (cos θ - s) / I,   B⊥² = B² - (m̂·B)²,

    with γ and κ those of `motion.equations`, which are compiled and evaluated here.  Seen from the laboratory the
    floater spins steadily about the rotor's axis, at s_z ω = (sin²θ + s cos θ) ω, and swings across it once a turn; f
    and h are the factors of the air for these two.  Where f = h = 1, Stokes, drag is -γ s / I.  As h > f, the
    swing, which the rotor keeps up, drives s to a small positive value instead of zero, about (h/f - 1) sin²θ.  To
    second order in θ the swing also drives a steady flow, but none about the axis: the mean of a × (a × r) over a turn,
    with a the turning rate of a shell of air, has no such part.

    The field's gradient adds to κ as in `effects.floater_currents`, which is compiled and evaluated here: that of a
    dipole at distance d, which turns across its way, (12/7) (R/d)² of it on a small θ, 8 % at 30 mm.  A plating of
    copper and nickel, t thick, adds 5 σ't/(σR) to 1: a half for 5 µm of each of Ni, Cu and Ni.

    Parameters
    ----------
    rates : compiled equations
    values : their parameters, all slow torques included
    radius : of the floater, m
    beyond_stokes : whether drag goes beyond Stokes' here, as it does not in the compiled equations
    """

    rates: Rates
    values: Array
    radius: float
    beyond_stokes: bool

    @classmethod
    def of(cls, scene: Scene, rates: Rates, stokes: bool = False) -> Self:
        """The slow torques of a scene. Raises InputError for a floater that is no sphere."""
        scene.floater.must_be("sphere", where="for its slow drift", instead="Fly it (`simulate`).")
        return cls(rates, parameters(scene, Scales.of(scene)), scene.floater.radius, not (stokes or scene.drag.air))

    @property
    def absent(self) -> bool:
        """Whether nothing moves the spin."""
        return not np.any(self.values[[Parameter.SPIN_DRAG, Parameter.SPIN_EDDY]])

    def __call__(self, state: Array) -> float:
        """ds/dt, 1/s, at a scaled state (12,) at rest in the rotor's frame."""
        moment, spin = state[6:9], state[9:]
        change = self.rates(state[None], self.values)[0][0]
        rate = change[9:] @ moment + spin @ change[6:9]
        if self.beyond_stokes:
            rate -= self.values[Parameter.SPIN_DRAG] * self._beyond_stokes(moment, spin)
        return float(rate / self.values[Parameter.RATE] / self.values[Parameter.TIME])

    def _beyond_stokes(self, moment: Array, spin: Array) -> float:
        """Scaled spin about the moment, each part times what its drag is more than Stokes'."""
        time, turning = self.values[Parameter.TIME], self.values[Parameter.RATE]
        steady = float(spin[2] * moment[2])
        more_steady = float(spinning(reynolds(self.radius, spin[2] / time))) - 1
        more_swing = float(swinging(reynolds(self.radius, turning / time))) - 1
        return more_steady * steady + more_swing * float(spin @ moment - steady)
