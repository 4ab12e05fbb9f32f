"""Torque of air on a spinning and swinging sphere, beyond Stokes' range.

Stokes' torque is 8πηR³Ω (G. Kirchhoff, 1876).  Two things make the real one larger.

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

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ...geometry.scenes import AIR_VISCOSITY

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
