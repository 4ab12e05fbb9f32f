"""Energies of the mutual magnetisation of a rotor and a permeable sphere: sums of one formula over rows of numbers.

Inside a sphere in any field B = μ0 μr H + J with uniform J; an incident potential of degree l comes back -t_l
(R/r)^(2l+1) times as large, t_l = l (μr - 1) / (l (μr + 1) + 1), and J has the outer field of a dipole (J V/μ0) 3/(μr +
2) alone. The response to a charge at a (radii from the centre) has at a charge at b the energy Σ t_l P_l (ab)^-(l+1);
with t_l = t (1 - Σ w β^l), nearly, these are images' 1/√(a²b² - 2β a·b + β²), the degrees 0 and 1 taken off. J. D.
Jackson, Classical Electrodynamics (3rd ed. 1999), sections 4.4 and 5.11; W. R. Smythe, Static and Dynamic Electricity
(3rd ed. 1968), section 5.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import product
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import MU_0, Array
from ...geometry.magnets import Magnet
from ...geometry.shapes import Box, Sphere
from ...geometry.solids import Solid
from ..compiled_code import compiled
from ..harmonics.expressions import Vector, turned_expressions
from ..harmonics.solid import FOUR_PI, Coefficients, factorials, gauss_legendre

# β of the images, and the degree up to which their weights are fitted from 2 on: to 7e-4 of t_l
IMAGES, FITTED = (0.95, 0.73, 0.3), 14
PARALLEL = 1e-9  # entry of a unit vector, or of μ along the body's axes, that is round-off
UNIT = MU_0 / FOUR_PI
# Edges of the boxes that stand for a sphere and for the section of a cylinder, in diameters
IN_SPHERE, IN_CIRCLE = 0.64, 0.8
# p of the sphere's energy: two dipoles' begin with p = 4, those of degree 2; and q, about that of three dipoles
POWERS, RETURNED = (4, 5, 6), (5, 6)
# Second derivatives over place and moment that are computed; they are symmetric
ENTRIES = [(a, b) for a in range(6) for b in range(a, 6)]
WHERE = np.array([[ENTRIES.index((min(a, b), max(a, b))) for b in range(6)] for a in range(6)])
EVALUATIONS = 10_000  # of a formula at once, so that all numbers stay in the processor's cache


class Effort(NamedTuple):
    """How finely a rotor's responses are computed: what its table errs by is the points' and charges' alone."""

    digits: float  # of the points: -ln of the error of Gauss's rule, about
    charges: int  # that stand for the remanence where two magnets' fields are in the sphere, as for `charges`
    reflected: int  # the same, where magnets respond to the sphere's response to them
    nodes: tuple[int, int]  # along an edge of a face, of two responses whose difference tells their error
    dipoles: int  # places of them for each gap and magnet
    inner: int  # points along each axis at which magnets beside each other respond beyond their direct response
    corners: bool  # whether places before edges and corners are sampled, or before the faces' middles alone
    poses: int  # at which errors are found, for each gap and magnet beside that at its pole
    safety: float  # by which the largest of these is multiplied, for the poses that are not looked at
    degrees: float  # part of the sphere's response that the degrees left out may hold, of samples and errors
    series: float  # where that of both bodies' responses ends, relative to its first term


# With the weights fitted, few magnets' force and torque are met to 1e-3 of all that is added, many magnets' to 2e-2.
# With 10 nodes the response of a cube with μr = 1.05 to a dipole errs by at most 7e-4 at any distance, with 14 by 6e-4.
FEW_MAGNETS = Effort(7.2, 2, 2, (10, 14), 16, 2, True, 2, 4.0, 3e-4, 1e-5)
MANY_MAGNETS, MANY = Effort(5.5, 0, 0, (4, 6), 6, 1, False, 2, 5.0, 1e-3, 1e-4), 4


def effort(magnets: int) -> Effort:
    """Of a rotor of so many magnets."""
    return FEW_MAGNETS if magnets < MANY else MANY_MAGNETS


