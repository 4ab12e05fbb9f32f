"""Permeable magnets by charges on their surfaces: boundary elements, one graded panel a face.

In a magnet of one recoil permeability μ = 1 + χ nothing but its surface is charged, because ∇·M = 0 there. With
σ = n·μ0 M and outward normals n the charge solves

    (1 + χ/2) σ - χ K σ = n·J + χ n·b,        (K σ)(x) = 1/4π ∫ σ(y) n·(x - y)/|x - y|³ dS,

b the field μ0 H of sources elsewhere. The closed form of uniform carriers is split off, so that a σ of order χ is
left, with logarithms at the edges. Nodes crowd there as x = sin(π/2 sin(π/2 u)), and between nodes σ is a polynomial
in u. K from face to face of a body, or of two that are near each other, integrates the product of this polynomial and
the kernel, with a hyperbolic sine about the place nearest to the target; from afar the nodes' own rule does. Errors
fall about as n⁻⁷ with the number n of nodes along an edge.

O. D. Kellogg, Foundations of Potential Theory (1929), ch. VI; P. R. Johnston and D. Elliott, Int. J. Numer. Meth. Eng.
62 (2005) 564, for the hyperbolic sine.
"""

from collections.abc import Callable, Sequence
from functools import cache, cached_property
from itertools import combinations, product

import numpy as np
import scipy.linalg
import scipy.sparse.linalg
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from ...geometry.common import MU_0, Array, ComputationError
from ...geometry.magnets import Magnet
from ...geometry.overlap import separation
from ...geometry.shapes import Box, Cylinder, Sphere
from ...geometry.solids import Solid, moved
from ..closed_forms.moments import parallel
from ..closed_forms.uniform import remanent_field
from ..harmonics.interior import sphere
from ..harmonics.solid import FOUR_PI, gauss_legendre, members, orthonormal

INSET = 1e-10  # of the smallest edge: how far inside of a face closed forms are taken, and what counts as on a face
DENSE, BLOCK = 6000, 500  # nodes up to which their equations are factorised (290 MB), and fields otherwise at once
SOLVED = 1e-12  # residual of the charges, relative, by the largest μ
TURNS = 25  # of magnets' responses to each other; with χ up to 1/2 they settle to that in fewer
# Distance from a face, in edges by the nodes along them, from which on the nodes' own rule does: nodes are at most
# h = 1.2 of that apart, so that it errs by exp(-2π 4/1.2) = 1e-9
APART = 4.0
MORE = 2  # times as many nodes along an edge for moments as for charges
KINKS = 0.2  # gap, in edges, from which on a neighbour's edges make no kink in the charges
FINE = 10  # nodes of the rule for a product beyond those along an edge
ROWS = 1 << 20  # numbers at once in such a rule
PAIRS = 1 << 15  # of a charge and a place at once, so that they stay in the processor's cache
TOGETHER = 1e-14  # square of a distance, by those from the axes' origin, below which two nodes are one
ROUND_OFF = 1e-13  # of a line's half: no place is nearer to a node than that
WIDEST = 3.0  # scale of the hyperbolic sine of an angle, so that it is one near the axis, too
# Distances of two bodies' centres, in the sum of their circumradii, from which on few places on each stand for all, and
# how many of Gauss's rule along an edge do. What is charged beyond the carriers has hardly a field there.
FAR, COARSE = (1.5, 6.0), (4, 2)


@cache
def graded(count: int) -> tuple[Array, Array]:
    """Places x (n,) = sin(π/2 sin(π/2 u)), -1 to 1, at Gauss's u, and weights (n,) of an integral over x."""
    u, weights = gauss_legendre(count)
    inner = np.pi / 2 * np.sin(np.pi / 2 * u)
    return np.sin(inner), weights * (np.pi / 2) ** 2 * np.cos(inner) * np.cos(np.pi / 2 * u)


@cache
def _to_nodes(count: int) -> Array:
    """(n, n): Lagrange's polynomials at Gauss's nodes by Legendre's."""
    u, weights = gauss_legendre(count)
    return np.asarray((np.arange(count) + 0.5)[:, None] * np.polynomial.legendre.legvander(u, count - 1).T * weights)


