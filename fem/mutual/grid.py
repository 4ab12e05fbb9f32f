"""A magnetised sphere with recoil permeability in any field: exact, degree by degree.

Inside, B = μ0 μr H + J with uniform J. Continuity of the potential and of B_n at the surface gives for an incident
potential of degree l the outer one -t_l (R/r)^(2l+1) times as large,

    t_l = l (μr - 1) / (l (μr + 1) + 1),

and for J the outer field of a dipole of moment (J V/μ0) 3/(μr + 2), with no field of another degree.
Of two charges at a and b (radii from the centre) one has in the answer to the other the energy Σ t_l P_l (ab)^-(l+1);
with t_l = t (1 - Σ w β^l), nearly, these are images' 1/√(a²b² - 2β a·b + β²), the degrees 0 and 1 taken off.
J. D. Jackson, Classical Electrodynamics (3rd ed. 1999), sections 4.4 and 5.11; W. R. Smythe, Static and Dynamic
Electricity (3rd ed. 1968), section 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.common import MU_0, Array
from ...geometry.scene.contents import Floater
from ...geometry.shapes import Box, Sphere
from ...geometry.solids import Solid
from ..compiled_code import compiled
from ..harmonics.interior import Ball, dipole_sources
from ..harmonics.solid import Coefficients, factorials

IMAGES, FITTED = (0.95, 0.73, 0.3), 14
"""β of the images, and the degree up to which their weights are fitted from 2 on: to 7e-4 of t_l."""


def reflection(permeability: float, degree: int) -> Array:
    """t_l (degree + 1,) of a sphere: 0 for μr = 1, and 1 for l ≥ 1 and μr → ∞."""
    l = np.arange(degree + 1)
    return np.asarray(l * (permeability - 1) / (l * (permeability + 1) + 1))


def induced_sources(incident: Coefficients, permeability: float) -> Coefficients:
    """c_lm (T) of what the incident field a_lm (T) induces in a sphere that fills the ball."""
    degree = len(incident) - 1
    return np.asarray(-reflection(permeability, degree)[:, None] * np.conj(incident) / factorials(degree))


def permanent_sources(floater: Floater, direction: Array, ball: Ball, degree: int) -> Coefficients:
    """c_lm (T) of the floater's remanent polarisation along a unit vector (3,): a dipole."""
    return dipole_sources(floater.moment * np.asarray(direction, float), ball, degree)


def image_weights(permeability: float) -> Array:
    """w (3,) of the images that stand for the degrees of a sphere's answer."""
    l = np.arange(2, FITTED)
    share = reflection(permeability, FITTED)[2:FITTED] * (permeability + 1) / (permeability - 1)
    return np.asarray(np.linalg.lstsq(np.array([beta**l for beta in IMAGES]).T, share - 1, rcond=None)[0])


def answer_to_charge(a: Sequence[Any], b: Sequence[Any], weights: Sequence[Any]) -> hy.expression:
    """Σ_{l≥2} (t_l/t) P_l(cos) (ab)^-(l+1), t = (μr - 1)/(μr + 1), for places a and b (three expressions, radii)."""
    square = hy.sum([x * x for x in a]) * hy.sum([x * x for x in b])
    along = hy.sum([x * y for x, y in zip(a, b, strict=True)])
    far = 1.0 / hy.sqrt(square)
    parts = [1.0 / hy.sqrt(square - 2.0 * along + 1.0)]
    for beta, weight in zip(IMAGES, weights, strict=True):
        parts.append(weight / hy.sqrt(square - (2.0 * beta) * along + beta * beta))
    flat = sum(weights, start=1.0)
    steep = sum((beta * weight for beta, weight in zip(IMAGES, weights, strict=True)), start=1.0)
    return hy.sum(parts) - far * (flat + steep * along * (far * far))


def field_of_answer(a: Sequence[Any], b: Sequence[Any], weights: Sequence[Any]) -> list[hy.expression]:
    """Its gradient (3) by b: the field at b of what the sphere answers to a charge at a."""
    given = hy.make_vars("b_x", "b_y", "b_z")
    slope = hy.diff_tensors([answer_to_charge(a, given, weights)], diff_args=given, diff_order=1).gradient
    names = {str(v): value for v, value in zip(given, b, strict=True)}
    return [hy.subs(part, names) for part in slope]