# Energy (J times share²) of a place (3, m), a moment (3, A m² times share) and a row of numbers, and the share
Formula = Callable[[Sequence[Any], Sequence[Any], Sequence[Any], Any], hy.expression]


def reflection(permeability: float, degree: int) -> Array:
    """t_l (degree + 1,) of a sphere: 0 for μr = 1, and 1 for l ≥ 1 and μr → ∞."""
    l = np.arange(degree + 1)
    return np.asarray(l * (permeability - 1) / (l * (permeability + 1) + 1))


def induced_sources(incident: Coefficients, permeability: float) -> Coefficients:
    """c_lm (T) of what the incident field a_lm (T) induces in a sphere that fills the ball."""
    degree = len(incident) - 1
    return np.asarray(-reflection(permeability, degree)[:, None] * np.conj(incident) / factorials(degree))


def image_weights(permeability: float) -> Array:
    """w (3,) of the images that stand for the degrees of a sphere's response; 0 for μr = 1."""
    if permeability == 1:
        return np.zeros(len(IMAGES))
    l = np.arange(2, FITTED)
    share = reflection(permeability, FITTED)[2:FITTED] * (permeability + 1) / (permeability - 1)
    return np.asarray(np.linalg.lstsq(np.array([beta**l for beta in IMAGES]).T, share - 1, rcond=None)[0])


def response_to_charge(a: Sequence[Any], b: Sequence[Any], weights: Sequence[Any]) -> hy.expression:
    """Energy of a charge in a sphere's response to another: Σ_{l≥2} (t_l/t) P_l(cos) (ab)^-(l+1).

    Places `a`, `b` (3 expressions) from the centre, in radii; `weights`: of `image_weights`; t = (μr - 1)/(μr + 1).
    """
    square = hy.sum([x * x for x in a]) * hy.sum([x * x for x in b])
    along = hy.sum([x * y for x, y in zip(a, b, strict=True)])
    far = 1.0 / hy.sqrt(square)
    parts = [1.0 / hy.sqrt(square - 2.0 * along + 1.0)]
    for beta, weight in zip(IMAGES, weights, strict=True):
        parts.append(weight / hy.sqrt(square - (2.0 * beta) * along + beta * beta))
    # degrees 0 and 1 are no part of it: the energy of the moment has them
    flat = sum(weights, start=1.0)
    steep = sum((beta * weight for beta, weight in zip(IMAGES, weights, strict=True)), start=1.0)
    return hy.sum(parts) - far * (flat + steep * along * (far * far))


def point_energy(place: Sequence[Any], moment: Sequence[Any], row: Sequence[Any], share: Any) -> hy.expression:
    """A magnet's point: -½ Σ λ b² of the moment's field b, less its part in u(x) + V(x)·M, see `MutualTable`.

    With d from the point and ĵ along the remanence the parts are (R/d)^2p (v + w (ĵ·d)²/d²) of u, and (R/d)^2q (s ĵ + t
    (ĵ·d) d/d²) of V. `place` (m) and `moment` (A m² times share) are along the body's axes; `row` is the point (3, m),
    λ (3), v, w, s, t of each power, ĵ (3) and R (m). By `share` units become those of the energy, J times share².
    """
    strengths, axis, radius = row[3:6], row[16:19], row[19]
    v4, w4, v5, w5, v6, w6 = (share * share * v for v in row[6:12])
    s5, t5, s6, t6 = (share * s for s in row[12:16])
    d = [x - t for x, t in zip(place, row[:3], strict=True)]
    inverse = 1.0 / hy.sum([x * x for x in d])
    along = hy.sum([m * x for m, x in zip(moment, d, strict=True)])
    field = [3.0 * inverse * along * x - m for x, m in zip(d, moment, strict=True)]  # times 4π d³/μ0
    square = hy.sum([s * (b * b) for s, b in zip(strengths, field, strict=True)])
    answer = (0.5 * UNIT**2) * (inverse * inverse * inverse * square)
    ratio, axial = radius * radius * inverse, hy.sum([j * x for j, x in zip(axis, d, strict=True)])
    pointing = hy.sum([j * m for j, m in zip(axis, moment, strict=True)])
    # Horner's scheme in (R/d)²: every operation of a trajectory's equations costs
    flat = v4 + ratio * (v5 + s5 * pointing + ratio * (v6 + s6 * pointing))
    steep = w4 * axial + ratio * (w5 * axial + t5 * along + ratio * (w6 * axial + t6 * along))
    return -answer - ratio * ratio * ratio * ratio * (flat + inverse * axial * steep)


