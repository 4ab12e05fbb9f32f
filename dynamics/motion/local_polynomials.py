"""Polynomials about a place, of which effects near it are made: their numbers are runtime parameters.

What bodies do to each other falls steeply with their distance, but much the same in all its parts: in a ball they are
q⁻³ times polynomials with one q of degree 2.  With degree 2 they err by a tenth of what polynomials of degree 3 alone
do.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.common import Array, even_directions

NORMALS, RADII = 32, (0.35, 0.7, 1.0)
FALL = 3  # Minus the power of q
COUNT = (1, 4, 10)  # Of the monomials up to a degree
PAIRS = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]  # Of the coordinates in the monomials of degree 2


def monomials(degree: int, offset: Sequence[Any], one: Any) -> list[Any]:
    """1, x, y, z, xx, xy, xz, yy, yz, zz up to a degree; `offset` (3) and `one` are expressions or arrays."""
    return [one, *offset, *(offset[a] * offset[b] for a, b in PAIRS)][: COUNT[degree]]


def polynomial(weights: Sequence[hy.expression], basis: Sequence[hy.expression]) -> hy.expression:
    """Σ weight · monomial, up to the degree that the number of weights says."""
    return hy.sum([weights[0], *(w * p for w, p in zip(weights[1:], basis[1:], strict=False))])


@cache
def nodes() -> Array:
    """(n, 3) places in the unit ball at which functions are fitted."""
    normals = even_directions(NORMALS)
    return np.concatenate([np.zeros((1, 3)), *(radius * normals for radius in RADII)])


@cache
def fitting(degree: int) -> tuple[Array, Array]:
    """(count, n): weights by the values at the nodes; and (n, count): the values by the weights."""
    values = np.array(monomials(degree, list(nodes().T), np.ones(len(nodes())))).T
    return np.linalg.pinv(values), values


def falling(size: Array) -> tuple[Array, Array]:
    """Weights (10,) of q and q⁻³ (n,) for the size (n,) > 0, at the nodes, of what is told by it."""
    solve, basis = fitting(2)
    weights = solve @ (size / size[0]) ** (-1 / FALL)
    return weights, (basis @ weights) ** -FALL