UNIT = MU_0 / (4 * np.pi)
IN_SPHERE, IN_CIRCLE = 0.64, 0.8
"""Edges of the boxes that stand for a sphere and for the section of a cylinder, in diameters."""
CHARGES, FEW_CHARGES = 4, 2
"""Along an edge of a face; the first meet what two magnets' fields do in the sphere to 1e-3 of all that is added."""
POWERS, RETURNED = (4, 5, 6), (5, 6)
"""p of the sphere's energy: two dipoles' begin with p = 4, those of degree 2; and q, about that of three dipoles."""


@dataclass(frozen=True, eq=False)
class AnswerGrid:
    """Points of one magnet with their energies.

    Parameters
    ----------
    box : of the magnet, see `answer_box`
    axis : (3,) direction of its remanence along the body's axes; zero: none
    radius : of the floater, m
    counts : points along each body axis
    strengths : (n, 3) λ, A m²/T, along the body's axes
    degrees : (n, 3, 2) v and w of each power, J
    returned : (n, 2, 2) s and t of each power, T
    """

    box: Box
    axis: Array
    radius: float = field(metadata={"units": "m"})
    counts: tuple[int, int, int]
    strengths: Array = field(metadata={"units": "A m2/T"})
    degrees: Array = field(metadata={"units": "J"})
    returned: Array = field(metadata={"units": "T"})

    @property
    def nodes(self) -> list[Array]:
        """Places of Gauss's points along each body axis, m."""
        return [
            h * np.polynomial.legendre.leggauss(n)[0] for h, n in zip(self.box.half_edges, self.counts, strict=True)
        ]

    @cached_property
    def points(self) -> Array:
        """(n, 3) m along the body's axes, from its centre."""
        return np.array(list(product(*self.nodes)))

    @cached_property
    def charges(self) -> tuple[Array, Array]:
        """Places (k, 3) m in the rotor's frame of charges that stand for the remanence, and these (k,)."""
        return face_charges(self.box, self.axis, CHARGES)

    @cached_property
    def few_charges(self) -> tuple[Array, Array]:
        """The same, fewer."""
        return face_charges(self.box, self.axis, FEW_CHARGES)

    def inner(self, number: int) -> Array:
        """(number³, 3) m in the rotor's frame: Gauss's points for what the magnet is as a whole."""
        nodes = np.polynomial.legendre.leggauss(number)[0]
        return self.box.center + np.array(list(product(nodes, repeat=3))) * self.box.half_edges @ self.box.rotation.T

    def energy(self, position: Sequence[Any], moment: Sequence[Any], share: Any) -> hy.expression:
        """Energy at a position (3 expressions, m) of a moment (A m² times `share`); in J times share²."""
        place = _along(self.box, [x - float(c) for x, c in zip(position, self.box.center, strict=True)])
        pointing, parts = _along(self.box, moment), []
        for point, row in zip(self.points, self.numbers, strict=True):
            d = [x - float(t) for x, t in zip(place, point, strict=True)]
            answer, degrees, returned = row[:3], row[3:9], row[9:]
            weights = [*answer, *(share * share * v for v in degrees), *(share * s for s in returned)]
            parts.append(point_energy(d, pointing, weights, self.axis.tolist(), self.radius))
        return hy.sum(parts)

    @cached_property
    def numbers(self) -> Array:
        """(n, 13) of each point: λ (3), v and w of three powers, s and t of two."""
        return np.concatenate([self.strengths, *(w.reshape(len(w), -1) for w in (self.degrees, self.returned))], axis=1)


def point_energy(
    d: Sequence[Any], moment: Sequence[Any], numbers: Sequence[Any], axis: Sequence[Any], r: Any
) -> hy.expression:
    """Energy of one point, from d (m), the moment, its `numbers`, ĵ and R, in the body's axes."""
    v4, w4, v5, w5, v6, w6, s5, t5, s6, t6 = numbers[3:]
    inverse = 1.0 / hy.sum([x * x for x in d])
    along = hy.sum([m * x for m, x in zip(moment, d, strict=True)])
    field = [3.0 * inverse * along * x - m for x, m in zip(d, moment, strict=True)]  # times 4π d³/μ0
    square = hy.sum([s * (b * b) for s, b in zip(numbers[:3], field, strict=True)])
    answer = (0.5 * UNIT**2) * (inverse * inverse * inverse * square)
    ratio, axial = r * r * inverse, hy.sum([j * x for j, x in zip(axis, d, strict=True)])
    pointing = hy.sum([j * m for j, m in zip(axis, moment, strict=True)])
    flat = v4 + ratio * (v5 + s5 * pointing + ratio * (v6 + s6 * pointing))
    steep = w4 * axial + ratio * (w5 * axial + t5 * along + ratio * (w6 * axial + t6 * along))
    return -answer - ratio * ratio * ratio * ratio * (flat + inverse * axial * steep)