def _lagrange(places: Array, count: int) -> Array:
    """(..., n): Lagrange's polynomials in u, for the nodes of `graded`, at places x (...,)."""
    u = 2 / np.pi * np.arcsin(2 / np.pi * np.arcsin(np.clip(places, -1.0, 1.0)))
    return np.asarray(np.polynomial.legendre.legvander(u, count - 1) @ _to_nodes(count))


def _about(place: Array, scale: Array, half: float, count: int) -> tuple[Array, Array, Array]:
    """Places (..., m), weights, distances of a rule from -half to half, fine about `place` and at both ends."""
    x, weights = graded(count)
    low, high = np.arcsinh((-half - place) / scale)[..., None], np.arcsinh((half - place) / scale)[..., None]
    angle = (low + high) / 2 + (high - low) / 2 * x
    distance = scale[..., None] * np.cosh(angle)
    return place[..., None] + scale[..., None] * np.sinh(angle), (high - low) / 2 * weights * distance, distance


def face_rows(places: Array, normals: Array, halves: Array, counts: tuple[int, int]) -> Array:
    """n·h (T) at places off the plane of a rectangle by the charges (T) at its n × m nodes: weights (t, n m).

    `places`, `normals`: (t, 3), along the rectangle's edges and its normal, from its middle; `halves`: (2,) half edges;
    `counts`: n and m, nodes along the edges.
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


def _far_rows(places: Array, normals: Array, sources: Array, areas: Array) -> Array:
    """As `face_rows`, by the rule of the nodes alone: `sources` (n, 3) with `areas` (n,)."""
    sizes = np.sum(places**2, axis=1)[:, None] + np.sum(sources**2, axis=1)
    square = sizes - 2 * places @ sources.T
    # a place on a node, of a body that touches, sees nothing of it: both are in one plane
    inverse = np.divide(1.0, square, out=np.zeros_like(square), where=square > TOGETHER * sizes)
    inverse *= np.sqrt(inverse)
    inverse *= np.sum(places * normals, axis=1)[:, None] - normals @ sources.T
    return np.asarray(inverse * (areas / FOUR_PI))


def _from_gauss(places: Array, count: int) -> Array:
    """(n, count): Lagrange's polynomials at so many of Gauss's nodes, at places x (n,)."""
    return np.asarray(np.polynomial.legendre.legvander(places, count - 1) @ _to_nodes(count))


def _around(angles: Array, count: int) -> Array:
    """(n, 2 count): trigonometric interpolation between 2 count angles that begin at 0, at `angles` (n,)."""
    orders, turns = np.arange(count + 1), 2 * count
    values = np.cos(orders[:, None, None] * (angles[:, None] - 2 * np.pi * np.arange(turns) / turns))
    values[1:-1] *= 2
    return np.asarray(values.sum(axis=0) / turns)


class Surface:
    """Nodes on a body's surface: `places` (n, 3) m, outward `normals` (n, 3) and `areas` (n,) m², body's axes.

    Nearer than `reach` (m) to it `rows_nearby` does what the nodes' own rule does not; 0: the rule has to do, and the
    step to more nodes shows how well it does.
    """

    places: Array
    normals: Array
    areas: Array
    reach = 0.0

    @cached_property
    def kernel(self) -> Array:
        """K (n, n) of the body alone."""
        raise NotImplementedError

    @cached_property
    def coarse(self) -> list[tuple[Array, Array, Array]]:
        """Places and normals (k, 3) that stand for all from each of `FAR`, and the nodes' values by those (n, k)."""
        return [self._fewer(count) for count in COARSE]

    def _fewer(self, count: int) -> tuple[Array, Array, Array]:
        """One of `coarse`, with so many places along an edge."""
        raise NotImplementedError

    def rows_nearby(self, places: Array, normals: Array) -> Array:
        """n·h (T) of the charges at places outside the body or on it, (t, n)."""
        raise NotImplementedError

    def refined(self, charges: Array) -> tuple[Array, Array]:
        """More places (k, 3), for high moments, and what is there (k,) of the charges (n,) T by their areas."""
        return self.places, self.areas * charges


