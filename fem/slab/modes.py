"""Eigenmodes of the currents in an infinite slab: exact, one by one for every wave number.

In -t < z < 0 the potential of a mode is A = curl(ẑ W) with W = f(x, y) w(z), ∇²f = -k² f.  Free decay e^{-λt} makes
w'' = -q² w with λ = (k² + q²)/(μ0σ); outside w falls as e^{-k|z|}, so that w is cos or sin of q (z + t/2) with

    q tan(qt/2) = k    or    q cot(qt/2) = -k.

With u = qt/2 and c = kt/2 both are u - atan(c/u) = jπ/2, j = 0, 1, 2, …, and for both

    w(0)² / ∫w² dz = (2/t) u² / (u² + c² + c).

A mode of unit inductance, ∫ σλ |A|² dV = 1, has above the slab the field B = -∇(γ f e^{-kz}) with, for ∫f² dA = 1,

    γ² = w(0)² / (σλ ∫w² dz),    and the slab's reflection is    Γ(k, ω) = (2iωk/μ0) Σ_j γ_j² / (λ_j + iω).

Its terms fall as 1/j⁴.
"""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import MU_0, Array
from ..closed_forms import ComplexArray
from .reaction import Slab

NEWTON_STEPS = 60
"""More than enough: from the left, Newton's method doubles the smallest roots and then converges quadratically."""


@dataclass(frozen=True, eq=False)
class SlabModes:
    """The first modes of each wave number.

    Parameters
    ----------
    wave_numbers : (n,) k, 1/m
    rates : (n, modes) λ, 1/s
    strengths : (n, modes) γ, √H: of the potential of B above the slab, for ∫f² dA = 1 m²
    """

    wave_numbers: Array
    rates: Array
    strengths: Array

    def reflection(self, frequency: float) -> ComplexArray:
        """Γ (n,) of these modes at a frequency, Hz."""
        rate = 2j * np.pi * frequency
        return np.asarray(2 * rate * self.wave_numbers / MU_0 * np.sum(self.strengths**2 / (self.rates + rate), axis=1))


def slab_modes(slab: Slab, wave_numbers: Array, count: int) -> SlabModes:
    """The slowest `count` modes at each of `wave_numbers` (n,), 1/m."""
    c = wave_numbers[:, None] * slab.thickness / 2
    u = _roots(c, np.asarray(np.pi / 2 * np.arange(count), dtype=np.float64))
    rates = (2 / slab.thickness) ** 2 * (u * u + c * c) / (MU_0 * slab.conductivity)
    squares = 2 / slab.thickness * u * u / (u * u + c * c + c) / (slab.conductivity * rates)
    return SlabModes(wave_numbers, rates, np.sqrt(squares))


def modes_needed(slab: Slab, wave_number: float, frequency: float, tolerance: float) -> int:
    """How many modes leave less than `tolerance` of the reflection up to a wave number (1/m) and a frequency (Hz).

    What N modes leave out is 4 k κ² t³ / (3 π⁴ N³), κ² = ωμ0σ, of a reflection near 1, and 16 (kt)³ / (3 π⁴ N³) of one
    in the limit of slow changes; in between the sum is enough.
    """
    kt, squared = wave_number * slab.thickness, 2 * np.pi * frequency * MU_0 * slab.conductivity * slab.thickness**2
    return int(np.ceil(np.cbrt(4 * kt * (squared + 4 * kt * kt) / (3 * np.pi**4 * tolerance)))) + 4


def _roots(c: Array, phase: Array) -> Array:
    """u of u - atan(c/u) = phase: the left side is increasing and concave, so that Newton's method stays left of u."""
    u = phase + np.where(phase == 0, np.minimum(c, 1.0) / 2, 0.0)
    for _ in range(NEWTON_STEPS):
        u = u - (u - np.arctan2(c, u) - phase) / (1 + c / (u * u + c * c))
    return u
