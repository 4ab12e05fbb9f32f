"""A permeable magnet by charges on its surface: boundary elements, one graded panel a face; see `surface_charges`.

The charge σ = n·μ0 M solves (docs/mathematics.md), with b the field μ0 H of sources elsewhere,

    (1 + χ/2) σ - χ K σ = n·J + χ n·b,        (K σ)(x) = 1/4π ∫ σ(y) n·(x - y)/|x - y|³ dS.

The closed form of uniform carriers is split off, so that a σ of order χ is left, with logarithms at the edges.  K from
face to face of a body, or of two that are near each other, integrates the product of σ's polynomial and the kernel,
with a hyperbolic sine about the nearest place; from afar the nodes' own rule does.  Errors fall about as n⁻⁷ with the
number n of nodes along an edge, of up to eight as n⁻⁴.

O. D. Kellogg, Foundations of Potential Theory (1929), ch. VI; P. R. Johnston and D. Elliott, Int. J. Numer. Meth. Eng.
62 (2005) 564, for the hyperbolic sine.
"""

from collections.abc import Callable, Sequence
from functools import cache, cached_property
from itertools import combinations, product
from typing import Any

import numpy as np
import scipy.linalg
from numpy.polynomial.chebyshev import chebvander

from ...geometry.common import Array
from ...geometry.magnets import Magnet
from ...geometry.overlap import separation
from ...geometry.shapes import Box, Cylinder, Sphere
from ...geometry.solids import Solid
from ..closed_forms.moments import parallel
from ..harmonics.interior import sphere
from ..harmonics.solid import FOUR_PI, gauss_legendre, members, orthonormal

INSET = 1e-10  # of the smallest edge: how far inside of a face closed forms are taken, and what counts as on a face
# Distance from a face, in edges by their nodes, from which on the nodes' own rule does, to exp(-2π 4/1.2) = 1e-9
APART, APART_OF_FEW = 4.0, 0.75  # of few, by 2e-2 of a field that is itself a few per cent of the carriers'
# Nodes along an edge up to which a face's middle needs them more: four of a cube err by 3e-4, crowding by 2e-3
FEW = 8
MORE = 2  # times as many nodes along an edge for moments as for charges
KINKS = 0.2  # gap, in edges, from which on a neighbour's edges make no kink in the charges
FINE = 10  # nodes of the rule for a product beyond those along an edge
ROWS = 1 << 20  # numbers at once in such a rule
TOGETHER = 1e-14  # square of a distance, by those from the axes' origin, below which two nodes are one
ROUND_OFF = 1e-13  # of a line's half: no place is nearer to a node than that
COARSE = (4, 2)  # of Gauss's places along an edge that stand for all nodes at each of two distances; fewer do for few
WIDEST = 3.0  # scale of the hyperbolic sine of an angle, so that it is one near the axis, too


@cache
def graded(count: int) -> tuple[Array, Array]:
    """Places x (n,) = sin(π/2 sin(π/2 u)) at Gauss's u, or up to `FEW` sin(π/2 u), and weights of ∫ dx."""
    u, weights = gauss_legendre(count)
    if count <= FEW:
        return np.sin(np.pi / 2 * u), weights * np.pi / 2 * np.cos(np.pi / 2 * u)
    inner = np.pi / 2 * np.sin(np.pi / 2 * u)
    return np.sin(inner), weights * (np.pi / 2) ** 2 * np.cos(inner) * np.cos(np.pi / 2 * u)


@cache
def _to_nodes(count: int) -> Array:
    """(n, n): Lagrange's polynomials at Gauss's nodes by Legendre's."""
    u, weights = gauss_legendre(count)
    return np.asarray((np.arange(count) + 0.5)[:, None] * np.polynomial.legendre.legvander(u, count - 1).T * weights)


