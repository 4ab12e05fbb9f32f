"""What moves the body spin: torques along the floater's own moment, on which magnetic torque has no part.

That of air goes beyond Stokes' range: Stokes' torque on a sphere is 8πηR³Ω (G. Kirchhoff, 1876), and two things make
the real one larger.

A steady spin throws off a jet at the equator.  With Re = ΩR²/ν the torque is ½ρΩ²R⁵ C, C = 6.45/√Re + 32.1/Re for
20 ≤ Re ≤ 1000 (S. C. R. Dennis, S. N. Singh and D. B. Ingham, J. Fluid Mech. 101 (1980) 257: computed for 1 to 100, in
agreement with measurements; the first term is that of the boundary layer, so that laminar flow reaches further).
Stokes is C = 16π/Re; the two meet at Re = 7.9, and the larger one is taken.  E. Loth's fit of other data (AIAA J. 46
(2008) 801), 1 + 5/(64π) (4 Re)^0.6 times Stokes, is 11 % higher at Re = 20 and agrees within 5 % from 100 to 2000.

A small swing at the rotor's rate ω moves a layer of depth δ = √(2ν/ω), 0.2 to 0.3 mm.  Exactly, to first order in its
angle (L. D. Landau and E. M. Lifshitz, Fluid Mechanics, section 24, problem on the oscillating sphere), the part of the
torque that is in phase with Ω is, over Stokes' and with q = R/δ,

    h = (3 + 6q + 6q² + 2q³) / (3 (1 + 2q + 2q²)),

eight at 60 Hz for the article's floater.  The air is far from walls, and the rotor does not stir it.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ...geometry.scenes import AIR_VISCOSITY, Scene
from ..motion import Parameter, Rates, Scales, parameters

AIR_DENSITY = 1.19
"""kg/m³ at 20-25 °C."""
BOUNDARY_LAYER, REST = 6.45, 32.1


def reynolds(radius: float, angular_velocity: ArrayLike) -> Array:
    """ΩR²/ν in air of a sphere (m) that spins (rad/s)."""
    return np.asarray(np.abs(np.asarray(angular_velocity, float)) * radius**2 * AIR_DENSITY / AIR_VISCOSITY)


def spinning(reynolds_number: ArrayLike) -> Array:
    """Torque of a steady spin over Stokes' 8πηR³Ω, at Re = ΩR²/ν: 1 up to 7.9, about 4.7 at 1000."""
    number = np.asarray(reynolds_number, float)
    return np.asarray(np.maximum(1.0, (BOUNDARY_LAYER * np.sqrt(number) + REST) / (16 * np.pi)))


def swinging(reynolds_number: ArrayLike) -> Array:
    """Torque in phase with a small swing at ω over Stokes' 8πηR³Ω, at ωR²/ν: 1 if slow, about 8 at 1000."""
    q = np.sqrt(np.asarray(reynolds_number, float) / 2)
    return np.asarray((3 + 6 * q + 6 * q**2 + 2 * q**3) / (3 * (1 + 2 * q + 2 * q**2)))


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

    The field is taken as uniform over the floater.  That of a dipole at distance d, which turns across its way, has
    1 + (12/7) (R/d)² + (15/7) (R/d)⁴ times that torque on a small θ: 8 % more at 30 mm and 19 % at 20 mm.  A plating of
    copper and nickel, t thick, adds 5 σ't/(σR) to 1: a half for 5 µm of each of Ni, Cu and Ni.

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
    def of(cls, scene: Scene, rates: Rates, stokes: bool = False) -> Self:
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
        rate = change[9:] @ moment + spin @ change[6:9]
        if not self.stokes:
            rate -= self.values[Parameter.SPIN_DRAG] * self._beyond_stokes(moment, spin)
        return float(rate / self.values[Parameter.RATE] / self.values[Parameter.TIME])

    def _beyond_stokes(self, moment: Array, spin: Array) -> float:
        """Scaled spin about the moment, each part times what its drag is more than Stokes'."""
        time, turning = self.values[Parameter.TIME], self.values[Parameter.RATE]
        steady = float(spin[2] * moment[2])
        more_steady = float(spinning(reynolds(self.radius, spin[2] / time))) - 1
        more_swing = float(swinging(reynolds(self.radius, turning / time))) - 1
        return more_steady * steady + more_swing * float(spin @ moment - steady)