class _BoxSurface(Surface):
    """Of a cuboid, face by face: on those at -x, x, -y, y, -z and z, with more nodes along longer edges."""

    def __init__(self, body: Box, count: int) -> None:
        self.half = body.half_edges
        self.counts = [round(count * np.sqrt(half / self.half.min())) for half in self.half]
        self.reach = APART * float(np.max(2 * self.half / self.counts))
        rules, places, normals, areas, self.numbers, total = [graded(n) for n in self.counts], [], [], [], {}, 0
        for axis, side in product(range(3), (-1, 1)):
            (x, wide), (y, tall) = (rules[k] for k in self._order(axis)[:2])
            places.append(self._grid(axis, side, x, y))
            normals.append(np.broadcast_to(side * np.eye(3)[axis], places[-1].shape))
            areas.append(self._area(axis) / 4 * np.outer(wide, tall).ravel())
            self.numbers[axis, side] = total + np.arange(len(places[-1])).reshape(len(x), len(y))  # of the nodes
            total += len(places[-1])
        self.places, self.normals, self.areas = (np.concatenate(part) for part in (places, normals, areas))

    @staticmethod
    def _order(axis: int) -> list[int]:
        """The axes along a face, and that across it."""
        return [(axis + 1) % 3, (axis + 2) % 3, axis]

    def _area(self, axis: int) -> float:
        return float(np.prod(2 * self.half[self._order(axis)[:2]]))

    def _grid(self, axis: int, side: int, x: Array, y: Array) -> Array:
        """Places (n m, 3) on a face at x (n,) and y (m,) in half edges."""
        order, face = self._order(axis), np.empty((len(x), len(y), 3))
        face[..., axis] = side * self.half[axis]
        face[..., order[0]], face[..., order[1]] = self.half[order[0]] * x[:, None], self.half[order[1]] * y
        return face.reshape(-1, 3)

    def _face(self, axis: int, side: int, places: Array) -> tuple[list[int], Array, Array, tuple[int, int]]:
        """A face's axes and normal as an order, places as it sees them, its half edges, and its counts of nodes."""
        order = self._order(axis)
        seen = places[:, order] - [0, 0, side * self.half[axis]]
        return order, seen, self.half[order[:2]], (self.counts[order[0]], self.counts[order[1]])

    def _image(self, axis: int) -> NDArray[np.intp]:
        """(n,) the nodes' mirror images at the plane across an axis."""
        found = np.empty(len(self.places), int)
        for (across, side), mine in self.numbers.items():
            opposite = across == axis
            found[mine] = self.numbers[across, -side] if opposite else np.flip(mine, self._order(across).index(axis))
        return found

    @cached_property
    def kernel(self) -> Array:
        """K (n, n); what mirrors and, of a cube, turns of the body make of each other is computed once."""
        total = len(self.places)
        result, everything = np.zeros((total, total)), np.arange(total)
        mirrors = [self._image(axis) for axis in range(3)]
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
        x, _ = gauss_legendre(count)
        places, normals, shares = [], [], []
        for axis, side in self.numbers:
            places.append(self._grid(axis, side, x, x))
            normals.append(np.broadcast_to(side * np.eye(3)[axis], places[-1].shape))
            along, across = (_from_gauss(graded(self.counts[k])[0], count) for k in self._order(axis)[:2])
            shares.append(np.kron(along, across))
        return np.concatenate(places), np.concatenate(normals), np.asarray(scipy.linalg.block_diag(*shares))

    def refined(self, charges: Array) -> tuple[Array, Array]:
        places, amounts = [], []
        for (axis, side), numbers in self.numbers.items():
            counts = [self.counts[k] for k in self._order(axis)[:2]]
            (x, wide), (y, tall) = (graded(MORE * n) for n in counts)
            places.append(self._grid(axis, side, x, y))
            between = _lagrange(x, counts[0]) @ charges[numbers] @ _lagrange(y, counts[1]).T
            amounts.append((self._area(axis) / 4 * np.outer(wide, tall) * between).ravel())
        return np.concatenate(places), np.concatenate(amounts)

    def rows_nearby(self, places: Array, normals: Array) -> Array:
        result = np.empty((len(places), len(self.places)))
        for (axis, side), numbers in self.numbers.items():
            (order, seen, halves, counts), mine = self._face(axis, side, places), numbers.ravel()
            beyond = np.maximum(np.abs(seen) - [*halves, 0.0], 0)
            near = np.linalg.norm(beyond, axis=1) < APART * np.max(2 * halves / counts)
            off = np.abs(seen[:, 2]) > INSET * self.half.max()
            rows = face_rows(seen[near & off], normals[near & off][:, order], halves, counts)
            result[np.ix_(near & off, mine)] = rows
            result[np.ix_(near & ~off, mine)] = 0.0
            apart = _far_rows(places[~near], normals[~near], self.places[mine], self.areas[mine])
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
        along = scipy.linalg.block_diag(*[_from_gauss(graded(self.count)[0], count)] * len(self.lines))
        return few.places, few.normals, np.kron(along, _around(np.pi * np.arange(2 * self.count) / self.count, count))

    def rows_nearby(self, places: Array, normals: Array) -> Array:
        """As of `Surface`: the nodes' own rule, and the charges' own jump on flat faces that touch."""
        result = _far_rows(places, normals, self.places, self.areas)
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
        middle, way, normal = line
        half, count, result = float(np.linalg.norm(way)), self.count, []
        unit, (x, weights) = way / half, graded(count + FINE)
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
            u, v = gauss_legendre(count + 2 * FINE)
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


