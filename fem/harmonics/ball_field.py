"""A table's field in a small ball, as an expansion about its centre: a third of the operations, always the same ones.

With lengths in radii of the ball, r̃ = (r - center)/radius, B = -∇̃ Σ conj a_lm Υ_lm(r̃) (`interior`): free of
divergence and curl whatever the coefficients are, so that a force made of it is conservative.  All numbers of a ball
are runtime parameters; a floater that leaves it goes on in another one with the same compiled code.

What an expansion misses is harmonic in each component, hence largest on the surface of the ball, and is measured there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from .compiled import FieldExpressions
from .interior import Ball, factorials, gradient_coefficients, sphere
from .multipole import UPPER
from .regular_sums import real_weights, regular_harmonics, weighted
from .solid import Coefficients, regular_values


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
        fitting = _fitting(self.degree)
        field, gradient = evaluate(ball.center + ball.radius * fitting.normals)
        weights = fitting.weights @ np.einsum("na,na->n", field, fitting.normals)
        weights[3 * self.degree**2 :] /= ball.radius
        misses = fitting.values(weights) - np.vstack([field.T, *(gradient[:, i, j] for i, j in UPPER)])
        error = max(
            _relative(misses[:3], field.T), _relative(misses[3:], np.array([gradient[:, i, j] for i, j in UPPER]))
        )
        return np.concatenate([ball.center, [1 / ball.radius], weights]), error


@dataclass(frozen=True, eq=False)
class _Fitting:
    """From the normal component of B on the unit sphere to the weights of B and its gradient, and to values there.

    Parameters
    ----------
    degree : of the potential
    normals : (n, 3) points
    """

    degree: int
    normals: Array

    @cached_property
    def weights(self) -> Array:
        """(3 degree² + 5 (degree - 1)², n)"""
        return np.stack([self._of(row) for row in self._potentials], axis=1)

    @property
    def _potentials(self) -> NDArray[np.complex128]:
        """(n, L+1, L+1) a_lm by a unit normal component at one of the points."""
        harmonics, result = (
            regular_values(self.degree, *self.normals.T),
            np.zeros((len(self.normals), *2 * [self.degree + 1]), complex),
        )
        _, areas = sphere(self.degree)
        for (l, m), values in harmonics.items():
            if l:
                result[:, l, m] = -(2 * l + 1) / (4 * np.pi * l) * values * areas
        return np.asarray(factorials(self.degree) * result, complex)

    @staticmethod
    def _of(potential: Coefficients) -> Array:
        slopes = [-gradient_coefficients(potential, axis) for axis in range(3)]
        return np.concatenate(
            [real_weights(s) for s in slopes] + [real_weights(gradient_coefficients(slopes[i], j)) for i, j in UPPER]
        )

    @cached_property
    def _basis(self) -> Array:
        x = hy.make_vars("x", "y", "z")
        outputs = regular_harmonics(self.degree - 1, x, hy.sum([t * t for t in x]))
        return np.asarray(hy.cfunc(outputs, x, compact_mode=True)(np.ascontiguousarray(self.normals.T)))

    def values(self, weights: Array) -> Array:
        """The three components of B and the five of its gradient, (8, n)."""
        size, less = self.degree**2, (self.degree - 1) ** 2
        field = weights[: 3 * size].reshape(3, size) @ self._basis
        return np.vstack([field, weights[3 * size :].reshape(5, less) @ self._basis[:less]])


@cache
def _fitting(degree: int) -> _Fitting:
    return _Fitting(degree, sphere(degree)[0])


def _relative(missed: Array, values: Array) -> float:
    size = float(np.sqrt(np.mean(np.sum(values**2, axis=0))))
    worst = float(np.sqrt(np.max(np.sum(missed**2, axis=0))))
    return worst / size if size else worst
