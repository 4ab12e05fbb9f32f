"""The open space outside a sphere: exact Dirichlet-to-Neumann map by spherical harmonics.

Outside a sphere of radius R a potential of degree l falls as r^-(l+1), so that -∂u/∂r = (l+1)/R u_l. A Robin term 2/R
is exact for l = 1; what other degrees lack is a matrix of low rank, (l-1)/R on each harmonic up to `degree`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import gammaln

from ..geometry.box import Array
from .harmonics import Coefficients, regular
from .integration_points import surface_points

FOUR_PI = 4 * np.pi
HIGHEST_ORDER = 14
"""Of the surface quadrature: from 16 on NGSolve 6.2.2608 mixes up the points in the trace matrix."""


class OpenBoundary:
    """Dirichlet-to-Neumann map of the outside of the sphere `outer` about the origin.

    Parameters
    ----------
    mesh : NGSolve mesh with the boundary `outer`
    space : H1 space of the potential
    radius : of the sphere
    degree : highest degree that is treated exactly; higher ones see the Robin term
    order : of the elements

    Attribute `area_error` is the relative error of the area of the meshed sphere, which measures its roundness.
    """

    def __init__(self, mesh: Any, space: Any, radius: float, degree: int, order: int) -> None:
        surface = surface_points(mesh, "outer", min(2 * order + 4, HIGHEST_ORDER))
        trace = surface.weighted_trace(space)
        used = surface.weights > 0
        self.radius, self.degree = radius, degree
        self.area_error = abs(float(surface.weights.sum()) / (FOUR_PI * radius**2) - 1)
        self.unknowns = np.unique(trace[used].indices)
        harmonics, self._degrees = _orthonormal(degree, surface.points[used])
        self._projection = np.asarray(trace[used][:, self.unknowns].T @ harmonics)

    @property
    def robin(self) -> float:
        """Factor of the Robin term ∫ u v."""
        return 2 / self.radius

    def apply(self, potential: Array) -> Array:
        """What the map adds to the Robin term, as a load vector (unknowns,)."""
        amplitudes = self._projection.T @ potential[self.unknowns]
        result = np.zeros_like(potential)
        result[self.unknowns] = self._projection @ ((self._degrees - 1) / self.radius**3 * amplitudes)
        return result

    def expansion(self, potential: Array) -> Coefficients:
        """Coefficients c_lm of the potential Σ c_lm Θ_lm outside, from its values on the sphere."""
        amplitudes = iter(self._projection.T @ potential[self.unknowns] / self.radius**2)
        result = np.zeros((self.degree + 1, self.degree + 1), complex)
        for l in range(self.degree + 1):
            for m in range(l + 1):
                value = next(amplitudes) + (0 if m == 0 else -1j * next(amplitudes))
                result[l, m] = self.radius ** (l + 1) * (2 * l + 1) / FOUR_PI * value / _norm(l, m)
        return result


def _norm(l: int, m: int) -> float:
    """Factor that makes Re Υ_lm, and Im Υ_lm if m > 0, orthonormal on the unit sphere."""
    square = (2 * l + 1) / FOUR_PI * np.exp(gammaln(l - m + 1) + gammaln(l + m + 1))
    return float(np.sqrt(square if m == 0 else 2 * square))


def _orthonormal(degree: int, points: Array) -> tuple[Array, Array]:
    """Real orthonormal harmonics (n, columns) in the directions of `points` (n, 3), and the degree of each column."""
    harmonics = regular(degree, *(points / np.linalg.norm(points, axis=1)[:, None]).T)
    columns, degrees = [], []
    for (l, m), values in sorted(harmonics.items()):
        columns += [_norm(l, m) * part for part in ((values.real,) if m == 0 else (values.real, values.imag))]
        degrees += [l] * (1 if m == 0 else 2)
    return np.stack(columns, axis=1), np.array(degrees, float)
