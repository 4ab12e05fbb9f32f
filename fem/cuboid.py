"""Field of a uniformly polarised cuboid in closed form, with its gradient.

With half edges a, b, c, corner vectors (u, v, w) = position - (i a, j b, k c), i, j, k = ±1, and
r = |(u, v, w)|, a polarisation J gives B = T J with

    4π T_xx = Σ ijk atan2(v w, u r)          4π T_xy = Σ_ij ij Λ_z(i, j)

and the other entries by permutation.  Λ_z(i, j) = ∫ dw/r along an edge parallel to z of length L, whose
ends are at distances r1 and r2, is 2 atanh(L / (r1 + r2)).  This form has no singular point outside
the edge itself: the lines that extend it need no special case, and far away no digit is lost in it.
The gradient ∂_k T_ij is symmetric in all its indices and free of trace, so that derivatives of the
Λ and the sum of ijk/r over the corners give all of it, without any transcendental function.
Inside the cuboid the same formula gives B = H + J.

Formulas: potential of a uniformly charged segment and rectangle, e.g. O. D. Kellogg, Foundations of
Potential Theory (1929), ch. III; for magnets see Z. J. Yang et al., Supercond. Sci. Technol. 3 (1990) 591.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np

from ..geometry.box import Array

Expression = Any
"""A heyoka expression."""
SIGNS = (-1, 1)
FOUR_PI = 4 * np.pi


class _Corners:
    """Corner vectors and distances of one cuboid seen from one position, shared by all the sums."""

    def __init__(self, position: Sequence[Expression], half_edges: Array) -> None:
        self.half_edges = [float(h) for h in half_edges]
        self.offset = [{s: position[a] - s * self.half_edges[a] for s in SIGNS} for a in range(3)]
        square = [{s: d * d for s, d in axis.items()} for axis in self.offset]
        self.distance: dict[tuple[int, ...], Expression] = {
            (i, j, k): hy.sqrt(square[0][i] + square[1][j] + square[2][k]) for i, j, k in product(SIGNS, repeat=3)
        }

    def edges(self, first: int, second: int) -> list[tuple[int, int, Expression, Expression]]:
        """The four edges parallel to the third axis: their two signs and the distances of both ends."""
        third = 3 - first - second
        found = []
        for i, j in product(SIGNS, repeat=2):
            ends = []
            for k in SIGNS:
                key = [0, 0, 0]
                key[first], key[second], key[third] = i, j, k
                ends.append(self.distance[tuple(key)])
            found.append((i, j, ends[0], ends[1]))
        return found

    def solid_angle(self, axis: int) -> Expression:
        """4π T_aa: difference of the solid angles of the two faces across `axis`."""
        second, third = (axis + 1) % 3, (axis + 2) % 3
        terms = []
        for signs, r in self.distance.items():
            across, v, w = (self.offset[a][signs[a]] for a in (axis, second, third))
            terms.append(signs[0] * signs[1] * signs[2] * hy.atan2(v * w, across * r))
        return hy.sum(terms)

    def edge_sum(self, first: int, second: int) -> Expression:
        """4π T_ab for a ≠ b: sum of Λ over the edges parallel to the third axis."""
        length = 2 * self.half_edges[3 - first - second]
        return hy.sum([i * j * 2.0 * hy.atanh(length / (r1 + r2)) for i, j, r1, r2 in self.edges(first, second)])

    def edge_gradients(self, first: int, second: int) -> tuple[Expression, Expression]:
        """Derivatives of `edge_sum` along `first` and along `second`."""
        length = 2 * self.half_edges[3 - first - second]
        along_first, along_second = [], []
        for i, j, r1, r2 in self.edges(first, second):
            reach = r1 + r2
            slope = (-2.0 * length * i * j) * reach / (r1 * r2 * (reach * reach - length * length))
            along_first.append(slope * self.offset[first][i])
            along_second.append(slope * self.offset[second][j])
        return hy.sum(along_first), hy.sum(along_second)

    def mixed(self) -> Expression:
        """4π ∂_z T_xy."""
        return hy.sum([(-float(i * j * k)) / r for (i, j, k), r in self.distance.items()])


def cuboid_field(
    position: Sequence[Expression], half_edges: Array, polarization: Array
) -> tuple[list[Expression], list[list[Expression]]]:
    """B and its gradient of a uniformly polarised cuboid, in the cuboid's own axes.

    Parameters
    ----------
    position : three expressions, m, from the centre along the body axes
    half_edges : (3,) m
    polarization : (3,) T; only its non-zero components cost anything

    Returns
    -------
    field : three values, T
    gradient : 3 × 3 values, [i][j] = ∂B_i/∂x_j, T/m; symmetric and traceless

    Accuracy: round-off of the largest terms. The terms cancel as the distance grows, so that it is 1e-15 of B beside
    the cuboid and grows as (distance/size)²: 1e-12 at a hundred sizes.
    """
    strength = {axis: float(p) / FOUR_PI for axis, p in enumerate(polarization) if p}
    zero = hy.expression(0.0)
    if not strength:
        return [zero] * 3, [[zero] * 3 for _ in range(3)]
    corners = _Corners(position, half_edges)
    second: dict[tuple[int, ...], Expression] = {(axis, axis): corners.solid_angle(axis) for axis in strength}
    third: dict[tuple[int, ...], Expression] = {(0, 1, 2): corners.mixed()}
    for a, b in ((0, 1), (0, 2), (1, 2)):
        if a in strength or b in strength:
            second[a, b] = corners.edge_sum(a, b)
            third[a, a, b], third[a, b, b] = corners.edge_gradients(a, b)
    for axis in strength:
        b, c = (other for other in range(3) if other != axis)
        third[axis, axis, axis] = -third[_sorted(axis, b, b)] - third[_sorted(axis, c, c)]
    field = [hy.sum([s * second[_sorted(axis, i)] for axis, s in strength.items()]) for i in range(3)]
    gradient = [
        [hy.sum([s * third[_sorted(axis, i, j)] for axis, s in strength.items()]) for j in range(3)] for i in range(3)
    ]
    return field, gradient


def _sorted(*indices: int) -> tuple[int, ...]:
    return tuple(sorted(indices))
