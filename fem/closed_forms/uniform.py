"""Fields of uniformly polarised magnets in any pose, accurate near and far; cuboids in closed form.

With half edges a, b, c, corner vectors (u, v, w) = position - (i a, j b, k c), i, j, k = ±1, and
r = |(u, v, w)|, a polarisation J gives B = T J with

    4π T_xx = Σ ijk atan2(v w, u r)          4π T_xy = Σ_ij ij Λ_z(i, j)

and the other entries by permutation.  Λ_z(i, j) = ∫ dw/r along an edge parallel to z of length L, whose ends are at
distances r1 and r2, is 2 atanh(L / (r1 + r2)), singular on the edge alone.  The gradient ∂_k T_ij is symmetric in all
its indices and free of trace, so that derivatives of the Λ and the sum of ijk/r over the corners give all of it.
Inside the cuboid the same formula gives μ0 H = B - J.

Formulas: potential of a uniformly charged segment and rectangle, e.g. O. D. Kellogg, Foundations of
Potential Theory (1929), ch. III; for magnets see Z. J. Yang et al., Supercond. Sci. Technol. 3 (1990) 591.
"""

from collections.abc import Collection, Sequence
from functools import cache, cached_property
from itertools import combinations_with_replacement, product
from typing import Any

import heyoka as hy
import numpy as np
from scipy.linalg import block_diag

from ...geometry.common import MU_0, Array, InputError
from ...geometry.magnets import Magnet
from ...geometry.shapes import Box, Cylinder, Sphere
from ...geometry.solids import Part, Solid, moved
from ..compiled_code import compiled
from ..harmonics.expansion import MultipoleExpansion, turned_field, uniform_moments
from ..harmonics.expressions import FieldExpressions, Vector, differentiated, turned_expressions
from ..harmonics.solid import FOUR_PI, contracted, entries, tensors, turned_entries
from .round import BESIDE, outside_derivatives, round_slope, round_tensor, segments_field

Expression = Any  # A heyoka expression
Tensor = dict[tuple[int, ...], Expression]
SIGNS = (-1, 1)


class _Corners:
    """Corner vectors and distances of one cuboid seen from one position, shared by all the sums."""

    def __init__(self, position: Sequence[Expression], half_edges: Sequence[Expression]) -> None:
        self.half_edges = half_edges
        self.offset = [{s: position[a] - s * self.half_edges[a] for s in SIGNS} for a in range(3)]
        x, y, z = ({s: d * d for s, d in axis.items()} for axis in self.offset)
        corners = product(SIGNS, repeat=3)
        self.distance: Tensor = {(i, j, k): hy.sqrt(x[i] + y[j] + z[k]) for i, j, k in corners}
        self.inverse = {corner: 1.0 / r for corner, r in self.distance.items()}

    def edge(self, first: int, second: int, i: int, j: int) -> tuple[Expression, Expression]:
        """L / (r1 + r2) and (∂Λ/∂u)/u of the edge along the third axis, with signs i, j across the others."""
        third = 3 - first - second
        ends = [_corner((first, second, third), i, j, k) for k in SIGNS]
        reach, length = self.distance[ends[0]] + self.distance[ends[1]], 2 * self.half_edges[third]
        gap = reach * reach - length * length
        reciprocal, inverse_ends = 1.0 / (reach * gap), self.inverse[ends[0]] * self.inverse[ends[1]]
        return length * gap * reciprocal, -2.0 * length * inverse_ends * reach * reach * reciprocal

    def solid_angle(self, axis: int) -> Expression:
        """4π T_aa: difference of the solid angles of the faces across `axis`, angles of products of complex numbers."""
        axes, parts = (axis, (axis + 1) % 3, (axis + 2) % 3), []
        for i, j in product(SIGNS, repeat=2):
            across, v, w = (self.offset[a] for a in axes)
            ends = [(across[i] * self.distance[_corner(axes, i, j, k)], v[j] * w[k]) for k in SIGNS]
            (real, imaginary), (other, others) = ends
            parts.append(i * j * hy.atan2(others * real - other * imaginary, other * real + others * imaginary))
        return hy.sum(parts)

    def edges(self, first: int, second: int) -> tuple[Expression, Expression, Expression]:
        """4π T_ab for a ≠ b, Σ_ij ij Λ over edges as one artanh, and its derivatives along a and b."""
        edges = {(i, j): self.edge(first, second, i, j) for i, j in product(SIGNS, repeat=2)}
        lower, upper = (_difference((edges[i, 1][0], 1.0), (edges[i, -1][0], 1.0)) for i in SIGNS)
        numerator, denominator = _difference(upper, lower)
        slopes = {(i, j): i * j * slope for (i, j), (_, slope) in edges.items()}
        return (
            2.0 * hy.atanh(numerator / denominator),
            hy.sum([slope * self.offset[first][i] for (i, _), slope in slopes.items()]),
            hy.sum([slope * self.offset[second][j] for (_, j), slope in slopes.items()]),
        )


