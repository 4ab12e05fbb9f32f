"""Fields in a ball from their normal component on its surface, in the real harmonics of `regular_sums`.

With lengths in radii of the ball, B = -∇ Σ c_k R_k, the R_k in the order of `members`.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from ...geometry.basics import Array
from .interior import gradient_coefficients, sphere
from .regular_sums import members, real_sizes, real_weights
from .solid import factorials, regular_values


@dataclass(frozen=True, eq=False)
class SphereFit:
    """What takes values on the unit sphere to an expansion, and back.

    Parameters
    ----------
    normals : (n, 3) points
    potential : (K, n) c_k by the normal component at one of the points, K = (degree + 1)²
    basis : (degree², n) R_k up to one degree less, at the points
    """

    normals: Array
    potential: Array
    basis: Array


@cache
def sphere_fit(degree: int) -> SphereFit:
    """For potentials of a degree; exact for them."""
    normals, areas = sphere(degree)
    found = np.zeros((len(normals), degree + 1, degree + 1), complex)
    for (l, m), values in regular_values(degree, *normals.T).items():
        if l:
            found[:, l, m] = -(2 * l + 1) / (4 * np.pi * l) * values * areas
    potential = np.stack([real_weights(np.asarray(factorials(degree) * row, complex)) for row in found], axis=1)
    known = regular_values(degree - 1, *normals.T)
    values = np.array([known[l, m].imag if part else known[l, m].real for l, m, part in members(degree - 1)])
    return SphereFit(normals, potential, values / real_sizes(degree - 1)[:, None])


@cache
def derivatives(degree: int) -> Array:
    """(3, degree², K): the coefficients of ∂/∂x_a Σ c_k R_k by the c_k, K = (degree + 1)²."""
    columns = []
    for k, (l, m, part) in enumerate(members(degree)):
        single = np.zeros((degree + 1, degree + 1), complex)
        single[l, m] = 1j if part else 1.0
        single /= real_weights(single)[k]
        columns.append([real_weights(gradient_coefficients(single, axis)) for axis in range(3)])
    return np.asarray(np.moveaxis(np.array(columns), 0, -1))
