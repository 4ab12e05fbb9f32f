"""Fields in a ball from their normal component on its surface, in the real harmonics of `regular_sums`.

With lengths in radii of the ball, B = -∇ Σ c_k R_k, the R_k in the order of `members`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import heyoka as hy
import numpy as np

from ...geometry.common import Array
from .expansion import UPPER
from .expressions import FieldExpressions, members, real_sizes, real_weights, regular_harmonics, weighted
from .interior import Ball, gradient_coefficients, sphere
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


@dataclass(frozen=True)
class BallField:
    """The field in a ball that runtime parameters describe: centre (m), 1/radius (1/m; 0: no ball), weights.

    Parameters
    ----------
    first : number of the first of these parameters
    degree : of the potential: 7, 8 and 9 ask for 613, 780 and 966 operations where the table of a cube has 1824
    """

    first: int
    degree: int

    @property
    def count(self) -> int:
        """Of the runtime parameters."""
        return 4 + 3 * self.degree**2 + 5 * (self.degree - 1) ** 2

    def offset(self, position: Sequence[hy.expression]) -> list[hy.expression]:
        """(r - center)/radius at a position (three expressions, m)."""
        return [(p - hy.par[self.first + i]) * hy.par[self.first + 3] for i, p in enumerate(position)]

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m)."""
        offset, (size, less) = self.offset(position), (self.degree**2, (self.degree - 1) ** 2)
        harmonics = regular_harmonics(self.degree - 1, offset, hy.sum([t * t for t in offset]))
        start = self.first + 4
        field = [weighted(start + i * size, harmonics) for i in range(3)]
        slopes = [weighted(start + 3 * size + k * less, harmonics[:less]) for k in range(len(UPPER))]
        upper = dict(zip(UPPER, slopes, strict=True))
        upper[2, 2] = -upper[0, 0] - upper[1, 1]
        return field, [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]

    def fit(self, evaluate: Callable[[Array], tuple[Array, Array]], ball: Ball) -> tuple[Array, float]:
        """Values (count,) of the parameters for a field, points (n, 3) m -> B, ∇B; and the error of the expansion.

        The error is the largest on the surface, of B or of its gradient, by the root mean square there.
        """
        fitting, (size, less) = sphere_fit(self.degree), (self.degree**2, (self.degree - 1) ** 2)
        field, gradient = evaluate(ball.center + ball.radius * fitting.normals)
        slopes = np.array([gradient[:, i, j] for i, j in UPPER])
        weights = _weights(self.degree) @ np.einsum("na,na->n", field, fitting.normals)
        weights[3 * size :] /= ball.radius
        field_error = _relative_miss(weights[: 3 * size].reshape(3, size) @ fitting.basis - field.T, field.T)
        slope_error = _relative_miss(weights[3 * size :].reshape(5, less) @ fitting.basis[:less] - slopes, slopes)
        return np.concatenate([ball.center, [1 / ball.radius], weights]), max(field_error, slope_error)


@cache
def _weights(degree: int) -> Array:
    """(3 degree² + 5 (degree - 1)², n): those of B and of its gradient by the normal component of B on the sphere."""
    first, second, potential = derivatives(degree), derivatives(degree - 1), sphere_fit(degree).potential
    field = [-slope @ potential for slope in first]
    return np.concatenate([*field, *(second[j] @ field[i] for i, j in UPPER)])


def _relative_miss(missed: Array, values: Array) -> float:
    """Largest norm of what is missed (k, n) by the root mean square of the norm of the values (k, n)."""
    size = float(np.sqrt(np.mean(np.sum(values**2, axis=0))))
    worst = float(np.sqrt(np.max(np.sum(missed**2, axis=0))))
    return worst / size if size else worst
