"""Fields in a ball from their normal component on its surface, in the real harmonics of `regular_harmonics`.

With lengths in radii of the ball, B = -∇ Σ c_k R_k, the R_k in the order of `members`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import heyoka as hy
import numpy as np

from ...geometry.common import Array
from .expansion import UPPER
from .expressions import FieldExpressions, regular_harmonics
from .interior import Ball, gradient_coefficients, sphere
from .solid import Coefficients, factorials, members, regular_values


def real_weights(coefficients: Coefficients) -> Array:
    """Weights (..., K), in the order of `members`, of Σ conj a_lm Υ_lm (..., l, m) over positive and negative m."""
    degree = coefficients.shape[-1] - 1
    scaled = coefficients * _sizes(degree) * np.where(np.arange(degree + 1), 2.0, 1.0)
    parts = [(scaled[..., l, m].imag if part else scaled[..., l, m].real) for l, m, part in members(degree)]
    return np.stack(parts, axis=-1)


def _sizes(degree: int) -> Array:
    """[l, m]: Υ_lm by S_m Q_lm, (-1)^m (2l-1)!!/((l-m)! (l+m)!)."""
    l, m = np.indices((degree + 1, degree + 1))
    doubled = np.cumprod([1.0, *(2.0 * k - 1 for k in range(1, degree + 1))])
    return np.where(m <= l, (-1.0) ** m * doubled[l] / factorials(degree), 0.0)


@cache
def _fitting(degree: int) -> tuple[Array, Array, Array]:
    """Points (n, 3) on the unit sphere for potentials of a degree; exact for them.

    With (3 degree² + 5 (degree - 1)², n) the weights of B and of its gradient by the normal component of B there, and
    (degree², n) the R_k up to one degree less.
    """
    normals, areas = sphere(degree)
    by_normal = np.zeros((len(normals), degree + 1, degree + 1), complex)
    for (l, m), values in regular_values(degree, *normals.T).items():
        if l:
            by_normal[:, l, m] = -(2 * l + 1) / (4 * np.pi * l) * values * areas
    potential = real_weights(np.asarray(factorials(degree) * by_normal, complex)).T
    first, second = derivatives(degree), derivatives(degree - 1)
    field = [-slope @ potential for slope in first]
    weights = np.concatenate([*field, *(second[j] @ field[i] for i, j in UPPER)])
    known, sizes = regular_values(degree - 1, *normals.T), _sizes(degree - 1)
    basis = [(known[l, m].imag if p else known[l, m].real) / sizes[l, m] for l, m, p in members(degree - 1)]
    return normals, weights, np.array(basis)


@cache
def derivatives(degree: int) -> Array:
    """(3, degree², K): the coefficients of ∂/∂x_a Σ c_k R_k by the c_k, K = (degree + 1)²."""
    columns = []
    for k, (l, m, part) in enumerate(members(degree)):
        single = np.zeros((degree + 1, degree + 1), complex)
        single[l, m] = 1j if part else 1.0
        single /= real_weights(single)[k]
        columns.append([real_weights(gradient_coefficients(single, axis)) for axis in range(3)])
    return np.moveaxis(np.array(columns), 0, -1)


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
        size, less = self.degree**2, (self.degree - 1) ** 2
        _, *harmonics = regular_harmonics(self.degree - 1, self.offset(position))  # the first is 1

        def weighted(first: int, count: int) -> hy.expression:
            return hy.sum([hy.par[first], *(hy.par[first + 1 + k] * h for k, h in enumerate(harmonics[: count - 1]))])

        start = self.first + 4
        field = [weighted(start + i * size, size) for i in range(3)]
        slopes = [weighted(start + 3 * size + k * less, less) for k in range(len(UPPER))]
        upper = dict(zip(UPPER, slopes, strict=True))
        upper[2, 2] = -upper[0, 0] - upper[1, 1]
        return field, [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]

    def fit(self, evaluate: Callable[[Array], tuple[Array, Array]], ball: Ball) -> tuple[Array, float]:
        """Values (count,) of the parameters for a field, points (n, 3) m -> B, ∇B; and the error of the expansion.

        The error is the largest on the surface, of B or of its gradient, by the root mean square there.
        """
        (normals, by_normal, basis), size, less = _fitting(self.degree), self.degree**2, (self.degree - 1) ** 2
        field, gradient = evaluate(ball.center + ball.radius * normals)
        slopes = np.array([gradient[:, i, j] for i, j in UPPER])
        weights = by_normal @ np.einsum("na,na->n", field, normals)
        weights[3 * size :] /= ball.radius
        field_error = _relative_miss(weights[: 3 * size].reshape(3, size) @ basis - field.T, field.T)
        slope_error = _relative_miss(weights[3 * size :].reshape(5, less) @ basis[:less] - slopes, slopes)
        return np.concatenate([ball.center, [1 / ball.radius], weights]), max(field_error, slope_error)


def _relative_miss(missed: Array, values: Array) -> float:
    """Largest norm of what is missed (k, n) by the root mean square of the norm of the values (k, n)."""
    size = float(np.sqrt(np.mean(np.sum(values**2, axis=0))))
    worst = float(np.sqrt(np.max(np.sum(missed**2, axis=0))))
    return worst / size if size else worst