def face_charges(box: Box, axis: Array, number: int) -> tuple[Array, Array]:
    """Places (k, 3) m of charges on a box's faces that stand for a remanence along `axis` in the body, and these (k,).

    At Gauss's points, `number` along an edge, in units of the charge of a face that the remanence leaves upright.
    """
    nodes, weights = np.polynomial.legendre.leggauss(number)
    along, places, amounts = list(zip(nodes, weights / 2, strict=True)), [np.zeros((0, 3))], []
    for k in np.flatnonzero(np.abs(axis) > 1e-9):
        for side, (u, first), (v, second) in product((-1.0, 1.0), along, along):
            places.append(np.roll([[side, u, v]], k, axis=1) * box.half_edges)
            amounts.append(side * axis[k] * first * second)
    return box.center + np.concatenate(places) @ box.rotation.T, np.array(amounts)


def _along(box: Box, vector: Sequence[Any]) -> list[Any]:
    """Components along the body's axes of a vector in the rotor's frame."""
    exact = np.where(np.abs(box.rotation.T) < 1e-15, 0.0, box.rotation.T)
    return [hy.sum([float(r) * v for r, v in zip(row, vector, strict=True) if r]) for row in exact]


DIGITS = 7.2
"""-ln of the error of Gauss's rule, about: with the weights fitted, force and torque are met to 1e-3."""


def answer_box(body: Solid) -> Box:
    """The box in which a body's points lie: itself, or for round ones a box that hardly leaves it."""
    if isinstance(body, Box):
        return body
    share = np.full(3, IN_SPHERE) if isinstance(body, Sphere) else np.array([IN_CIRCLE, IN_CIRCLE, 1.0])
    return Box(body.size * share, body.center, body.rotation)


def point_counts(box: Box, clearance: float, digits: float = DIGITS) -> tuple[int, int, int]:
    """Gauss points along each edge for fields with sources no nearer than a clearance (m) to the faces.

    Gauss's error falls as ρ^-2n, ρ the sum of the half axes of the ellipse about the edge that reaches the source.
    """
    z = 1 + clearance / box.half_edges
    nx, ny, nz = (int(n) for n in np.ceil(digits / np.log(z + np.sqrt(z * z - 1))))
    return nx, ny, nz


def orbits(grid_points: Array, mirrored: bool) -> NDArray[np.intp]:
    """Numbers (n,) of the classes of points (n, 3) that mirrors at the body's planes, or else its centre, exchange."""
    key = np.round(grid_points * 1e9).astype(int)
    if mirrored:
        key = np.abs(key)
    else:
        first = np.array([next((v for v in row if v), 0) for row in key])
        key = key * np.where(first < 0, -1, 1)[:, None]
    return np.asarray(np.unique(key, axis=0, return_inverse=True)[1]).ravel()


ENTRIES = [(a, b) for a in range(6) for b in range(a, 6)]
"""Of a symmetric matrix over place and moment: those that are computed."""
WHERE = np.array([[ENTRIES.index((min(a, b), max(a, b))) for b in range(6)] for a in range(6)])
"""Which of them each entry is."""

NUMBERS = 13
"""Of a point."""
IDENTITY = np.eye(3)


@cache
def _kernel() -> Any:
    place, moment = hy.make_vars("x", "y", "z"), hy.make_vars("m_x", "m_y", "m_z")
    numbers = [hy.expression(f"n_{k}") for k in range(NUMBERS)]
    energy = point_energy(place, moment, numbers, [hy.par[0], hy.par[1], hy.par[2]], hy.par[3])
    free = [*place, *moment]
    gradient = list(hy.diff_tensors([energy], diff_args=free, diff_order=1).gradient)
    hessian = np.asarray(hy.diff_tensors(gradient, diff_args=free, diff_order=1).jacobian)
    outputs = [energy, *gradient, *(hessian[a, b] for a, b in ENTRIES)]
    return compiled(hy.cfunc, outputs, [*free, *numbers], fast_math=True)


CHUNK = 48
"""Places at once, so that all numbers stay in the processor's cache."""


def grid_derivatives(grid: AnswerGrid, places: Array, moments: Array) -> tuple[Array, Array, Array]:
    """Energy (n,) J, gradient (n, 6) and second derivatives (n, 6, 6) by place (m) and moment (A m²) at (n, 3) each."""
    rotation = grid.box.rotation
    seen, pointing = grid.box.to_body(places), moments @ rotation
    if len(places) <= CHUNK:
        found = _summed(grid, seen, pointing)
    else:
        sums = [_summed(grid, seen[k : k + CHUNK], pointing[k : k + CHUNK]) for k in range(0, len(places), CHUNK)]
        found = np.concatenate(sums, axis=1)
    slope, second = found[1:7].T, found[7:].T[:, WHERE]
    if np.array_equal(rotation, IDENTITY):
        return found[0], slope, second
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotation
    return found[0], slope @ turn.T, turn @ second @ turn.T


