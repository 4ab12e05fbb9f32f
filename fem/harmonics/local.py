"""A table's field in a small ball, as an expansion about its centre: a third of the operations, always the same ones.

With lengths in radii of the ball, r̃ = (r - center)/radius, B = -∇̃ Σ conj a_lm Υ_lm(r̃) (`interior`): free of
divergence and curl whatever the coefficients are, so that a force made of it is conservative.  All numbers of a ball
are runtime parameters; a floater that leaves it goes on in another one with the same compiled code.

What an expansion misses is harmonic in each component, hence largest on the surface of the ball, and is measured there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import heyoka as hy
import numpy as np

from ...geometry.basics import Array
from .compiled import FieldExpressions
from .fit_in_ball import derivatives, sphere_fit
from .interior import Ball
from .multipole import UPPER
from .regular_sums import regular_harmonics, weighted


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
