"""A magnetic dipole over an infinite conducting slab of finite thickness: the exact reaction.

The slab fills -t < z < 0 and the dipole stands at (0, 0, h).  A part of its scalar potential with the
wave number k, falling as e^{kz} towards the slab, comes back as Γ e^{-kz}, with κ² = k² + iωμ0σ and

    Γ = (κ² - k²) E / [4 k κ + (κ - k)² E],     E = 1 - e^{-2κt},     κ² - k² = iωμ0σ.

This is the usual (κ²-k²)E / [(k+κ)² - (k-κ)² e^{-2κt}] without its cancellations.  B = G m with

    G_ij = -(μ0/4π) ∂_i ∂'_j ∫ J0(kρ) e^{-k(z+z')} Γ dk.

The integral is taken over u = ln k by the trapezoidal rule.  The integrand is analytic for |Im u| < π/4
(the slab's poles lie between the rays arg k = -π/2 and -π/4) so that a step d leaves e^{-π²/2d}: 4e-15
at d = 0.15.  No scale of the problem (1/h, 1/t, 1/δ, ωμ0σt) needs to be known.

J. R. Reitz, J. Appl. Phys. 41 (1970) 2067; W. R. Smythe, Static and Dynamic Electricity (3rd ed.), ch. X.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import MU_0, Array
from ..closed_forms import ComplexArray

LOWEST, HIGHEST = -37.0, 3.5
"""Range of ln(k (z+z')/2): the integrand goes as k or faster below, and as e^{-66} above."""
DIGITS = 33.0
"""Natural logarithm of the precision aimed at."""


@dataclass(frozen=True)
class Slab:
    """An infinite plane conductor.

    Parameters
    ----------
    conductivity : S/m; infinite for a perfect conductor
    thickness : m; infinite for a half space
    """

    conductivity: float
    thickness: float = np.inf

    def __post_init__(self) -> None:
        for name, unit in (("conductivity", "S_m"), ("thickness", "m")):
            if not getattr(self, name) > 0:
                raise ValueError(f"Input {name}_{unit} must be positive; instead received {getattr(self, name)!r}.")

    def reflection(self, wave_number: ArrayLike, frequency: ArrayLike) -> ComplexArray:
        """Γ at wave numbers (1/m) and frequencies (Hz, of either sign), broadcast against each other."""
        k, frequency = np.broadcast_arrays(np.asarray(wave_number, float), np.asarray(frequency, float))
        if np.isinf(self.conductivity):
            return np.ones(k.shape, complex)
        diffusion = 2j * np.pi * MU_0 * self.conductivity * frequency
        kappa = np.sqrt(k * k + diffusion)
        filling = -np.expm1(-2 * kappa * self.thickness) if np.isfinite(self.thickness) else 1.0
        excess = diffusion / (kappa + k)
        return np.asarray(diffusion * filling / (4 * k * kappa + excess * excess * filling))


def checked(height: ArrayLike, frequency: ArrayLike) -> tuple[Array, Array]:
    """Heights (m) and frequencies (Hz) as arrays of one shape.

    Raises
    ------
    ValueError : a height is not above the face, or a frequency is negative or not finite
    """
    h, f = np.broadcast_arrays(np.asarray(height, float), np.asarray(frequency, float))
    if not np.all(h > 0):
        raise ValueError(f"Input height_m must be positive (the dipole is over the face); instead received {h.min()}.")
    if not np.all((f >= 0) & np.isfinite(f)):
        raise ValueError(f"Input frequency_hz must be finite and not negative; instead received {f.min()}.")
    return h, f


def wave_numbers(height: Array, aperture: float = np.pi / 4) -> tuple[Array, Array]:
    """Nodes and weights (..., n), 1/m, for ∫ dk of e^{-2 k height} times what is analytic for |arg k| < aperture."""
    count = int(np.ceil((HIGHEST - LOWEST) * DIGITS / (2 * np.pi * aperture))) + 1
    nodes, step = np.linspace(LOWEST, HIGHEST, count, retstep=True)
    k = np.exp(nodes) / height[..., None]
    return k, step * k


def power_integral(slab: Slab, height: Array, frequency: Array, power: int) -> ComplexArray:
    """∫ k^power e^{-2kh} Γ dk of the shape of `height` and `frequency`, 1/m^(power+1)."""
    k, weight = wave_numbers(height)
    return np.asarray(np.sum(weight * k**power * np.exp(-2 * k * height[..., None])
                             * slab.reflection(k, frequency[..., None]), axis=-1))  # fmt: skip


def reaction_tensor(slab: Slab, height: ArrayLike, frequency: ArrayLike) -> ComplexArray:
    """G (..., 3, 3), T/(A m²): B = G m at a dipole `height` (m) over the face, phasors e^{+iωt}.

    Heights and frequencies (Hz) are broadcast.  Relative error below 1e-12 from 0 to beyond 1 MHz; G = 0 at 0 Hz.

    Raises
    ------
    ValueError : height not positive, or frequency negative
    """
    h, f = checked(height, frequency)
    normal = -MU_0 / (4 * np.pi) * power_integral(slab, h, f, 2)
    return normal[..., None, None] * np.diag([0.5, 0.5, 1.0])