def coupled_energy(place: Sequence[Any], moment: Sequence[Any], row: Sequence[Any], share: Any) -> hy.expression:
    """Two points' -b·(C b') of fields b, b' of a `moment` at a `place`; `row`: both, m, and C (9, A m²/T); `share`."""
    one, other = (point_field([x - t for x, t in zip(place, p, strict=True)], moment) for p in (row[:3], row[3:6]))
    return -hy.sum([row[6 + 3 * i + j] * (one[i] * other[j]) for i, j in np.ndindex(3, 3)])


def pair_energy(place: Sequence[Any], moment: Sequence[Any], row: Sequence[Any], share: Any) -> hy.expression:
    """By two charges and the sphere's response; `row`: places (6,) m, factor (J), 1/R (1/m), images' weights (3)."""
    a, b = (_scaled(place, p, row[7]) for p in (row[:3], row[3:6]))
    return share * share * (row[6] * response_to_charge(a, b, row[8:]))


def mixed_energy(place: Sequence[Any], moment: Sequence[Any], row: Sequence[Any], share: Any) -> hy.expression:
    """A `moment` in the field of a point that the sphere's response to a charge magnetises, at a `place` (m).

    The moment, A m², is times `share`; `row`: places of charge and point (3 + 3, m), the factor (T), 1/R (1/m) and the
    images' weights (3).
    """
    a, b = (_scaled(place, p, row[7]) for p in (row[:3], row[3:6]))
    given = hy.make_vars("b_x", "b_y", "b_z")
    slope = hy.diff_tensors([response_to_charge(a, given, row[8:])], diff_args=given, diff_order=1).gradient
    field = [hy.subs(part, {str(v): value for v, value in zip(given, b, strict=True)}) for part in slope]
    inverse = 1.0 / hy.sum([x * x for x in b])
    pairs = (b, field), (b, moment), (moment, field)
    along, pointing, both = (hy.sum([x * y for x, y in zip(u, v, strict=True)]) for u, v in pairs)
    return share * (row[6] * (inverse * hy.sqrt(inverse) * (3.0 * inverse * along * pointing - both)))


def point_field(d: Sequence[Any], moment: Sequence[Any]) -> list[hy.expression]:
    """Field (3) T of a moment (A m²) at a way d (3 expressions, m) from it or to it."""
    inverse = 1.0 / hy.sum([t * t for t in d])
    cube = UNIT * (inverse * hy.sqrt(inverse))
    along = 3.0 * inverse * hy.sum([m * t for m, t in zip(moment, d, strict=True)])
    return [cube * (along * t - m) for t, m in zip(d, moment, strict=True)]


def _scaled(place: Sequence[Any], point: Sequence[Any], inverse: Any) -> list[Any]:
    return [(x - t) * inverse for x, t in zip(place, point, strict=True)]


