"""Torque of air on a spinning sphere, beyond Stokes' range.

With Re = ΩR²/ν the torque is ½ρΩ²R⁵ C.  Slow: C = 16π/Re, which is 8πηR³Ω (G. Kirchhoff, 1876).  Faster, the sphere
throws off a jet at its equator and C = 6.45/√Re + 32.1/Re (S. C. R. Dennis, S. N. Singh and D. B. Ingham, J. Fluid
Mech. 101 (1980) 257; 20 ≤ Re ≤ 1000, steady; the first term is the boundary layer's, so that laminar flow reaches
further).  The two meet at Re = 7.9; the larger one is taken.  E. Loth's fit of other data (AIAA J. 46 (2008) 801),
1 + 5/(64π) (4 Re)^0.6 times Stokes, is 11 % higher at Re = 20 and agrees within 5 % from 100 to 2000.

The air is far from walls and its flow is steady: a sphere that also swings once a turn moves more of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..geometry.box import Array
from ..geometry.scene import AIR_VISCOSITY

AIR_DENSITY = 1.19
"""kg/m³ at 20-25 °C."""
BOUNDARY_LAYER, REST = 6.45, 32.1


def reynolds(radius: float, angular_velocity: ArrayLike) -> Array:
    """ΩR²/ν in air of a sphere (m) that spins (rad/s)."""
    return np.asarray(np.abs(np.asarray(angular_velocity, float)) * radius**2 * AIR_DENSITY / AIR_VISCOSITY)


def beyond_stokes(reynolds_number: ArrayLike) -> Array:
    """Torque of a spinning sphere over Stokes' 8πηR³Ω, at Re = ΩR²/ν: 1 up to 7.9, about 4.7 at 1000."""
    number = np.asarray(reynolds_number, float)
    return np.asarray(np.maximum(1.0, (BOUNDARY_LAYER * np.sqrt(number) + REST) / (16 * np.pi)))
