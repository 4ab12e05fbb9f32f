"""Polynomials in a ball as products of its harmonics with powers of r², which its field has computed anyway.

What bodies do to each other falls steeply with their distance, but much the same in all its parts: they are q⁻³ times
polynomials with one q of degree 2.  With degree 2 they err by a tenth of what polynomials of degree 3 alone do.
"""

from collections.abc import Sequence
from functools import cache

import heyoka as hy
import numpy as np

from ...fem.harmonics import regular_harmonics
from ...geometry.basics import Array, even_directions

NORMALS, RADII = 32, (0.35, 0.7, 1.0)
FALL = 3
"""Minus the power of q."""
ROWS, COLUMNS = np.triu_indices(3)


def fallen(inverse: hy.expression) -> hy.expression:
    """q⁻³ from 1/q."""
    return inverse * inverse * inverse


def polynomials(degree: int, offset: Sequence[hy.expression]) -> list[hy.expression]:
    """A basis of all polynomials up to a degree in the place in the ball (three expressions, radii); the first is 1."""
    square = hy.sum([t * t for t in offset])
    harmonics, found, power = regular_harmonics(degree, offset, square), [], hy.expression(1.0)
    for lowered in range(0, degree + 1, 2):
        found += [power * h if lowered else h for h in harmonics[: (degree - lowered + 1) ** 2]]
        power = power * square
    return found


def count(degree: int) -> int:
    """Of the polynomials."""
    return (degree + 1) * (degree + 2) * (degree + 3) // 6


@cache
def nodes() -> Array:
    """(n, 3) places in the unit ball at which functions are fitted."""
    normals = even_directions(NORMALS)
    return np.concatenate([np.zeros((1, 3)), *(radius * normals for radius in RADII)])


@cache
def fitting(degree: int) -> tuple[Array, Array]:
    """(count, n): weights by the values at the nodes; and (n, count): the values by the weights."""
    x = hy.make_vars("x", "y", "z")
    values = hy.cfunc(polynomials(degree, x), x, compact_mode=True, opt_level=0)(np.ascontiguousarray(nodes().T)).T
    return np.linalg.pinv(values), values


def falling(size: Array) -> tuple[Array, Array]:
    """Weights (10,) of q and q⁻³ (n,) for the size (n,) > 0, at the nodes, of what is told by it."""
    solve, basis = fitting(2)
    weights = solve @ (size / size[0]) ** (-1 / FALL)
    return weights, (basis @ weights) ** -FALL


def weighted_sum(first: int, basis: Sequence[hy.expression]) -> hy.expression:
    """Σ weight · basis, the weights being runtime parameters from number `first` on; the basis begins with 1."""
    return hy.sum([hy.par[first], *(hy.par[first + k] * p for k, p in enumerate(basis) if k)])


@cache
def derivatives(degree: int) -> Array:
    """(3 or 9, count): weights at the centre of the first derivatives and, xx, xy, xz, yy, yz, zz, of the second ones.

    By the weights of a polynomial of degree 1 or 2, which they tell.
    """
    x = hy.make_vars("x", "y", "z")
    tensors = hy.diff_tensors(polynomials(degree, x), diff_args=x, diff_order=1).jacobian
    function = hy.cfunc(list(np.asarray(tensors).ravel()), x, compact_mode=True, opt_level=0)
    slopes = function(np.ascontiguousarray(np.eye(4)[:3])).reshape(count(degree), 3, 4)  # along each axis, and in it
    first, second = slopes[..., 3], slopes[..., :3] - slopes[..., 3:]
    if degree == 1:
        return np.asarray(first.T)
    return np.concatenate([first.T, second[:, ROWS, COLUMNS].T])
