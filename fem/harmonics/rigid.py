"""Multipoles of a rigid body in a field without sources: their energy, and what turning and moving do to it.

In the real harmonics R_k of `regular_harmonics`, in the order of `members`, with lengths in a unit a, a field is
B = -∇u, u = Σ A_k R_k(r/a), and a body of dipoles p and charges q at places s has the multipoles

    M_k = Σ p·∇R_k(s/a) + Σ q R_k(s/a),        U = Σ A_k M_k,

U = -Σ Q_l · ∇^(l-1) B degree by degree.  A small turn δ makes δM = δ·G M, a change of place δA = δ·Dᵀ A; a field about
another place is A_k = Σ P_kn R_n(ξ) of its distance ξ.  All matrices are known from polynomials at a few places.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array, even_directions
from .interior import Ball, interior_coefficients, real_basis, real_weights
from .solid import members, regular_values


def harmonics(degree: int, points: Array) -> tuple[Array, Array]:
    """R_k (n, K) and their gradients (n, K, 3) at points (n, 3), up to a degree."""
    complex_ones = regular_values(degree, *np.ascontiguousarray(points.T))
    zero, sizes = np.zeros(len(points), complex), real_basis(degree)[1]
    values, slopes = [], []

    def known(l: int, m: int) -> NDArray[np.complex128]:
        if l < 0 or abs(m) > l:
            return zero
        return np.asarray((-1.0) ** m * np.conj(complex_ones[l, -m]) if m < 0 else complex_ones[l, m])

    for l, m, imaginary in members(degree):
        upper, lower = known(l - 1, m + 1), known(l - 1, m - 1)
        parts = known(l, m), (upper - lower) / 2, (upper + lower) / 2j, known(l - 1, m)
        value, *slope = ((part.imag if imaginary else part.real) / sizes[l, m] for part in parts)
        values.append(value)
        slopes.append(np.stack(slope, axis=1))
    return np.stack(values, axis=1), np.stack(slopes, axis=1)


@cache
def shells(degree: int) -> NDArray[np.intp]:
    """(K,) degree l of each member."""
    return np.array([l for l, _, _ in members(degree)])


@cache
def sizes(degree: int) -> Array:
    """(K,) root mean square of each R_k on the unit sphere: of R_k over these a turn is a rotation."""
    return np.asarray(np.sqrt(np.mean(harmonics(degree, even_directions(4000))[0] ** 2, axis=0)))


@cache
def matrices(degree: int) -> tuple[Array, Array]:
    """D (3, K, K) with ∂R = D R, and G (3, K, K) with (e × r)·∇R = G R for turns about each axis e."""
    points = even_directions(6 * (degree + 1) ** 2) * np.linspace(0.4, 1.0, 6 * (degree + 1) ** 2)[:, None]
    values, slopes = harmonics(degree, points)
    turned = np.stack([np.einsum("ni,nki->nk", np.cross(axis, points), slopes) for axis in np.eye(3)])
    l, found = shells(degree), []
    for wanted, less in ((np.moveaxis(slopes, 2, 0), 1), (turned, 0)):
        one = np.zeros((3, len(l), len(l)))
        for degree_here in range(degree + 1):
            rows, columns = np.flatnonzero(l == degree_here), np.flatnonzero(l == degree_here - less)
            if len(columns):
                solved = np.linalg.lstsq(values[:, columns], np.concatenate(wanted[:, :, rows], axis=1))[0]
                one[:, rows[:, None], columns] = solved.T.reshape(3, len(rows), len(columns))
        # round-off of the solutions, whose entries are small rational numbers
        found.append(np.where(np.abs(one) < 1e-11 * np.abs(one).max(), 0.0, one))
    return found[0], found[1]


def shifted(coefficients: Array, degree: int, way: int) -> Array:
    """Those of a field about places at ξ from the centre, (K, N): A_k = Σ P_kn R_n(ξ), n up to degree `way`.

    The field's own coefficients (K,) about the centre are up to a `degree`; A(ξ) = exp(ξ·Dᵀ) A is harmonic in ξ.
    """
    ways, solving = _ways(way)
    found = np.zeros((len(coefficients), (way + 1) ** 2))
    power = np.broadcast_to(coefficients, (len(ways), len(coefficients)))
    for j, solve in enumerate(solving):
        found[:, shells(way) == j] = (solve @ power).T
        power = sum(ways[:, [a]] * (power @ slope) for a, slope in enumerate(matrices(degree)[0])) / (j + 1)
    return found


@cache
def _ways(way: int) -> tuple[Array, list[Array]]:
    """Places (n, 3) all around, and what makes of values there their weights in the harmonics of each degree."""
    ways = even_directions(2 * (way + 1) ** 2)
    values = harmonics(way, ways)[0]
    return ways, [np.asarray(np.linalg.pinv(values[:, shells(way) == j]), float) for j in range(way + 1)]


def field_coefficients(
    evaluate: Callable[[Array], Array], center: Array, reach: float, degree: int, unit: float
) -> Array:
    """Coefficients A (K,) T m of a field, lengths in a unit.

    Parameters
    ----------
    evaluate : B (n, 3) T at points (n, 3) m
    center, reach : (3,) m and m, of the ball in which the field is known
    degree : highest
    unit : of lengths, m
    """
    found = real_weights(interior_coefficients(evaluate, Ball(center, reach), degree))
    return np.asarray(found * reach * (unit / reach) ** shells(degree))