def _summed(grid: AnswerGrid, places: Array, moments: Array) -> Array:
    """The kernel's outputs (28, n), summed over the points."""
    count, points = len(places), len(grid.points)
    given = np.empty((6 + NUMBERS, count, points))
    np.subtract(places.T[:, :, None], grid.points.T[:, None], out=given[:3])
    given[3:6] = moments.T[:, :, None]
    given[6:] = grid.numbers.T[:, None]
    pars = np.empty((4, count * points))
    pars[:3], pars[3] = grid.axis[:, None], grid.radius
    found = _kernel()(given.reshape(len(given), -1), pars=pars)
    return np.asarray(found.reshape(len(found), count, points).sum(axis=2))


@cache
def _pair_kernel() -> Any:
    place, way, product = hy.make_vars("x", "y", "z"), hy.make_vars("w_x", "w_y", "w_z"), hy.make_vars("product")
    other = [x + w for x, w in zip(place, way, strict=True)]
    energy = product * answer_to_charge(place, other, [hy.par[k] for k in range(len(IMAGES))])
    gradient = list(hy.diff_tensors([energy], diff_args=place, diff_order=1).gradient)
    hessian = np.asarray(hy.diff_tensors(gradient, diff_args=place, diff_order=1).jacobian)
    outputs = [energy, *gradient, *(hessian[a, b] for a, b in PLACES)]
    return compiled(hy.cfunc, outputs, [*place, *way, product], fast_math=True)


PLACES = [(a, b) for a in range(3) for b in range(a, 3)]
BESIDE = np.array([[PLACES.index((min(a, b), max(a, b))) for b in range(3)] for a in range(3)])
FEW = 8
"""Places at once for pairs of charges."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of points with weights.

    Parameters
    ----------
    begins, ways : (n, 3) the first points by the radius, and from the second ones to these
    products : (n,) of the weights
    images : (3,) weights of the sphere's images
    radius : of the sphere, m
    """

    begins: Array
    ways: Array
    products: Array
    images: Array
    radius: float

    def summed(self, kernel: Any, outputs: int, places: Array, moments: Array | None = None) -> Array:
        """A kernel's outputs (k, m) at places (m, 3) m, summed over the pairs."""
        count, found, variables = len(self.begins), np.zeros((outputs, len(places))), 7 if moments is None else 10
        for start in range(0, len(places) if count else 0, FEW):
            block = places[start : start + FEW] / self.radius
            given = np.empty((variables, len(block), count))
            np.subtract(block.T[:, :, None], self.begins.T[:, None], out=given[:3])
            given[3:6], given[6] = self.ways.T[:, None], self.products
            if moments is not None:
                given[7:] = moments[start : start + FEW].T[:, :, None]
            pars = np.repeat(self.images[:, None], len(block) * count, axis=1)
            sums = kernel(given.reshape(variables, -1), pars=pars)
            found[:, start : start + FEW] = sums.reshape(outputs, len(block), count).sum(axis=2)
        return found


def paired(first: tuple[Array, Array], second: tuple[Array, Array], images: Array, radius: float) -> Pairs:
    """All pairs of points (k, 3) m with weights (k,)."""
    (here, q), (there, p) = first, second
    begins = np.repeat(here, len(there), axis=0) / radius
    ways = (here[:, None] - there).reshape(-1, 3) / radius
    return Pairs(begins, ways, np.outer(q, p).ravel(), images, radius)


def pairs_of_charges(first: AnswerGrid, second: AnswerGrid, images: Array) -> Pairs:
    """Two magnets' charges, as `pair_derivatives` needs them."""
    return paired(first.charges, second.charges, images, first.radius)


def pairs_mixed(source: AnswerGrid, answering: Array, images: Array) -> Pairs:
    """A magnet's few charges and points (k, 3) m of another, as `mixed_derivatives` needs them."""
    return paired(source.few_charges, (answering, np.full(len(answering), 1 / len(answering))), images, source.radius)


