"""The harmonics by which the fields of a plate's currents are told in a ball.

They are b = Σ_k w_k ∇̃Υ_k with lengths in radii of the ball and Υ_k the real and imaginary parts of the regular solid
harmonics in the normalisation of `solid`, because the derivatives of these are others of them times 1/2 or 1: all
functions together need only the products of the three components of a moment with those of one degree less.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import heyoka as hy
import numpy as np

from ...fem.harmonics.expansion import UPPER
from ...fem.harmonics.expressions import members, real_sizes, regular_harmonics
from ...fem.harmonics.local import derivatives, sphere_fit
from ...geometry.common import Array
from ..motion.state import Vector, dotted


@dataclass(frozen=True, eq=False)
class LocalHarmonics:
    """Gradients of the harmonics of degrees 1 to `degree`, number `count`.

    Parameters
    ----------
    degree : of the potential
    sizes : (count + 1,) Υ_k by what `regular_harmonics` gives
    slopes : (3, degree², count + 1) ∂Υ_k/∂x̃_a by the Υ of one degree less
    bends : (5, (degree - 1)², count + 1) the entries `UPPER` of ∂²Υ_k, by those of two degrees less
    """

    degree: int
    sizes: Array
    slopes: Array
    bends: Array

    @cached_property
    def orders(self) -> Array:
        """(count,) m."""
        return np.array([m for _, m, _ in members(self.degree)][1:])

    @cached_property
    def degrees(self) -> Array:
        """(count,) l."""
        return np.array([l for l, _, _ in members(self.degree)][1:])

    @cached_property
    def parities(self) -> Array:
        """(3, count): 1 for those that are odd in x, y and z, else 0."""
        return np.array([((m + part) % 2, part, (l - m) % 2) for l, m, part in members(self.degree)][1:]).T

    @property
    def count(self) -> int:
        """Of the functions."""
        return (self.degree + 1) ** 2 - 1

    def basis(self, offset: Vector) -> list[hy.expression]:
        """Υ up to one degree less at a place in the ball (radii)."""
        plain = regular_harmonics(self.degree - 1, offset, dotted(offset, offset))
        return [plain[0], *(float(n) * h for n, h in zip(self.sizes[1:], plain[1:], strict=False))]

    def heard(self, basis: Vector, source: Vector) -> list[hy.expression]:
        """source·∇̃Υ_k of every function."""
        halves = [0.5 * source[0], 0.5 * source[1], source[2]]
        products = [[s * h for h in basis] for s in halves]
        shares = self.slopes * np.array([2.0, 2.0, 1.0])[:, None, None]
        return [
            _combined([(shares[a, j, k], products[a][j]) for a, j in np.argwhere(self.slopes[:, :, k])])
            for k in range(1, self.count + 1)
        ]

    def field(self, basis: Vector, strengths: Vector) -> list[hy.expression]:
        """Σ strength ∇̃Υ."""
        return [_summed(matrix, basis, strengths) for matrix in self.slopes]

    def gradient(self, basis: Vector, strengths: Vector) -> dict[tuple[int, int], hy.expression]:
        """Σ strength ∂²Υ: the entries `UPPER`."""
        less = basis[: (self.degree - 1) ** 2]
        return {pair: _summed(matrix, less, strengths) for pair, matrix in zip(UPPER, self.bends, strict=True)}

    def weights(self, field: Array) -> Array:
        """(f, count) w of fields (f, n, 3) at the points of `sphere_fit`."""
        fitting = sphere_fit(self.degree)
        normal = np.einsum("fna,na->fn", field, fitting.normals)
        return np.asarray(-(normal @ fitting.potential.T)[:, 1:] / self.sizes[1:])

    def values(self, weights: Array) -> tuple[Array, Array]:
        """Fields (f, n, 3) and gradients (f, n, 5), lengths in radii, at these points from weights (f, count)."""
        basis = sphere_fit(self.degree).basis * self.sizes[: self.degree**2, None]
        less = basis[: (self.degree - 1) ** 2]
        field = np.einsum("jn,ajk,fk->fna", basis, self.slopes[:, :, 1:], weights, optimize=True)
        return field, np.einsum("jn,ajk,fk->fna", less, self.bends[:, :, 1:], weights, optimize=True)


@cache
def local_harmonics(degree: int) -> LocalHarmonics:
    """Those of a degree."""
    sizes, first, second = real_sizes(degree), derivatives(degree), derivatives(degree - 1)
    less, least = sizes[: degree**2], sizes[: (degree - 1) ** 2]
    slopes = _exact(first * sizes / less[:, None])
    bends = np.array([(second[j] * less / least[:, None]) @ slopes[i] for i, j in UPPER])
    return LocalHarmonics(degree, sizes, slopes, _exact(bends))


def _exact(matrix: Array) -> Array:
    """Without round-off: all entries are multiples of a quarter."""
    return np.round(4 * matrix) / 4


def _summed(matrix: Array, basis: Vector, strengths: Vector) -> hy.expression:
    """Σ matrix_jk basis_j strength_k, the strengths of each member of the basis first."""
    unit = float(np.abs(matrix[matrix != 0]).min())
    sums = [_combined([(row[k] / unit, strengths[int(k) - 1]) for k in np.flatnonzero(row)]) for row in matrix]
    used = [bool(row.any()) for row in matrix]
    return unit * hy.sum([b * s for b, s, there in zip(basis, sums, used, strict=True) if there])


def _combined(terms: list[tuple[float, hy.expression]]) -> hy.expression:
    """Σ factor · term: products with the same factor are shared by all sums, and cost less than differences."""
    return hy.sum([t if w == 1 else float(w) * t for w, t in terms])
