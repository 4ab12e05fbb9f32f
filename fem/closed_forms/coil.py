"""Field of a round coil with a rectangular cross-section, by complete elliptic integrals, for 1 A in each turn.

A cylindrical sheet of radius a with the current K along z has, from its ends at the heights ζ over the point,

    A_φ = (4μ0 K a² ρ/π) [ζ/((a+ρ)² r) ∫ s²c²/((1 - h²s²) √(1 - k²s²)) dθ],    r² = (a+ρ)² + ζ²,
    h² = 4aρ/(a+ρ)²,  k² = 4aρ/r²,  s = sin θ,  c = cos θ,  0 < θ < π/2

(the usual integral of cos φ asinh(ζ/distance), by parts: without cancellation on the axis), in Carlson's functions
[R_D(0, 1-k², 1) - (1-h²) R_J(0, 1-k², 1, 1-h²)]/3h².  A winding is the sum of its sheets by Gauss's rule, on either
side of the point's own radius, with nodes that crowd there.

N. Derby, S. Olbert, Am. J. Phys. 78, 229 (2010) (B_z of a sheet); B. C. Carlson, Numer. Algorithms 10, 13 (1995).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, elliprf, elliprj

from ...geometry.common import MU_0, Array
from ...geometry.scene.contents import Coil
from ..harmonics.solid import gauss_legendre

NODES, CROWD = 24, 3  # Gauss points on either side of a point's radius, and the power by which they crowd there
NEAR_AXIS = 0.05  # h² below which the integral of the sheet is a sum over equidistant angles: 1/h² would cancel
ANGLES = np.pi / 2 * (np.arange(16) + 0.5) / 16
LEAST = 1e-30  # Parameter of R_J in place of zero, where its factor is zero
BLOCK = 20_000  # Points at a time


def _wave(h: Array, k: Array) -> Array:
    """∫ s²c²/((1 - h s²) √(1 - k s²)) dθ over a quarter turn."""
    p = np.maximum(1 - h, LEAST)
    near = h < NEAR_AXIS
    safe = np.where(near, 0.5, h)
    closed = (elliprd(0, 1 - k, 1) - p * elliprj(0, 1 - k, 1, p)) / (3 * safe)
    if not near.any():
        return np.asarray(closed)
    square = np.sin(ANGLES) ** 2
    factors = square * (1 - square) * (np.pi / 2 / len(ANGLES))
    summed = (factors / (1 - h[near, None] * square) / np.sqrt(1 - k[near, None] * square)).sum(axis=1)
    closed[near] = summed
    return np.asarray(closed)


def _sheet_potential(a: Array, rho: Array, zeta: Array) -> Array:
    """A_φ over μ0 K of the end at ζ of a sheet."""
    square = (a + rho) ** 2
    far = square + zeta**2
    wave = _wave(4 * a * rho / square, 4 * a * rho / far)
    return np.asarray(4 / np.pi * a**2 * rho * zeta / (square * np.sqrt(far)) * wave)


def _sheet_radial(a: Array, rho: Array, zeta: Array) -> Array:
    """B_ρ over μ0 K of the end at ζ: A_φ of a ring there."""
    far = (a + rho) ** 2 + zeta**2
    k = 4 * a * rho / far
    return np.asarray(4 / np.pi * a**2 * rho / far**1.5 * _wave(k, k))


def _sheet_axial(a: Array, rho: Array, zeta: Array) -> Array:
    """B_z over μ0 K of the end at ζ (Derby and Olbert, equation 4)."""
    far, gamma = (a + rho) ** 2 + zeta**2, (a - rho) / (a + rho)
    other = (zeta**2 + (a - rho) ** 2) / far
    turn = gamma * (1 - gamma) * elliprj(0, other, 1, np.maximum(gamma**2, LEAST)) / 3
    return np.asarray(a * zeta / (np.pi * (a + rho) * np.sqrt(far)) * (elliprf(0, other, 1) + turn))


def _summed(coil: Coil, end: Callable[[Array, Array, Array], Array], rho: Array, z: Array) -> Array:
    """A sheet's function `end`, at both ends, summed over a winding of 1 A a turn, at (n,) m from its axis and middle.

    Crowding nodes meet the kink of a sheet's field at its own radius; points there are moved off it by round-off.
    """
    inner, outer = coil.radius - coil.width / 2, coil.radius + coil.width / 2
    nodes, weights = gauss_legendre(NODES)
    along, weights = ((nodes + 1) / 2) ** CROWD, weights / 2 * CROWD * ((nodes + 1) / 2) ** (CROWD - 1)
    middle = np.clip(rho, inner, outer)
    total = np.zeros(len(rho))
    for edge in (inner, outer):
        way = edge - middle
        radii = middle[:, None] + way[:, None] * along
        for height, sign in ((coil.height / 2, 1.0), (-coil.height / 2, -1.0)):
            ends = end(radii.ravel(), np.repeat(rho, NODES), np.repeat(height - z, NODES)).reshape(radii.shape)
            total += sign * np.abs(way) * (ends @ weights)
    return MU_0 * coil.turns / (coil.width * coil.height) * total


@dataclass(frozen=True, eq=False)
class CoilField:
    """Coils about axes along z, each with 1 A in its turns, or a share of that."""

    coils: Sequence[Coil]
    shares: Sequence[float] | None = None  # one a coil

    def _total(self, points: ArrayLike, part: Callable[[Coil, Array, Array, Array], Array]) -> Array:
        points = np.asarray(points, float).reshape(-1, 3)
        found = np.zeros(points.shape)
        for coil, share in zip(self.coils, self.shares or [1.0] * len(self.coils), strict=True):
            for start in range(0, len(points), BLOCK):
                local = points[start : start + BLOCK] - coil.center
                rho = np.hypot(local[:, 0], local[:, 1])
                found[start : start + BLOCK] += share * part(coil, local, rho, local[:, 2])
        return found

    def vector_potential(self, points: ArrayLike) -> Array:
        """A (n, 3), T m, at points (n, 3), m; to 1e-10 of the coil's largest."""

        def part(coil: Coil, local: Array, rho: Array, z: Array) -> Array:
            along = _summed(coil, _sheet_potential, rho, z) / np.maximum(rho, 1e-300)
            return np.stack([-local[:, 1] * along, local[:, 0] * along, 0 * along], axis=1)

        return self._total(points, part)

    def flux_density(self, points: ArrayLike) -> Array:
        """B (n, 3), T, at points (n, 3), m."""

        def part(coil: Coil, local: Array, rho: Array, z: Array) -> Array:
            outwards = _summed(coil, _sheet_radial, rho, z) / np.maximum(rho, 1e-300)
            axial = _summed(coil, _sheet_axial, rho, z)
            return np.stack([local[:, 0] * outwards, local[:, 1] * outwards, axial], axis=1)

        return self._total(points, part)