def pair_derivatives(pairs: Pairs, places: Array) -> tuple[Array, Array, Array]:
    """Σ q q' Σ_l (t_l/t) P_l (ab)^-(l+1) (n,) of two magnets' charges at places (n, 3) m of the floater.

    With its gradient (n, 3) and second derivatives (n, 3, 3) by the place, m.
    """
    found = pairs.summed(_pair_kernel(), 10, places)
    return found[0], found[1:4].T / pairs.radius, found[4:].T[:, BESIDE] / pairs.radius**2


@cache
def _mixed_kernel() -> Any:
    place, way, product = hy.make_vars("x", "y", "z"), hy.make_vars("w_x", "w_y", "w_z"), hy.make_vars("product")
    moment = hy.make_vars("m_x", "m_y", "m_z")
    other = [x + w for x, w in zip(place, way, strict=True)]
    energy = product * mixed_energy(place, other, moment, [hy.par[k] for k in range(len(IMAGES))])
    free = [*place, *moment]
    gradient = list(hy.diff_tensors([energy], diff_args=free, diff_order=1).gradient)
    hessian = np.asarray(hy.diff_tensors(gradient, diff_args=free, diff_order=1).jacobian)
    outputs = [energy, *gradient, *(hessian[a, b] for a, b in ENTRIES)]
    return compiled(hy.cfunc, outputs, [*place, *way, product, *moment], fast_math=True)


def mixed_energy(a: Sequence[Any], b: Sequence[Any], moment: Sequence[Any], images: Sequence[Any]) -> hy.expression:
    """Moment times the field of a point at b that the sphere's answer to a charge at a magnetises; lengths in radii."""
    field, inverse = field_of_answer(a, b, images), 1.0 / hy.sum([x * x for x in b])
    along, pointing, both = (
        hy.sum([x * y for x, y in zip(u, v, strict=True)]) for u, v in ((b, field), (b, moment), (moment, field))
    )
    return inverse * hy.sqrt(inverse) * (3.0 * inverse * along * pointing - both)


def mixed_derivatives(pairs: Pairs, places: Array, moments: Array) -> tuple[Array, Array, Array]:
    """What points answer to the sphere's answer to another magnet's charges, as `grid_derivatives`; in no units."""
    found = pairs.summed(_mixed_kernel(), 7 + len(ENTRIES), places, moments)
    units = np.repeat([1 / pairs.radius, 1.0], 3)
    return found[0], found[1:7].T * units, found[7:].T[:, WHERE] * units[:, None] * units


@cache
def _field_kernel() -> Any:
    place, moment = hy.make_vars("x", "y", "z"), hy.make_vars("m_x", "m_y", "m_z")
    free, field = [*place, *moment], point_field(place, moment)
    first = np.asarray(hy.diff_tensors(field, diff_args=free, diff_order=1).jacobian)
    second = [
        np.asarray(hy.diff_tensors(list(row), diff_args=free, diff_order=1).jacobian)[a, b]
        for row in first
        for a, b in ENTRIES
    ]
    return compiled(hy.cfunc, [*field, *first.ravel(), *second], free, fast_math=True)


def point_field(d: Sequence[Any], moment: Sequence[Any]) -> list[hy.expression]:
    """Field (3) T of a moment (A m²) at a way d (3 expressions, m) from it or to it."""
    inverse = 1.0 / hy.sum([t * t for t in d])
    cube = UNIT * (inverse * hy.sqrt(inverse))
    along = 3.0 * inverse * hy.sum([m * t for m, t in zip(moment, d, strict=True)])
    return [cube * (along * t - m) for t, m in zip(d, moment, strict=True)]


def coupled_derivatives(points: Array, coupling: Array, places: Array, moments: Array) -> tuple[Array, Array, Array]:
    """-½ bᵀ coupling b of the fields b at points (k, 3) m of moments at places (n, 3), as `grid_derivatives`."""
    count, number = len(places), len(points)
    given = np.empty((6, count, number))
    np.subtract(places.T[:, :, None], points.T[:, None], out=given[:3])
    given[3:] = moments.T[:, :, None]
    found = _field_kernel()(given.reshape(6, -1)).reshape(84, count, number)
    field = found[:3].transpose(1, 2, 0).reshape(count, 3 * number)
    slope = found[3:21].reshape(3, 6, count, number).transpose(2, 3, 0, 1).reshape(count, 3 * number, 6)
    answer = -field @ coupling
    each = np.moveaxis(answer.reshape(count, number, 3), 2, 0)[:, None] * found[21:].reshape(3, -1, count, number)
    bend = each.sum(axis=(0, 3)).T
    second = bend[:, WHERE] - np.swapaxes(slope, 1, 2) @ (coupling @ slope)
    return np.sum(answer * field, axis=1) / 2, (answer[:, None] @ slope)[:, 0], second