def _corner(axes: Sequence[int], *signs: int) -> tuple[int, ...]:
    """Signs along x, y and z of those along some axes."""
    return tuple(sign for _, sign in sorted(zip(axes, signs, strict=True)))


def _box_tensors(corners: _Corners, axes: Collection[int]) -> tuple[Tensor, Tensor]:
    """4π T_ij and 4π ∂T_ij/∂x_k, as far as a polarisation along some `axes` needs them, by ascending indices."""
    second: Tensor = {(axis, axis): corners.solid_angle(axis) for axis in axes}
    third: Tensor = {(0, 1, 2): hy.sum([-float(i * j * k) * inverse for (i, j, k), inverse in corners.inverse.items()])}
    for a, b in ((0, 1), (0, 2), (1, 2)):
        if a in axes or b in axes:
            second[a, b], third[a, a, b], third[a, b, b] = corners.edges(a, b)
    for axis in axes:
        b, c = (other for other in range(3) if other != axis)
        third[axis, axis, axis] = -third[_sorted(axis, b, b)] - third[_sorted(axis, c, c)]
    return second, third


def cuboid_field(
    position: Sequence[Expression], half_edges: Array, polarization: Array
) -> tuple[list[Expression], list[list[Expression]]]:
    """B (3) T of a uniformly polarised cuboid in its own axes, and [i][j] = ∂B_i/∂x_j (3 × 3) T/m.

    At a `position` (three expressions, m, from the centre) for `half_edges` (3,) m and a `polarization` (3,) T, of
    which only non-zero components cost anything. Terms cancel with distance: 1e-15 of B beside it, 1e-12 at a hundred
    sizes.
    """
    strength = {axis: float(p / FOUR_PI) for axis, p in enumerate(polarization) if p}
    zero = hy.expression(0.0)
    if not strength:
        return [zero] * 3, [[zero] * 3 for _ in range(3)]
    second, third = _box_tensors(_Corners(position, [float(half) for half in half_edges]), strength)

    def along(tensor: Tensor, *indices: int) -> Expression:
        return hy.sum([s * tensor[_sorted(axis, *indices)] for axis, s in strength.items()])

    return [along(second, i) for i in range(3)], [[along(third, i, j) for j in range(3)] for i in range(3)]


ALL = list(combinations_with_replacement(range(3), 2))  # Entries of T, whose trace is -1 inside


@cache
def _box_kernel(order: int) -> Any:
    """Compiled 4π T of a cuboid and its derivatives, (k, n), for places and half edges (6, n): one for all cuboids."""
    variables = hy.make_vars("x", "y", "z", "a", "b", "c")
    second, third = _box_tensors(_Corners(variables[:3], variables[3:]), range(3))
    known = {each: third[each] for each in entries(3)}
    outputs = [*(second[each] for each in ALL), *known.values(), *differentiated(known, variables[:3], order + 1)]
    return compiled(hy.cfunc, outputs, variables, fast_math=True)