class SurfaceCharges:
    """Charges on the surfaces of permeable magnets that respond to each other.

    `magnets`: each of them `bears_charges`; `count`: n, nodes along an edge of a face.

    Attributes
    ----------
    magnets : those that are permeable, on whose surfaces the nodes are
    places, normals, areas : of the nodes, (n, 3) m, outward (n, 3) and (n,) m²; rotor's frame, magnet by magnet
    owner : (n,) which of `magnets` a node is of
    contrast : (n,) χ of the magnet that a node is of
    """

    def __init__(self, magnets: Sequence[Magnet], count: int) -> None:
        self.count = count
        self.all, self.magnets = tuple(magnets), tuple(magnet for magnet in magnets if magnet.contrast)
        alike = dict[tuple[str | float, ...], Surface]()
        places, normals, areas, self._surfaces = [], [], [], list[Surface]()
        for magnet in self.magnets:
            body = magnet.body
            key = (body.kind, *body.shape_numbers.tolist())
            if key not in alike:
                alike[key] = SURFACES[type(body)](moved(body, np.zeros(3), np.eye(3)), count)
            self._surfaces.append(alike[key])
            places.append(body.center + alike[key].places @ body.rotation.T)
            normals.append(alike[key].normals @ body.rotation.T)
            areas.append(alike[key].areas)
        self.places, self.normals, self.areas = (np.concatenate(part) for part in (places, normals, areas))
        self.owner = np.repeat(np.arange(len(areas)), [len(one) for one in areas])
        self._of = [np.flatnonzero(self.owner == k) for k in range(len(self.magnets))]
        self.contrast = np.array([magnet.recoil_permeability - 1 for magnet in self.magnets])[self.owner]
        centers = np.array([magnet.body.center for magnet in self.magnets])
        radii = np.array([magnet.body.circumradius for magnet in self.magnets])
        distances = np.linalg.norm(centers[:, None] - centers, axis=2)
        # of each pair whether they are near each other, 0, or far, 1 and more
        self._distance = np.searchsorted(FAR, distances / (radii[:, None] + radii))
        self._near = [self._rows(k) for k in range(len(self.magnets))]

    def _rows(self, number: int) -> tuple[NDArray[np.intp], Array]:
        """Nodes of bodies that are not far from a magnet, and n·h there by its charges."""
        magnet, surface = self.magnets[number], self._surfaces[number]
        at = np.flatnonzero((self._distance[number, self.owner] == 0) & (self.owner != number))
        mine, rows = self.owner == number, np.zeros((len(at), len(surface.places)))
        close = magnet.body.distance(self.places[at]) < surface.reach
        rows[~close] = _far_rows(self.places[at[~close]], self.normals[at[~close]], self.places[mine], self.areas[mine])
        if close.any():
            local = magnet.body.to_body(self.places[at[close]])
            rows[close] = surface.rows_nearby(local, self.normals[at[close]] @ magnet.body.rotation)
        return at, rows

    def numbers_at(self, count: int) -> float:
        """Of all matrices, with `count` nodes along an edge, about."""
        nodes = (count / self.count) ** 2 * np.bincount(self.owner)
        return float(np.sum((self._distance == 0) * np.outer(nodes, nodes)))

    @cached_property
    def _from_afar(self) -> list[list[tuple[NDArray[np.intp], Array]]]:
        """For each of `FAR` and each body: coarse places of bodies so far from it, and n·h there by charges at its."""
        found = []
        for far in range(len(FAR)):
            of = [
                (magnet.body, surface.coarse[far]) for magnet, surface in zip(self.magnets, self._surfaces, strict=True)
            ]
            owner = np.repeat(np.arange(len(of)), [len(few[0]) for _, few in of])
            places = np.concatenate([body.center + few[0] @ body.rotation.T for body, few in of])
            normals = np.concatenate([few[1] @ body.rotation.T for body, few in of])
            blocks = []
            for k in range(len(of)):
                at, mine = np.flatnonzero(self._distance[k, owner] == far + 1), places[owner == k]
                blocks.append((at, _far_rows(places[at], normals[at], mine, np.ones(len(mine)))))
            found.append(blocks)
        return found

    def normal_field(self, charges: Array) -> Array:
        """K σ (n, ...) T of charges (n, ...) T."""
        found = np.zeros_like(charges)
        for surface, mine, (at, rows) in zip(self._surfaces, self._of, self._near, strict=True):
            found[mine] += surface.kernel @ charges[mine]
            found[at] += rows @ charges[mine]
        amounts = (self.areas * charges.T).T
        for far, blocks in enumerate(self._from_afar if self._distance.any() else ()):
            shares = [surface.coarse[far][2] for surface in self._surfaces]
            ends = np.cumsum([share.shape[1] for share in shares])
            seen = np.zeros((ends[-1], *charges.shape[1:]))
            for share, mine, (at, rows) in zip(shares, self._of, blocks, strict=True):
                seen[at] += rows @ (share.T @ amounts[mine])
            for share, mine, part in zip(shares, self._of, np.split(seen, ends[:-1]), strict=True):
                found[mine] += share @ part
        return found

    def refined(self, number: int, charges: Array) -> tuple[Array, Array]:
        """Places (k, 3) m on one of `magnets`, and amounts (k,) T m² there, with the moments of charges (n,) T."""
        body = self.magnets[number].body
        places, amounts = self._surfaces[number].refined(charges[self.owner == number])
        return body.center + places @ body.rotation.T, amounts

    def field_beside(self, number: int, charges: Array, points: Array) -> Array:
        """B (k, 3) T at points (k, 3) m beside magnet `number`, of charges (n,) T on it: as exact as `refined` is."""
        places, amounts = self.refined(number, charges)
        areas = self.refined(number, np.ones_like(charges))[1]
        amounts -= amounts.sum() / areas.sum() * areas  # a magnet has no charge
        found, few = np.empty(points.shape), max(1, PAIRS // len(places))
        for start in range(0, len(points), few):
            away = points[start : start + few, None] - places
            square = np.einsum("pna,pna->pn", away, away)
            found[start : start + few] = np.einsum("pn,pna->pa", amounts / (square * np.sqrt(square)), away)
        return found / FOUR_PI

    def response(self, field: Array) -> Array:
        """Charges σ (n, k) T that k fields with n·b (n, k) T of sources elsewhere make; raises as `solved`."""
        right = self.contrast[:, None] * field
        if len(right) <= DENSE:
            return np.asarray(scipy.linalg.lu_solve(self._factors, right))
        blocks = np.array_split(right, max(1, right.shape[1] // BLOCK), axis=1)
        return np.concatenate([self._settled(block) for block in blocks], axis=1)

    def _settled(self, right: Array) -> Array:
        """`solved` of several columns at once, by turns that each leave a part of χ/2, or else one by one."""
        share = 1 / (1 + self.contrast / 2)[:, None]
        found = share * right
        for _ in range(TURNS):
            before = found
            found = share * (right + self.contrast[:, None] * self.normal_field(before))
            if np.abs(found - before).max() <= SOLVED * np.abs(found).max():
                return np.asarray(found)
        return np.stack([self.solved(column) for column in right.T], axis=1)

    def solved(self, right: Array) -> Array:
        """σ (n,) T of (1 + χ/2) σ - χ K σ = `right` (n,) T. Raises ComputationError where they do not converge."""
        share = 1 / (1 + self.contrast / 2)
        size, changed = (len(right),) * 2, share * self.contrast
        whole = scipy.sparse.linalg.LinearOperator(size, lambda v: v - changed * self.normal_field(v), dtype=float)
        rtol = SOLVED * (1 + float(self.contrast.max()))
        found, failed = scipy.sparse.linalg.gmres(whole, share * right, rtol=rtol, restart=60, maxiter=5)
        if not failed:
            return np.asarray(found)
        if len(right) > DENSE:
            raise ComputationError("The charges on the magnets' surfaces did not converge. Choose --model fem.")
        return np.asarray(scipy.linalg.lu_solve(self._factors, right))

    @cached_property
    def _factors(self) -> tuple[Array, NDArray[np.int32]]:
        """Of (1 + χ/2) - χ K, for many right-hand sides, or where the iteration of `solved` does not converge."""
        whole = np.zeros((len(self.places),) * 2, order="F")  # which is factorised in its place
        for surface, mine, (at, rows) in zip(self._surfaces, self._of, self._near, strict=True):
            whole[np.ix_(mine, mine)] = surface.kernel
            whole[np.ix_(at, mine)] = rows
        for far, blocks in enumerate(self._from_afar if self._distance.any() else ()):
            shares = [surface.coarse[far][2] for surface in self._surfaces]
            owner = np.repeat(np.arange(len(shares)), [share.shape[1] for share in shares])
            for share, mine, (at, rows) in zip(shares, self._of, blocks, strict=True):
                amounts = (share * self.areas[mine, None]).T
                for k in np.unique(owner[at]).tolist():
                    whole[np.ix_(self._of[k], mine)] = shares[k] @ (rows[owner[at] == k] @ amounts)
        whole *= -self.contrast[:, None]
        whole[np.diag_indices_from(whole)] += 1 + self.contrast / 2
        factors, pivots = scipy.linalg.lu_factor(whole, overwrite_a=True)
        return factors, pivots

    def polarizability(self) -> Array:
        """(3, 3) A m²/T: the moment of all magnets together that a uniform field induces, ∫ x σ dS/μ0 of a unit one."""
        found = (self.places * self.areas[:, None]).T @ self.response(self.normals) / MU_0
        return np.asarray((found + found.T) / 2)

    def beyond(self, carriers: Sequence[Magnet]) -> Array:
        """σ (n,) T beyond n·J' of uniform `carriers`, one for each of all magnets."""
        sizes = np.array([magnet.body.size.min() for magnet in self.magnets])[self.owner]
        closed = remanent_field(carriers, self.places - INSET * sizes[:, None] * self.normals)
        kept = [one for one, magnet in zip(carriers, self.all, strict=True) if magnet.contrast]
        pairs = zip(self.magnets, kept, strict=True)
        rest = np.array([m.polarization_in_rotor - c.polarization_in_rotor for m, c in pairs])
        return self.solved(np.sum((rest[self.owner] + self.contrast[:, None] * closed) * self.normals, axis=1))