def _lagrange(places: Array, count: int) -> Array:
    """(..., n): Lagrange's polynomials in u, for the nodes of `graded`, at places x (...,)."""
    u = 2 / np.pi * np.arcsin(np.clip(places, -1.0, 1.0))
    if count > FEW:
        u = 2 / np.pi * np.arcsin(u)
    return np.asarray(np.polynomial.legendre.legvander(u, count - 1) @ _to_nodes(count))


def _about(place: Array, scale: Array, half: float, count: int) -> tuple[Array, Array, Array]:
    """Places (..., m), weights, distances of a rule from -half to half, fine about `place` and at both ends."""
    x, weights = graded(count)
    low, high = np.arcsinh((-half - place) / scale)[..., None], np.arcsinh((half - place) / scale)[..., None]
    angle = (low + high) / 2 + (high - low) / 2 * x
    distance = scale[..., None] * np.cosh(angle)
    return place[..., None] + scale[..., None] * np.sinh(angle), (high - low) / 2 * weights * distance, distance


def face_rows(places: Array, normals: Array, halves: Array, counts: tuple[int, int]) -> Array:
    """n·h (T) at places off the plane of a rectangle by charges (T) at its n × m = `counts` nodes: weights (t, n m).

    `places`, `normals` (t, 3) are along its edges and normal, from its middle; `halves`: (2,) half edges.
    """
    (first, second), result = counts, np.empty((len(places), *counts))
    step = max(1, ROWS // ((first + FINE) * (second + FINE) * second))
    for start in range(0, len(places), step):
        some = slice(start, start + step)
        (p, q, d), (a, b, c) = places[some].T, normals[some].T
        s, wide, beside = _about(p, np.abs(d), float(halves[0]), first + FINE)
        t, tall, distance = _about(np.broadcast_to(q[:, None], beside.shape), beside, float(halves[1]), second + FINE)
        across = (a[:, None] * (p[:, None] - s) + (c * d)[:, None])[..., None]
        across = across + b[:, None, None] * (q[:, None, None] - t)
        along = ((across * tall / distance**3)[..., None, :] @ _lagrange(t / halves[1], second))[..., 0, :]
        result[some] = np.swapaxes(_lagrange(s / halves[0], first), 1, 2) @ (along * wide[..., None])
    return result.reshape(len(places), first * second) / FOUR_PI


def far_rows(places: Array, normals: Array, sources: Array, areas: Array) -> Array:
    """As `face_rows`, by the rule of the nodes alone: `sources` (n, 3) with `areas` (n,)."""
    found, step = np.empty((len(places), len(sources))), max(1, ROWS // len(sources))
    for start in range(0, len(places), step):
        some = slice(start, start + step)
        sizes = np.sum(places[some] ** 2, axis=1)[:, None] + np.sum(sources**2, axis=1)
        square = sizes - 2 * places[some] @ sources.T
        # a place on a node, of a body that touches, sees nothing of it: both are in one plane
        inverse = np.divide(1.0, square, out=np.zeros_like(square), where=square > TOGETHER * sizes)
        inverse *= np.sqrt(inverse)
        inverse *= np.sum(places[some] * normals[some], axis=1)[:, None] - normals[some] @ sources.T
        found[some] = inverse * (areas / FOUR_PI)
    return found


@cache
def _from_gauss(nodes: int, count: int) -> Array:
    """(nodes, count): Lagrange's polynomials at `count` of Gauss's nodes, at the places of `graded`."""
    return np.asarray(np.polynomial.legendre.legvander(graded(nodes)[0], count - 1) @ _to_nodes(count))


def _around(angles: Array, count: int) -> Array:
    """(n, 2 count): trigonometric interpolation between 2 count angles that begin at 0, at `angles` (n,)."""
    orders, turns = np.arange(count + 1), 2 * count
    values = np.cos(orders[:, None, None] * (angles[:, None] - 2 * np.pi * np.arange(turns) / turns))
    values[1:-1] *= 2
    return np.asarray(values.sum(axis=0) / turns)


class Surface:
    """Nodes on a body's surface: `places` (n, 3) m, outward `normals` (n, 3) and `areas` (n,) m², body's axes.

    Nearer than `reach` (m) `rows_nearby` does what the nodes' rule does not; 0: more nodes show how well it does.
    """

    places: Array
    normals: Array
    areas: Array
    count: int
    reach = 0.0

    @cached_property
    def kernel(self) -> Array:
        """K (n, n) of the body alone."""
        raise NotImplementedError

    @cached_property
    def seen(self) -> list[tuple[Array, Array, Any]]:
        """Places and normals (k, 3) for near and at two distances, and nodes' values (n, k) by theirs (None: all)."""
        counts = [min(most, max(self.count // 3, 1) + 1 - far) for far, most in enumerate(COARSE)]
        return [(self.places, self.normals, None), *map(self._fewer, counts)]

    def _fewer(self, count: int) -> tuple[Array, Array, Array]:
        """One of `seen`, with so many places along an edge."""
        raise NotImplementedError

    def rows_nearby(self, places: Array, normals: Array) -> Array:
        """n·h (T) of the charges at places outside the body or on it, (t, n); by the nodes' own rule."""
        return far_rows(places, normals, self.places, self.areas)

    def refined(self, charges: Array) -> tuple[Array, Array]:
        """More places (k, 3), for high moments, and what is there (k,) of the charges (n,) T by their areas."""
        return self.places, self.areas * charges


class _BoxSurface(Surface):
    """Of a cuboid, face by face: on those at -x, x, -y, y, -z and z, with more nodes along longer edges."""

    def __init__(self, body: Box, count: int) -> None:
        self.half, self.count = body.half_edges, count
        self.counts = [round(count * np.sqrt(half / self.half.min())) for half in self.half]
        self.apart = APART if count > FEW else APART_OF_FEW
        self.reach = self.apart * float(np.max(2 * self.half / self.counts))
        self.places, self.normals, self.areas = self._faces([graded(n) for n in self.counts])
        self.numbers, total = {}, 0  # of the nodes
        for axis, side in product(range(3), (-1, 1)):
            first, second = (self.counts[k] for k in self._order(axis)[:2])
            self.numbers[axis, side] = total + np.arange(first * second).reshape(first, second)
            total += first * second

    @staticmethod
    def _order(axis: int) -> list[int]:
        return [(axis + 1) % 3, (axis + 2) % 3, axis]

    def _faces(self, rules: Sequence[tuple[Array, Array]]) -> tuple[Array, Array, Array]:
        """Places and normals (n, 3) and areas (n,) on all faces, of `rules` along the axes in half edges."""
        places, normals, areas = [], [], []
        for axis, side in product(range(3), (-1.0, 1.0)):
            first, second, _ = self._order(axis)
            (x, wide), (y, tall) = rules[first], rules[second]
            face = np.empty((len(x), len(y), 3))
            face[..., axis] = side * self.half[axis]
            face[..., first], face[..., second] = self.half[first] * x[:, None], self.half[second] * y
            places.append(face.reshape(-1, 3))
            normals.append(np.broadcast_to(side * np.eye(3)[axis], places[-1].shape))
            areas.append((self.half[first] * self.half[second] * np.outer(wide, tall)).ravel())
        return np.concatenate(places), np.concatenate(normals), np.concatenate(areas)

    def _face(self, axis: int, side: int, places: Array) -> tuple[list[int], Array, Array, tuple[int, int]]:
        """A face's axes and normal as an order, places as it sees them, its half edges, and its counts of nodes."""
        order = self._order(axis)
        seen = places[:, order] - [0, 0, side * self.half[axis]]
        return order, seen, self.half[order[:2]], (self.counts[order[0]], self.counts[order[1]])

    @cached_property
    def kernel(self) -> Array:
        """K (n, n); what mirrors and, of a cube, turns of the body make of each other is computed once."""
        total = len(self.places)
        result, everything = np.zeros((total, total)), np.arange(total)
        mirrors = np.empty((3, total), int)  # the nodes' images at the plane across each axis
        for axis, ((across, side), mine) in product(range(3), self.numbers.items()):
            along = self._order(across).index(axis)
            mirrors[axis, mine] = self.numbers[across, -side] if across == axis else np.flip(mine, along)
        cube = np.ptp(self.half) <= INSET * self.half[0]
        for axis in range(1 if cube else 3):
            order, seen, halves, counts = self._face(axis, -1, self.places)
            chosen, face = np.flatnonzero((seen >= 0).all(axis=1) & (seen[:, 2] > 0)), self.numbers[axis, -1].ravel()
            rows = face_rows(seen[chosen], self.normals[chosen][:, order], halves, counts)
            for which in product((False, True), repeat=3):
                image = everything
                for mirror, used in zip(mirrors, which, strict=True):
                    image = mirror[image] if used else image
                for turn in range(3 if cube else 1):
                    turned = (image + turn * total // 3) % total
                    result[np.ix_(turned[chosen], turned[face])] = rows
        return result

    def _fewer(self, count: int) -> tuple[Array, Array, Array]:
        places, normals, _ = self._faces([gauss_legendre(count)] * 3)
        along = [_from_gauss(nodes, count) for nodes in self.counts]
        shares = np.zeros((len(self.places), len(self.numbers), count**2))
        for face, ((axis, _), numbers) in enumerate(self.numbers.items()):
            first, second, _ = self._order(axis)
            # a face's nodes by its places: the product of both edges' polynomials
            shares[numbers.ravel(), face] = np.einsum("ia,jb->ijab", along[first], along[second]).reshape(-1, count**2)
        return places, normals, shares.reshape(len(shares), -1)

    def refined(self, charges: Array) -> tuple[Array, Array]:
        rules, amounts = [graded(MORE * n) for n in self.counts], []
        between = [_lagrange(x, n) for (x, _), n in zip(rules, self.counts, strict=True)]
        for (axis, _), numbers in self.numbers.items():
            first, second, _ = self._order(axis)
            amounts.append((between[first] @ charges[numbers] @ between[second].T).ravel())
        places, _, areas = self._faces(rules)
        return places, areas * np.concatenate(amounts)

    def rows_nearby(self, places: Array, normals: Array) -> Array:
        result = np.empty((len(places), len(self.places)))
        for (axis, side), numbers in self.numbers.items():
            (order, seen, halves, counts), mine = self._face(axis, side, places), numbers.ravel()
            beyond = np.maximum(np.abs(seen) - [*halves, 0.0], 0)
            near = np.linalg.norm(beyond, axis=1) < self.apart * np.max(2 * halves / counts)
            off = np.abs(seen[:, 2]) > INSET * self.half.max()
            rows = face_rows(seen[near & off], normals[near & off][:, order], halves, counts)
            result[np.ix_(near & off, mine)] = rows
            result[np.ix_(near & ~off, mine)] = 0.0
            apart = far_rows(places[~near], normals[~near], self.places[mine], self.areas[mine])
            result[np.ix_(~near, mine)] = apart
            on = near & ~off & (beyond[:, :2] == 0).all(axis=1)  # of a body that touches: the charges' own jump
            along, across = (_lagrange(seen[on, i] / halves[i], counts[i]) for i in range(2))
            jump = 0.5 * side * normals[on, axis, None] * along
            result[np.ix_(on, mine)] = (jump[:, :, None] * across[:, None]).reshape(-1, len(mine))
        return result


class _RoundSurface(Surface):
    """Of a cylinder or ring: n nodes along each line of its section, 2 n around."""

    def __init__(self, body: Cylinder, count: int, rule: tuple[Array, Array] | None = None) -> None:
        half, outer, inner = body.height / 2, body.radius, body.inner_radius
        self.body, self.count = body, count
        # middle and half way of each line (r, z), and its normal
        face, wall = (outer + inner) / 2, ((outer - inner) / 2, 0.0)
        lines = [((outer, 0.0), (0.0, half), (1.0, 0.0)), *(((face, s * half), wall, (0.0, s)) for s in (-1.0, 1.0))]
        lines += [((inner, 0.0), (0.0, half), (-1.0, 0.0))] if inner else []
        self.lines = [(np.array(middle), np.array(way), np.array(normal)) for middle, way, normal in lines]
        (x, weights), turns = rule or graded(count), 2 * count
        self.section = np.concatenate([middle + x[:, None] * way for middle, way, _ in self.lines])
        across = np.concatenate([np.broadcast_to(normal, (count, 2)) for _, _, normal in self.lines])
        widths = np.concatenate([weights * np.linalg.norm(way) for _, way, _ in self.lines])
        angle = 2 * np.pi * np.arange(turns) / turns
        turned = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        self.places, self.normals = (
            (r[:, None, None] * turned + z[:, None, None] * [0.0, 0.0, 1.0]).reshape(-1, 3)
            for r, z in (self.section.T, across.T)
        )
        self.section_normals = across
        self.areas = np.repeat(widths * self.section[:, 0] * 2 * np.pi / turns, turns)
        self.reach = INSET * body.circumradius  # of bodies that touch

    def _fewer(self, count: int) -> tuple[Array, Array, Array]:
        few = _RoundSurface(self.body, count, gauss_legendre(count))
        along = scipy.linalg.block_diag(*[_from_gauss(self.count, count)] * len(self.lines))
        return few.places, few.normals, np.kron(along, _around(np.pi * np.arange(2 * self.count) / self.count, count))

    def rows_nearby(self, places: Array, normals: Array) -> Array:
        """The nodes' own rule, and the charges' own jump on flat faces that touch."""
        result = super().rows_nearby(places, normals)
        radius = np.hypot(places[:, 0], places[:, 1])
        around, size = _around(np.arctan2(places[:, 1], places[:, 0]), self.count), 2 * self.count**2
        for number, (middle, way, normal) in enumerate(self.lines):
            if normal[1]:
                x = (radius - middle[0]) / way[0]
                on = (np.abs(places[:, 2] - middle[1]) <= self.reach) & (np.abs(x) <= 1)
                jump = 0.5 * normal[1] * normals[on, 2, None] * _lagrange(x[on], self.count)
                mine = slice(number * size, (number + 1) * size)
                result[on, mine] += (jump[:, :, None] * around[on, None]).reshape(-1, size)
        return result

    @cached_property
    def kernel(self) -> Array:
        """K (n, n), which around the axis is a convolution."""
        count, turns = self.count, 2 * self.count
        orders = np.arange(count + 1)
        modes = np.concatenate([self._modes(line) for line in self.lines], axis=1)  # (targets, nodes, orders)
        apart = 2 * np.pi * (np.arange(turns)[:, None] - np.arange(turns)) / turns
        shares = np.where((orders == 0) | (orders == count), 1.0, 2.0) / turns
        kernel = np.empty((len(modes), turns, modes.shape[1], turns))
        for first, ways in enumerate(apart):
            kernel[:, first] = modes @ (shares[:, None] * np.cos(orders[:, None] * ways))
        return kernel.reshape(len(self.places), -1)

    def _modes(self, line: tuple[Array, Array, Array]) -> Array:
        """(targets, n, orders): n·h at the section's nodes by cos mφ times the polynomials of one line's nodes."""
        (middle, way, normal), count, result = line, self.count, []
        half, (x, weights) = float(np.linalg.norm(way)), graded(count + FINE)
        unit, (u, v) = way / half, gauss_legendre(count + 2 * FINE)
        for place, own in zip(self.section, self.section_normals, strict=True):
            along, off = float((place - middle) @ unit), abs(float((place - middle) @ normal))
            if off > INSET * half:
                s, width, _ = (a[0] for a in _about(np.array([along]), np.array([off]), half, count + FINE))
            else:  # on the line itself there is a logarithm
                ends = np.array([-half, min(max(along, -half), half), half])
                wide = np.diff(ends)[:, None] / 2
                s, width = ((ends[:-1, None] + wide) + wide * x).ravel(), (wide * weights).ravel()
            sources = middle + s[:, None] * unit
            gap = np.maximum(np.linalg.norm(place - sources, axis=1), ROUND_OFF * half)
            scale = np.minimum(gap / np.sqrt(place[0] * np.maximum(sources[:, 0], ROUND_OFF * half)), WIDEST)
            top = np.arcsinh(np.pi / scale)[:, None] / 2
            angle, step = scale[:, None] * np.sinh(top * (1 + u)), top * v * scale[:, None] * np.cosh(top * (1 + u))
            r, square = sources[:, :1], gap[:, None] ** 2 + 4 * place[0] * sources[:, :1] * np.sin(angle / 2) ** 2
            # r - r' cos φ with what cancels taken together
            beside = place[0] - r + 2 * r * np.sin(angle / 2) ** 2
            kernel = (own[0] * beside + own[1] * (place[1] - sources[:, 1:])) / square**1.5
            around = np.einsum("sk,skm->sm", kernel * step, chebvander(np.cos(angle), count))
            around *= (2 * width * sources[:, 0])[:, None] / FOUR_PI
            result.append(_lagrange(s / half, count).T @ around)
        return np.array(result)


class _SphereSurface(Surface):
    """Of a sphere, on which K of a harmonic of degree l is half of it by 2 l + 1."""

    def __init__(self, body: Sphere, count: int) -> None:
        self.normals, areas = sphere(count)
        self.places, self.areas, self.count = body.radius * self.normals, body.radius**2 * areas, count

    def _fewer(self, count: int) -> tuple[Array, Array, Array]:
        keys, (normals, areas) = members(count), sphere(count)
        shares = orthonormal(keys, self.normals) @ (orthonormal(keys, normals).T * areas)
        return float(np.linalg.norm(self.places[0])) * normals, normals, shares

    @cached_property
    def kernel(self) -> Array:
        keys = members(self.count)
        values = orthonormal(keys, self.normals)
        return np.asarray(values / [2 * (2 * l + 1) for l, _, _ in keys] @ (values.T * sphere(self.count)[1]))


SURFACES: dict[type, Callable[..., Surface]] = {Box: _BoxSurface, Cylinder: _RoundSurface, Sphere: _SphereSurface}


def bears_charges(magnet: Magnet) -> bool:
    """Whether a magnet can respond by charges on its surface: a shape with a closed form, of one permeability."""
    return magnet.isotropic and isinstance(magnet.body, Box | Cylinder | Sphere)


def face_to_face(first: Solid, second: Solid) -> bool:
    """Whether two bodies are cuboids whose faces that look at each other are alike and opposite each other."""
    if not parallel(first, second):
        return False
    offset, small = np.abs(first.to_body(second.center)), INSET * float(first.size.max())
    beside = offset > small
    same = np.abs(np.abs(first.rotation.T @ second.rotation) @ second.size - first.size) <= small
    return bool(beside.sum() == 1 and same[~beside].all())


def gap(first: Solid, second: Solid) -> float:
    """Gap of two bodies in the smallest edge of both; where their circumscribed spheres are apart, at least theirs."""
    apart = float(np.linalg.norm(first.center - second.center)) - first.circumradius - second.circumradius
    edge = min(float(first.size.min()), float(second.size.min()))
    return apart / edge if apart > edge else separation(first, second)[0] / edge


def smooth(magnets: Sequence[Magnet]) -> bool:
    """Whether charges have no kinks but at the edges: elsewhere faces that lie across each other would make some."""
    pairs = combinations([magnet.body for magnet in magnets], 2)
    return all(face_to_face(first, second) or gap(first, second) > KINKS for first, second in pairs)