def _from_kernel(polarization: Array, rotation: Array, order: int) -> Array:
    """Matrix (k, order (order + 2)) from outputs of `_box_kernel` to `entries` of B and derivatives, outer axes."""
    strength = polarization / FOUR_PI
    field = np.array([[strength[j] if i == k else strength[i] * (j == k) for k in range(3)] for i, j in ALL])
    parts = block_diag(field, *(contracted(degree + 1, strength) for degree in range(2, order + 1)))
    return parts if np.array_equal(rotation, np.eye(3)) else turned_entries(parts, rotation)


def _difference(a: tuple[Expression, Expression], b: tuple[Expression, Expression]) -> tuple[Expression, Expression]:
    """Of fractions (numerator, denominator): artanh a - artanh b = artanh of this."""
    return a[0] * b[1] - b[0] * a[1], a[1] * b[1] - a[0] * b[0]


def _sorted(*indices: int) -> tuple[int, ...]:
    return tuple(sorted(indices))


NEXT_TO_ONE = 1 - 2**-53  # where round-off puts a point on an edge, its Λ stays finite
NEXT, LAST = [1, 2, 0], [2, 0, 1]  # the two axes that follow each in turn


def _seen(points: Array, half_edges: Array) -> tuple[Array, list[Array], Array]:
    """Offsets (3, 2, n) of a cuboid's corners from points (n, 3) along each axis, distances, Λ = ∫ ds/r of its edges.

    All are by their signs, - first: the distances (2, 2, 2, n), once for each axis, by its own sign
    and those along its `NEXT` and `LAST`; the edges (3, 2, 2, n) along each axis by these two.
    """
    offset = points.T[:, None] + half_edges[:, None, None] * np.array(SIGNS)[:, None]
    x, y, z = offset**2
    distance = np.sqrt(x[:, None, None] + y[:, None] + z)
    turned = [distance.transpose(axis, NEXT[axis], LAST[axis], 3) for axis in range(3)]
    part = 2 * half_edges[:, None, None, None] / np.stack([up + down for down, up in turned])
    return offset, turned, 2 * np.arctanh(np.minimum(part, NEXT_TO_ONE))


def _face_integrals(points: Array, half_edges: Array) -> dict[tuple[int, int], Array]:
    """∫ dS/r (n,), m, over each face (axis, side) of a cuboid, seen from points (n, 3), m, along its axes."""
    offset, turned, edges = _seen(points, half_edges)
    found = {}
    for axis, side in product(range(3), SIGNS):
        second, third, other = NEXT[axis], LAST[axis], int(side < 0)
        height = np.abs(offset[axis, other])
        total = np.zeros_like(height)
        for k, s in enumerate(SIGNS):
            total += s * offset[second, k] * edges[third, other, k]
            total += s * offset[third, k] * edges[second, k, other]
            down, up = turned[axis][other, k]
            # Σ_k k atan2(v w_k, height r_k), as the angle of one product of complex numbers
            v, (low, high) = offset[second, k], offset[third]
            real = height**2 * up * down + v**2 * high * low
            total -= s * height * np.arctan2(v * height * (high * down - low * up), real)
        found[axis, side] = total
    return found


def cuboid_tensor(points: Array, half_edges: Array) -> Array:
    """T (n, 3, 3) with μ0 H = T J of a polarisation J at `points` (n, 3), m, along a cuboid's axes, off its edges."""
    (x, y, z), (distance, *_), edges = _seen(points, half_edges)
    tensor, axes = np.empty((len(points), 3, 3)), range(3)
    corners = np.empty((3, *distance.shape))
    corners[0], corners[1], corners[2] = x[:, None, None], y[:, None], z
    with np.errstate(divide="ignore", invalid="ignore"):  # on a face: its side towards + of that axis; 0/0 is 0
        angles = np.arctan(corners[NEXT] * corners[LAST] / (corners * distance))
    angles[np.isnan(angles)] = 0.0
    both = np.multiply.outer(SIGNS, SIGNS)
    tensor[:, axes, axes] = np.einsum("i,jk,aijkn->na", np.negative(SIGNS), both, angles)
    tensor[:, NEXT, LAST] = tensor[:, LAST, NEXT] = np.einsum("jk,ajkn->na", both, edges)
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