@dataclass(frozen=True, eq=False)
class EnergySum:
    """Σ formula(place, moment, row) over rows: written out for equations of motion, or evaluated with derivatives."""

    formula: Formula  # of one row
    rows: Array  # (n, k) numbers of the formula
    # origin, axes: (3,) m and (3, 3) by columns, of the frame in which the formula is written
    origin: Array = field(default_factory=lambda: np.zeros(3))
    axes: Array = field(default_factory=lambda: np.eye(3))

    def expression(self, position: Sequence[Any], moment: Sequence[Any], share: Any) -> hy.expression:
        """The sum (J times share²) at a position (3 expressions, m) of a moment (A m² times `share`)."""
        away = [x - float(c) for x, c in zip(position, self.origin, strict=True)]
        place, pointing = (turned_expressions(self.axes.T, vector) for vector in (away, moment))
        return hy.sum([self.formula(place, pointing, row, share) for row in self.rows.tolist()])

    def derivatives(self, places: Array, moments: Array, order: int = 2) -> tuple[Array, Array, Array]:
        """The energy and its first and second derivatives by place (m) and moment (A m²), in this order.

        J and its derivatives (m,), (m, 6) and (m, 6, 6), with the `order` 1 none, at `places` (m, 3) m of `moments` (m,
        3) A m², rotor's frame.
        """
        free = np.concatenate([(places - self.origin) @ self.axes, moments @ self.axes], axis=1)
        kernel, (count, width) = _kernel(self.formula, self.rows.shape[1], order), self.rows.shape
        sums = np.zeros((7 + len(ENTRIES) * (order > 1), len(places)))
        step = max(1, EVALUATIONS // max(count, 1))
        for start in range(0, len(places) if count else 0, step):
            some = free[start : start + step]
            given = np.empty((6 + width, len(some), count))
            given[:6], given[6:] = some.T[:, :, None], self.rows.T[:, None]
            found = kernel(given.reshape(6 + width, -1)).reshape(-1, len(some), count)
            sums[:, start : start + step] = found.sum(axis=2)
        turn = np.kron(np.eye(2), self.axes)
        second = turn @ sums[7:].T[..., WHERE] @ turn.T if order > 1 else np.zeros(1)
        return sums[0], sums[1:7].T @ turn.T, second


@cache
def _kernel(formula: Formula, width: int, order: int) -> Any:
    """Compiled formula with derivatives: (28, n), or (7, n) of order 1, for places, moments and rows (6 + width, n)."""
    free = hy.make_vars("x", "y", "z", "m_x", "m_y", "m_z")
    row = [hy.expression(f"n_{k}") for k in range(width)]
    energy = formula(free[:3], free[3:], row, 1.0)
    gradient = list(hy.diff_tensors([energy], diff_args=free, diff_order=1).gradient)
    outputs = [energy, *gradient]
    if order > 1:
        hessian = np.asarray(hy.diff_tensors(gradient, diff_args=free, diff_order=1).jacobian)
        outputs += [hessian[a, b] for a, b in ENTRIES]
    return compiled(hy.cfunc, outputs, [*free, *row], fast_math=True, opt_level=1)


@dataclass(frozen=True, eq=False)
class ResponseGrid:
    """Points of one magnet with their energies, see `point_energy`."""

    box: Box  # of the magnet, see `response_box`
    axis: Array  # (3,) direction of its remanence along the body's axes; zero: none
    radius: float = field(metadata={"units": "m"})  # of the floater, m
    counts: tuple[int, int, int]  # points along each body axis
    strengths: Array = field(metadata={"units": "A m2/T"})  # (n, 3) λ, A m²/T, along the body's axes
    degrees: Array = field(metadata={"units": "J"})  # (n, 3, 2) v and w of each power, J
    returned: Array = field(metadata={"units": "T"})  # (n, 2, 2) s and t of each power, T
    hole: float = field(default=0.0, metadata={"units": "m"})  # radius of one along the third axis, without points, m

    @cached_property
    def points(self) -> Array:
        """(n, 3) m along the body's axes, from its centre: Gauss's in the box."""
        return response_points(self.box, self.counts, self.hole)

    @property
    def places(self) -> Array:
        """(n, 3) m of the points in the rotor's frame."""
        return self.box.center + self.points @ self.box.rotation.T

    def inner(self, number: int) -> Array:
        """(number³, 3) m in the rotor's frame: Gauss's points for what the magnet is as a whole."""
        nodes = gauss_legendre(number)[0]
        return self.box.center + np.array(list(product(nodes, repeat=3))) * self.box.half_edges @ self.box.rotation.T

    def charges(self, number: int) -> tuple[Array, Array]:
        """Places (k, 3) m in the rotor's frame of charges that stand for the remanence, and these (k,).

        On the faces at Gauss's points, `number` along an edge, in units of the charge of a face that the remanence
        leaves upright; with 0 one at each pole, as far out as the box reaches in the mean.
        """
        if not number and self.axis.any():
            pole = float(np.linalg.norm(self.axis * self.box.half_edges)) * (self.box.rotation @ self.axis)
            return self.box.center + np.array([-pole, pole]), np.array([-1.0, 1.0])
        nodes, weights = gauss_legendre(max(number, 1))
        along, places, amounts = list(zip(nodes, weights / 2, strict=True)), [np.zeros((0, 3))], []
        for k in np.flatnonzero(np.abs(self.axis) > PARALLEL):
            for side, (u, first), (v, second) in product((-1.0, 1.0), along, along):
                places.append(np.roll([[side, u, v]], k, axis=1) * self.box.half_edges)
                amounts.append(side * self.axis[k] * first * second)
        return self.box.center + np.concatenate(places) @ self.box.rotation.T, np.array(amounts)

    def fields(self, powers: Sequence[int], places: Array) -> Iterator[tuple[Array, Array]]:
        """For each of the `powers` q what `point_energy` weighs in V: (R/d)^2q ĵ, and (R/d)^2q (ĵ·d) d/d².

        Of all points at `places` (m, 3) m, rotor's frame: (n, m, 3), and by the place (n, m, 3, 3) 1/m. Their part
        along ĵ is what it weighs in u.
        """
        turn, axis = self.box.rotation, self.box.rotation @ self.axis
        away = (places - self.box.center) - (self.points @ turn.T)[:, None]
        inverse, axial = 1 / np.sum(away**2, axis=-1)[..., None], (away @ axis)[..., None]
        steep = away[..., :, None] * axis + axial[..., None] * np.eye(3)
        for q in powers:
            size = (self.radius**2 * inverse) ** q
            upright, turned, fall = size * axis, size * axial * inverse * away, -2 * inverse * away
            yield upright, upright[..., :, None] * (q * fall)[..., None, :]
            slope = turned[..., :, None] * ((q + 1) * fall)[..., None, :]
            yield turned, slope + (size * inverse)[..., None] * steep

    def energy(self) -> EnergySum:
        same = np.broadcast_to([*self.axis, self.radius], (len(self.points), 4))
        parts = (self.points, self.strengths, self.degrees, self.returned, same)
        rows = np.concatenate([part.reshape(len(same), -1) for part in parts], axis=1)
        return EnergySum(point_energy, rows, self.box.center, self.box.rotation)


Grids = Sequence[ResponseGrid]


def coupled_sum(points: Array, coupling: Array) -> EnergySum:
    """-½ bᵀ coupling b of the fields b at points (k, 3) m, with `coupling` (3k, 3k) A m²/T, symmetric."""
    blocks = coupling.reshape(len(points), 3, len(points), 3)
    first, second = np.triu_indices(len(points) if coupling.any() else 0)
    factor = np.where(first == second, 0.5, 1.0)[:, None]
    rows = [points[first], points[second], factor * blocks[first, :, second].reshape(-1, 9)]
    return EnergySum(coupled_energy, np.concatenate(rows, axis=1))


def charge_sum(
    source: ResponseGrid, others: ResponseGrid | Array, images: Array, number: int, weight: float = 1.0
) -> EnergySum:
    """Minus `weight` times the energy of the sphere by what the charges of `source` and of `others` do in it together.

    Of other points (k, 3) m the energy of the moment by their mean response, T, to the sphere's. `images` are the
    weights of the sphere's images, and `number` that of charges along an edge of a face.
    """
    (here, q), formula = source.charges(number), pair_energy
    if isinstance(others, ResponseGrid):
        there, p = others.charges(number)
    else:
        there, p, formula = others, np.full(len(others), 1 / len(others)), mixed_energy
    ends = np.repeat(here, len(there), axis=0), np.tile(there, (len(here), 1))
    factors = -np.outer(weight * q, p).reshape(-1, 1)
    same = np.broadcast_to([1 / source.radius, *images], (len(factors), 1 + len(images)))
    return EnergySum(formula, np.concatenate([*ends, factors, same], axis=1))


def response_points(box: Box, counts: tuple[int, int, int], hole: float) -> Array:
    """Gauss's points (n, 3) m along the edges of a `box`, from its centre, but for those in a `hole`."""
    points = box.half_edges * np.array(list(product(*(gauss_legendre(n)[0] for n in counts))))
    return np.asarray(points[np.hypot(points[:, 0], points[:, 1]) >= hole])


def response_box(body: Solid) -> Box:
    """The box in which a body's points lie: itself, or for round ones a box that hardly leaves it."""
    if isinstance(body, Box):
        return body
    share = np.full(3, IN_SPHERE) if isinstance(body, Sphere) else np.array([IN_CIRCLE, IN_CIRCLE, 1.0])
    return Box(body.size * share, body.center, body.rotation)


def point_counts(box: Box, clearance: float, digits: float) -> tuple[int, int, int]:
    """Gauss points along each edge of a `box` for fields of sources a `clearance` (m) off its faces or more.

    `digits` is -ln of the error, which falls as ρ^-2n, ρ the half axes of the ellipse about the edge through the
    source.
    """
    z = 1 + clearance / box.half_edges
    nx, ny, nz = (int(n) for n in np.ceil(digits / np.log(z + np.sqrt(z * z - 1))))
    return nx, ny, nz


@dataclass(frozen=True, eq=False)
class MutualTable:
    """Mutual magnetisation of rotor and floater, as an energy: U = -½ α B0² + Σ -½ λ b² - u - V·M, M = m + α B0."""

    magnets: tuple[Magnet, ...]  # of the rotor
    grids: tuple[ResponseGrid, ...]  # of those magnets that respond or are magnetised
    # (3k, 3k) A m²/T: energies of the fields at the grids' inner points, -½ bᵀ coupling b
    coupling: Array = field(metadata={"units": "A m2/T"})
    # (n, n) J: energies of the sphere by what two magnets' fields, as those of charges, do in it together
    pairs: Array = field(metadata={"units": "J"})
    # (n, n) T: fields by which the second magnet responds to the sphere's response to the first
    mixed: Array = field(metadata={"units": "T"})
    images: Array  # (3,) weights of the images that stand for its response to charges
    polarizability: float = field(metadata={"units": "A m2/T"})  # α, A m²/T
    # gaps, errors: (k,) m between the bodies, and (k, 2) the largest relative errors of force and torque found there
    gaps: Array = field(default_factory=lambda: np.array([1.0]), metadata={"units": "m"})
    errors: Array = field(default_factory=lambda: np.zeros((1, 2)))
    provenance: dict[str, str | float] = field(default_factory=dict)  # how the table was made; texts and numbers

    @property
    def inner(self) -> int:
        """Points along each axis of a magnet for what it does as a whole."""
        return round(math.cbrt(len(self.coupling) / (3 * max(len(self.grids), 1))))

    @cached_property
    def _sums(self) -> list[EnergySum]:
        """Whose sum is the energy of the moment M."""
        taken, sums = effort(len(self.grids)), [grid.energy() for grid in self.grids]
        inner = [grid.inner(self.inner) for grid in self.grids]
        if self.coupling.any():
            sums.append(coupled_sum(np.concatenate(inner), self.coupling))
        kinds = (self.mixed, inner, taken.reflected), (np.triu(self.pairs), self.grids, taken.charges)
        for weights, others, number in kinds:
            chosen = zip(*np.nonzero(weights), strict=True)
            some = [charge_sum(self.grids[a], others[b], self.images, number, weights[a, b]) for a, b in chosen]
            if some:  # of one formula in one frame, they cost one call
                sums.append(replace(some[0], rows=np.concatenate([one.rows for one in some])))
        return sums

    def energy(
        self, position: Vector, moment: Vector, flux: Vector, share: hy.expression | float = 1.0
    ) -> hy.expression:
        """U as an expression, for the floater's centre at a `position` (3 expressions, m), rotor's frame.

        `moment` (A m²) is the rigid one and `flux` (T) the rotor's field B0, both times `share`, one over the root of a
        unit of energy: the energy comes in J times share².
        """
        whole = [m + self.polarizability * b for m, b in zip(moment, flux, strict=True)]
        parts = [-0.5 * self.polarizability * hy.sum([b * b for b in flux])]
        return hy.sum([*parts, *(one.expression(position, whole, share) for one in self._sums)])

    def derivatives(self, places: Array, moments: Array) -> tuple[Array, Array, Array]:
        """As `EnergySum.derivatives`, of moments M without -½ α B0²."""
        parts = zip(*(one.derivatives(places, moments) for one in self._sums), strict=True)
        energy, slope, second = (np.sum(part, axis=0) for part in parts)
        return energy, slope, second

    def added(self, places: Array, moments: Array, field: Array, gradient: Array) -> tuple[Array, Array, Array]:
        """Energy (n,) J, force (n, 3) N and torque (n, 3) N m added by mutual magnetisation at `places` (n, 3) m.

        With rigid `moments` (n, 3) A m², rotor's frame, where its B0 is `field` (n, 3) T and ∂B0_i/∂x_j `gradient` (n,
        3, 3).
        """
        alpha = self.polarizability
        energy, slope, _ = self.derivatives(places, moments + alpha * field)
        by_place, by_moment = slope[:, :3], slope[:, 3:]
        # M follows the place by B0, so that the force has a part by the moment
        force = -by_place + alpha * np.einsum("ni,nij->nj", field - by_moment, gradient)
        return energy - alpha / 2 * np.sum(field**2, axis=1), force, -np.cross(moments, by_moment)

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of what is added to force and torque, at points (n, 3) m."""
        places = np.asarray(points, float).reshape(-1, 3)
        gap = np.min([magnet.body.distance(places) for magnet in self.magnets], axis=0) - self.grids[0].radius
        at = np.log(np.maximum(gap, self.gaps[0]))
        force, torque = (np.exp(np.interp(at, np.log(self.gaps), np.log(e))) for e in self.errors.T + 1e-12)
        return force, torque

    def __repr__(self) -> str:
        points = sum(len(grid.points) for grid in self.grids)
        found = zip(self.gaps, self.errors.max(axis=1), strict=True)
        errors = ", ".join(f"{e:.1e} at {g * 1e3:.2g} mm" for g, e in found)
        return f"MutualTable: {points} points in {len(self.grids)} magnets; relative error {errors} from contact"


@dataclass(frozen=True, eq=False)
class StrongerMutual:
    """A mutual table of a rotor that is polarised more: u is quadratic in that, V linear, and H does not know it."""

    base: Any  # a `MutualTable`, or one between others
    strong: float

    @property
    def polarizability(self) -> float:
        return float(self.base.polarizability)

    def derivatives(self, places: Array, moments: Array) -> tuple[Array, ...]:
        """See `MutualTable`: the energy of M by J times s is s² that of M/s by J."""
        energy, slope, second = self.base.derivatives(places, moments / self.strong)
        units = np.repeat([1.0, 1 / self.strong], 3)
        square = self.strong**2
        return square * energy, square * slope * units, square * second * np.outer(units, units)
