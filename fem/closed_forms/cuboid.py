"""Field of a uniformly polarised cuboid in closed form, with its gradient.

With half edges a, b, c, corner vectors (u, v, w) = position - (i a, j b, k c), i, j, k = ±1, and
r = |(u, v, w)|, a polarisation J gives B = T J with

    4π T_xx = Σ ijk atan2(v w, u r)          4π T_xy = Σ_ij ij Λ_z(i, j)

and the other entries by permutation.  Λ_z(i, j) = ∫ dw/r along an edge parallel to z of length L, whose
ends are at distances r1 and r2, is 2 atanh(L / (r1 + r2)).  This form has no singular point outside
the edge itself: the lines that extend it need no special case, and far away no digit is lost in it.
The gradient ∂_k T_ij is symmetric in all its indices and free of trace, so that derivatives of the
Λ and the sum of ijk/r over the corners give all of it, without any transcendental function.
Inside the cuboid the same formula gives μ0 H = B - J.

Formulas: potential of a uniformly charged segment and rectangle, e.g. O. D. Kellogg, Foundations of
Potential Theory (1929), ch. III; for magnets see Z. J. Yang et al., Supercond. Sci. Technol. 3 (1990) 591.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.common import Array
from ..harmonics.expressions import Number

Expression = Any  # A heyoka expression
SIGNS = (-1, 1)
FOUR_PI = 4 * np.pi


class _Corners:
    """Corner vectors and distances of one cuboid seen from one position, shared by all the sums."""

    def __init__(self, position: Sequence[Expression], half_edges: Sequence[Expression]) -> None:
        self.half_edges = half_edges
        self.offset = [{s: position[a] - s * self.half_edges[a] for s in SIGNS} for a in range(3)]
        square = [{s: d * d for s, d in axis.items()} for axis in self.offset]
        self.distance: dict[tuple[int, ...], Expression] = {
            (i, j, k): hy.sqrt(square[0][i] + square[1][j] + square[2][k]) for i, j, k in product(SIGNS, repeat=3)
        }
        self.inverse = {corner: 1.0 / r for corner, r in self.distance.items()}

    def edge(self, first: int, second: int, i: int, j: int) -> tuple[Expression, Expression]:
        """Of the edge parallel to the third axis with the signs i and j across the others: L / (r1 + r2), ∂Λ/∂u over u.

        u is a coordinate across the edge. Both are written with (r1 + r2)² - L² and one reciprocal.
        """
        third = 3 - first - second
        ends = []
        for k in SIGNS:
            key = [0, 0, 0]
            key[first], key[second], key[third] = i, j, k
            ends.append(tuple(key))
        reach, length = self.distance[ends[0]] + self.distance[ends[1]], 2 * self.half_edges[third]
        gap = reach * reach - length * length
        reciprocal, inverse_ends = 1.0 / (reach * gap), self.inverse[ends[0]] * self.inverse[ends[1]]
        return length * gap * reciprocal, -2.0 * length * inverse_ends * reach * reach * reciprocal

    def solid_angle(self, axis: int) -> Expression:
        """4π T_aa: difference of the solid angles of the two faces across `axis`.

        Σ_k k atan2(v w, u r) is taken as the angle of one product of complex numbers.
        """
        second, third, parts = (axis + 1) % 3, (axis + 2) % 3, []
        for i, j in product(SIGNS, repeat=2):
            across, v, ends = self.offset[axis][i], self.offset[second][j], []
            for k in SIGNS:
                key = [0, 0, 0]
                key[axis], key[second], key[third] = i, j, k
                ends.append((across * self.distance[tuple(key)], v * self.offset[third][k]))
            (real_before, imaginary_before), (real, imaginary) = ends
            angle = hy.atan2(
                imaginary * real_before - real * imaginary_before, real * real_before + imaginary * imaginary_before
            )
            parts.append(i * j * angle)
        return hy.sum(parts)

    def edges(self, first: int, second: int) -> tuple[Expression, Expression, Expression]:
        """4π T_ab for a ≠ b, Σ_ij ij Λ over the edges parallel to the third axis, and its derivatives along a and b.

        The four Λ become one inverse hyperbolic tangent by its addition theorem.
        """
        edges = {(i, j): self.edge(first, second, i, j) for i, j in product(SIGNS, repeat=2)}
        lower, upper = (_difference((edges[i, 1][0], 1.0), (edges[i, -1][0], 1.0)) for i in SIGNS)
        numerator, denominator = _difference(upper, lower)
        slopes = {(i, j): i * j * slope for (i, j), (_, slope) in edges.items()}
        return (
            2.0 * hy.atanh(numerator / denominator),
            hy.sum([slope * self.offset[first][i] for (i, _), slope in slopes.items()]),
            hy.sum([slope * self.offset[second][j] for (_, j), slope in slopes.items()]),
        )


def cuboid_field(
    position: Sequence[Expression], half_edges: Array, polarization: Array, number: Number = float
) -> tuple[list[Expression], list[list[Expression]]]:
    """B and its gradient of a uniformly polarised cuboid, in the cuboid's own axes.

    Parameters
    ----------
    position : three expressions, m, from the centre along the body axes
    half_edges : (3,) m
    polarization : (3,) T; only its non-zero components cost anything
    number : how these numbers are written

    Returns
    -------
    field : three values, T
    gradient : 3 × 3 values, [i][j] = ∂B_i/∂x_j, T/m; symmetric and traceless

    Accuracy: round-off of the largest terms. The terms cancel as the distance grows, so that it is 1e-15 of B beside
    the cuboid and grows as (distance/size)²: 1e-12 at a hundred sizes.
    """
    strength = {axis: number(p / FOUR_PI) for axis, p in enumerate(polarization) if p}
    zero = hy.expression(0.0)
    if not strength:
        return [zero] * 3, [[zero] * 3 for _ in range(3)]
    corners = _Corners(position, [number(half) for half in half_edges])
    second: dict[tuple[int, ...], Expression] = {(axis, axis): corners.solid_angle(axis) for axis in strength}
    third: dict[tuple[int, ...], Expression] = {
        (0, 1, 2): hy.sum([-float(i * j * k) * inverse for (i, j, k), inverse in corners.inverse.items()])
    }
    for a, b in ((0, 1), (0, 2), (1, 2)):
        if a in strength or b in strength:
            second[a, b], third[a, a, b], third[a, b, b] = corners.edges(a, b)
    for axis in strength:
        b, c = (other for other in range(3) if other != axis)
        third[axis, axis, axis] = -third[_sorted(axis, b, b)] - third[_sorted(axis, c, c)]
    field = [hy.sum([s * second[_sorted(axis, i)] for axis, s in strength.items()]) for i in range(3)]
    gradient = [
        [hy.sum([s * third[_sorted(axis, i, j)] for axis, s in strength.items()]) for j in range(3)] for i in range(3)
    ]
    return field, gradient


def _difference(a: tuple[Expression, Expression], b: tuple[Expression, Expression]) -> tuple[Expression, Expression]:
    """Of fractions (numerator, denominator): artanh a - artanh b = artanh of this."""
    return a[0] * b[1] - b[0] * a[1], a[1] * b[1] - a[0] * b[0]


def _sorted(*indices: int) -> tuple[int, ...]:
    return tuple(sorted(indices))


CORNER_SIGNS = (1, -1)
Signs = tuple[int, ...]
NEXT_TO_ONE = 1 - 2**-53  # where round-off puts a point on an edge, its Λ stays finite


def _seen(points: Array, half_edges: Array) -> tuple[list[dict[int, Array]], dict[Signs, Array], dict[Signs, Array]]:
    """Offsets and distances (n,) of the eight corners from points (n, 3), and Λ = ∫ ds/r of the twelve edges.

    Corners and edges are named by their signs along x, y and z, an edge's own axis by 0.
    """
    offset = [{s: points[:, axis] + s * half_edges[axis] for s in CORNER_SIGNS} for axis in range(3)]
    square = [{s: values**2 for s, values in one.items()} for one in offset]
    distance: dict[Signs, Array] = {}
    for i, j, k in product(CORNER_SIGNS, repeat=3):
        distance[i, j, k] = np.sqrt(square[0][i] + square[1][j] + square[2][k])
    edges: dict[Signs, Array] = {}
    for axis, first, second in product(range(3), CORNER_SIGNS, CORNER_SIGNS):
        ends = distance[_corner(axis, 1, first, second)] + distance[_corner(axis, -1, first, second)]
        edges[_corner(axis, 0, first, second)] = 2 * np.arctanh(np.minimum(2 * half_edges[axis] / ends, NEXT_TO_ONE))
    return offset, distance, edges


def _face_integrals(points: Array, half_edges: Array) -> dict[tuple[int, int], Array]:
    """∫ dS/r (n,), m, over each face (axis, side) of a cuboid, seen from points (n, 3), m, along its axes."""
    offset, distance, edges = _seen(points, half_edges)
    found = {}
    for axis, side in product(range(3), CORNER_SIGNS):
        second, third = (axis + 1) % 3, (axis + 2) % 3
        height = np.abs(offset[axis][-side])
        total = np.zeros_like(height)
        for s in CORNER_SIGNS:
            total += s * offset[second][s] * edges[_corner(axis, -side, s, 0)]
            total += s * offset[third][s] * edges[_corner(axis, -side, 0, s)]
            up, down = (distance[_corner(axis, -side, s, k)] for k in CORNER_SIGNS)
            # Σ_k k atan2(v w_k, height r_k), as the angle of one product of complex numbers
            v, w = offset[second][s], offset[third]
            real = height**2 * up * down + v**2 * w[1] * w[-1]
            total -= s * height * np.arctan2(v * height * (w[1] * down - w[-1] * up), real)
        found[axis, side] = total
    return found


def _corner(axis: int, along: int, second: int, third: int) -> Signs:
    """Signs along x, y and z of those along an axis and the two that follow it in turn."""
    found = [0, 0, 0]
    found[axis], found[(axis + 1) % 3], found[(axis + 2) % 3] = along, second, third
    return tuple(found)


def cuboid_tensor(points: Array, half_edges: Array) -> Array:
    """T (n, 3, 3) with μ0 H = T J of a polarisation J at `points` (n, 3), m, along a cuboid's axes, off its edges."""
    offset, distance, edges = _seen(points, half_edges)
    tensor = np.zeros((len(points), 3, 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        for signs, r in distance.items():
            u, v, w = (offset[axis][signs[axis]] for axis in (a, b, c))
            with np.errstate(divide="ignore", invalid="ignore"):  # on a face the mean of both sides
                tensor[:, a, a] -= np.prod(signs) * np.nan_to_num(np.arctan(v * w / (u * r)))
        tensor[:, a, b] = sum(i * j * edges[_corner(c, 0, i, j)] for i, j in product(CORNER_SIGNS, repeat=2))
        tensor[:, b, a] = tensor[:, a, b]
    return tensor / FOUR_PI


def attraction(points: Array, half_edges: Array) -> Array:
    """∫ (x - x')/|x - x'|³ dV' (n, 3), m, at `points` (n, 3), m, from the centre of a cuboid along its axes."""
    faces = _face_integrals(points, half_edges)
    return np.stack([faces[axis, 1] - faces[axis, -1] for axis in range(3)], axis=1)


def newton_potential(points: Array, half_edges: Array) -> Array:
    """∫ dV'/|x - x'| (n,), m², at `points` (n, 3), m, from the centre of a cuboid along its axes."""
    faces = _face_integrals(points, half_edges)
    parts = [0.5 * (half_edges[axis] - side * points[:, axis]) * faces[axis, side] for axis, side in faces]
    return np.asarray(np.sum(parts, axis=0))