FAR = 5.0  # from this many circumradii on, moments are as exact as the closed form, whose terms cancel more and more
TENSORS = 50_000  # points at once of `remanent_field`, whose tensors would take gigabytes
FAR_DEGREE = 17  # the first moments left out are of degree 19 (the even ones of a box vanish): 5^-19 is 5e-14


class UniformField:
    """B and its gradient of a magnet with exactly its remanent polarisation (μr = 1), rotor's frame."""

    def __init__(self, magnet: Magnet) -> None:
        self.magnet = magnet

    def expressions(self, position: Vector) -> FieldExpressions:
        """Closed form at a position (three expressions, m), turned from the magnet's axes into the rotor's."""
        body, axes, polarization = self.magnet.body, self.magnet.body.rotation, self.magnet.polarization
        if isinstance(body, Sphere):
            return uniform_moments(self.magnet, 1).expressions(position)
        shifted = [position[i] - float(body.center[i]) for i in range(3)]
        along = shifted if np.array_equal(axes, np.eye(3)) else turned_expressions(axes.T, shifted)
        assert isinstance(body, Box | Cylinder)
        if isinstance(body, Box):
            found = cuboid_field(along, body.half_edges, polarization)
        else:
            found = segments_field(along, body, polarization)
        return found if along is shifted else turned_field(axes, found)

    @cached_property
    def _weights(self) -> dict[int, Array]:
        return {}

    @cached_property
    def _far(self) -> MultipoleExpansion:
        return uniform_moments(self.magnet, FAR_DEGREE)

    def derivatives(self, points: Array, order: int) -> Array:
        """B (T) outside, μ0 H inside, and its derivatives up to `order` - 1, by their `entries` (n, k), at (n, 3) m.

        1e-13 of cuboids and spheres, outside; of cylinders and rings 1e-9 from 0.01 radii on.
        """
        body, polarization = self.magnet.body, self.magnet.polarization
        if isinstance(body, Sphere):
            return self._far.derivatives(points, order)
        far = squared_distance(points.T, body.center) > (FAR * body.circumradius) ** 2
        found = np.empty((len(points), order * (order + 2)))
        if far.any():
            found[far] = self._far.derivatives(points[far], order)
        if not far.all():
            assert isinstance(body, Box | Cylinder)
            local = body.to_body(points[~far])
            if isinstance(body, Box):
                if order not in self._weights:
                    self._weights[order] = _from_kernel(polarization, body.rotation, order)
                given, weights = np.empty((6, len(local))), self._weights[order]
                given[:3], given[3:] = local.T, body.half_edges[:, None]
                found[~far] = _box_kernel(order)(given)[: len(weights)].T @ weights
            else:
                near = outside_derivatives(local, body, polarization, order)
                turned = not np.array_equal(body.rotation, np.eye(3))
                found[~far] = turned_entries(near, body.rotation) if turned else near
        return found

    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (n, 3) T outside, μ0 H inside, and its gradient, to 1e-13; off round magnets to 1e-10."""
        field, gradient = self._parts(points, 2)
        return field, gradient

    def field(self, points: Array) -> Array:
        """`evaluate`, without the gradient."""
        return self._parts(points, 1)[0]

    def _parts(self, points: Array, order: int) -> list[Array]:
        body = self.magnet.body
        if not isinstance(body, Cylinder | Sphere):
            return tensors(self.derivatives(points, order))
        # in a round magnet, or nearer than its segments do
        close = np.asarray(body.distance(points) < (0.0 if isinstance(body, Sphere) else BESIDE * body.radius))
        entries = np.zeros((len(points), order * (order + 2)))
        entries[~close] = self.derivatives(points[~close], order)
        found = tensors(entries)
        for part, rule in zip(found, (round_tensor, round_slope), strict=False) if close.any() else ():
            part[close] = rule(body, points[close]) @ self.magnet.polarization_in_rotor
        return found


def squared_distance(columns: Array, center: Array) -> Array:
    """Squared distances (n,) m² of `columns` (3, n) m from a point."""
    x, y, z = columns - center[:, None]
    return np.asarray(x * x + y * y + z * z)


def demagnetizing_tensor(body: Solid, points: Array) -> Array:
    """(n, 3, 3): H = T J (T) at points (n, 3) m, off the body's edges, of a polarisation J; frame of the points."""
    if isinstance(body, Part):
        raise InputError(
            "Input rotor must have no part from a file where closed forms are asked for; instead it has one. "
            "Choose --model fem and --interaction rigid."
        )
    if isinstance(body, Box):
        tensor = cuboid_tensor(body.to_body(points), body.half_edges)
        return np.asarray(body.rotation @ tensor @ body.rotation.T)
    return round_tensor(body, points)


def remanent_field(magnets: Sequence[Magnet], points: Array) -> Array:
    """μ0 H (n, 3) T of magnets with μr = 1 at points (n, 3) m, off their edges."""
    found = np.zeros_like(points)
    for magnet in (magnet for magnet in magnets if magnet.polarization.any()):
        home = moved(magnet.body, np.zeros(3), np.eye(3))
        for here in (slice(start, start + TENSORS) for start in range(0, len(points), TENSORS)):
            tensor = demagnetizing_tensor(home, magnet.body.to_body(points[here]))
            found[here] += tensor @ magnet.polarization @ magnet.body.rotation.T
    return found


def remanent_potential(magnets: Sequence[Magnet], points: Array) -> Array:
    """Potential (n,) T m of cuboids with μr = 1 at points (n, 3) m; continuous everywhere, as t log t at an edge."""
    boxes = [attraction(m.box.to_body(points), m.box.half_edges) @ m.polarization for m in magnets]
    return np.asarray(sum(boxes)) / FOUR_PI


Fields = tuple[Array, Array]  # H and M, each (n, 3) A/m; B = μ0 (H + M)


def fields_of_magnets(magnets: Sequence[Magnet], points: Array) -> Fields:
    """H of cuboids' remanent polarisation J at points (n, 3) m off their edges, and M, J/μ0 + (μr - 1) H inside.

    The H of the second part of M is left out, of the order of μr - 1 (`closed_form_error`).
    """
    h = remanent_field(magnets, points) / MU_0
    magnetization = np.zeros_like(h)
    for magnet in magnets:
        inside = magnet.body.distance(points) <= 0
        magnetization[inside] = magnet.polarization_in_rotor / MU_0
        magnetization[inside] += h[inside] @ (magnet.permeability_in_rotor - np.eye(3)).T
    return h, magnetization


def closed_form_error(magnets: Sequence[Magnet]) -> float:
    """Estimated error of `fields_of_magnets`, relative to the field: the largest μr - 1."""
    return max((magnet.contrast for magnet in magnets), default=0.0)


def fields_of_sphere(moment: Array, center: Array, radius: float, points: Array) -> Fields:
    """H and M of a sphere of a uniform `moment`, `center` and `radius`, A m² and m, at `points` (n, 3) m."""
    away = points - center
    distance = np.linalg.norm(away, axis=1)[:, None]
    within = distance <= radius
    magnetization = np.where(within, moment / (4 / 3 * np.pi * radius**3), 0.0)
    unit = away / np.maximum(distance, radius)  # of length 1 outside, where it is used
    outside = (3 * unit * (unit @ moment)[:, None] - moment) / (FOUR_PI * np.maximum(distance, radius) ** 3)
    return np.where(within, -magnetization / 3, outside), magnetization
