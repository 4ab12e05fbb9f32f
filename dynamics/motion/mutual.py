"""Polynomials in a ball as products of its harmonics with powers of r², which its field has computed anyway.

What bodies do to each other falls steeply with their distance, but much the same in all its parts: they are q⁻³ times
polynomials with one q of degree 2.  With degree 2 they err by a tenth of what polynomials of degree 3 alone do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import heyoka as hy
import numpy as np

from ...fem.harmonics.expressions import regular_harmonics
from ...fem.harmonics.interior import Ball
from ...fem.harmonics.local import BallField
from ...fem.mutual.making import answers
from ...fem.mutual.table import MutualTable
from ...fem.rotor.table import FieldTable, RangeError
from ...geometry.common import MU_0, Array, even_directions
from ...geometry.magnets import Magnet, polarizability
from ...geometry.scene.contents import Floater
from .effect import Added, Motion, conservative
from .state import Parameter, Vector, dot

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


PARTS = (2, 2, *(1, 1, 1), *(2, 2, 2, 2, 2, 2))
"""Degrees of q, u, the three of V, and xx, xy, xz, yy, yz, zz of H; V is small."""
TOLD = {1: 3, 2: 9}
"""Numbers that tell the derivatives of a polynomial of a degree."""
ALLOWED = 1e-5
"""Error of the force by that of the rigid dipole."""
ENTRIES = [(a, b) for a in range(3) for b in range(a, 3)]


@dataclass(frozen=True, eq=False)
class MutualInBall:
    """The effect in a ball.

    Parameters
    ----------
    table : of the answers
    moment : of the floater, A m², for the error
    ball : whose centre and radius are among the runtime parameters
    first : number of the first of the weights
    name : in results
    """

    table: MutualTable
    moment: float
    ball: BallField
    first: int
    name: str

    @property
    def count(self) -> int:
        """Of the weights."""
        return sum(count(degree) + TOLD[degree] for degree in PARTS)

    def added(self, motion: Motion) -> Added:
        """Force and torque are the derivatives of one energy."""
        length = hy.par[Parameter.LENGTH]
        strength, share = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.PLATE_SHARE]
        induced = hy.par[Parameter.INDUCED]
        offset = self.ball.offset([length * x for x in motion.position])
        bases, start, values, first = [polynomials(degree, offset) for degree in range(3)], self.first, [], []
        for degree in PARTS:
            values.append(weighted_sum(start, bases[degree]))
            start += count(degree)
            first.append(start)
            start += TOLD[degree]
        quadratic, value, *rest = values
        inverse = 1.0 / quadratic
        fall = fallen(inverse)
        flux = [share * b for b in motion.field]
        whole = [strength * m + induced * b for m, b in zip(motion.moment, motion.field, strict=True)]
        linear = [share * v for v in rest[:3]]
        rows = [[rest[3 + ENTRIES.index((min(a, b), max(a, b)))] for b in range(3)] for a in range(3)]
        seen = [v + dot(row, whole) for v, row in zip(linear, rows, strict=True)]
        level = share * share * value + 0.5 * dot(whole, [v + s for v, s in zip(linear, seen, strict=True)])
        factors = [-FALL * (level * inverse), share * share, *(share * m for m in whole)]
        factors += [(0.5 if a == b else 1.0) * whole[a] * whole[b] for a, b in ENTRIES]
        slope = [hy.sum([f * hy.par[k + j] for f, k in zip(factors, first, strict=True)]) for j in range(3)]
        bending = [(f, k + 3) for f, k, degree in zip(factors, first, PARTS, strict=True) if degree > 1]
        bend = [hy.sum([f * hy.par[k + e] for f, k in bending]) for e in range(len(ENTRIES))]
        bends = [[bend[ENTRIES.index((min(a, b), max(a, b)))] for b in range(3)] for a in range(3)]
        scale = -(length * hy.par[self.ball.first + 3]) * fall
        answer = [-fall * s for s in seen]
        pulled = [(length * induced) * (b + a) for a, b in zip(answer, flux, strict=True)]
        return Added(
            force=[scale * (s + dot(row, offset)) for s, row in zip(slope, bends, strict=True)],
            pulled=pulled,
            turning=[strength / hy.par[Parameter.INERTIA] * a for a in answer],
            energy=fall * level - 0.5 * induced * dot(motion.field, flux),
        )

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """See `InBall`; what is missed of the energy is taken to change as fast as a cubic."""
        places = ball.center + ball.radius * nodes()
        values, slope, second = self.table.derivatives(places, np.zeros_like(places))
        parts = np.array([values, *slope[:, 3:].T, *(second[:, 3 + a, 3 + b] for a, b in ENTRIES)])
        units = np.array([1.0, *[self.moment] * 3, *[self.moment**2 / 2] * len(ENTRIES)])
        quadratic, fall = falling(np.linalg.norm(units[:, None] * parts, axis=0))
        numbers, missed = [_with_slopes(PARTS[0], quadratic)], []
        for degree, unit, part in zip(PARTS[1:], units, parts, strict=True):
            solve, basis = fitting(degree)
            weights = solve @ (part / fall)
            missed.append(unit * np.abs(fall * (basis @ weights) - part).max())
            numbers.append(_with_slopes(degree, weights))
        wrong = missed[0] + max(missed[1:4]) + max(missed[4:])
        error = 3 * wrong / (ball.radius * self.moment * float(np.linalg.norm(gradient)))
        return np.concatenate(numbers), float(error) / ALLOWED


def _with_slopes(degree: int, weights: Array) -> Array:
    return np.concatenate([weights, derivatives(degree) @ weights])


MUTUAL = "mutual magnetisation"
UPPER = [(a, b) for a in range(6) for b in range(a, 6)]
MUTUAL_ROWS, MUTUAL_COLUMNS = np.triu_indices(6)
WHICH = [Parameter.LENGTH, Parameter.PLATE_MOMENT, Parameter.PLATE_SHARE]


@dataclass(frozen=True, eq=False)
class Mutual:
    """Rotor and floater magnetise each other.

    Parameters
    ----------
    table : of their answers
    moment : of the floater, A m²
    """

    table: MutualTable
    moment: float
    name: str = MUTUAL

    def added(self, motion: Motion) -> Added:
        """Force and torque are the derivatives of one energy."""

        def energy(position: Vector, moment: Vector, field: Vector) -> hy.expression:
            place = [hy.par[Parameter.LENGTH] * x for x in position]
            strength, share = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.PLATE_SHARE]
            return self.table.energy(place, [strength * m for m in moment], [share * b for b in field], share)

        return conservative(energy, motion)

    def wrench(self, place: Array, direction: Array, field: Array, gradient: Array) -> tuple[Array, Array]:
        """Force (n, 3) N and torque (n, 3) N m at places and directions of the moment (n, 3) in B0 and ∇B0."""
        _, force, torque = answers(self.table, place, self.moment * direction, field, gradient)
        return force, torque

    def doubt(self, points: Array, field: Array) -> tuple[Array, Array]:
        """Errors of torque and force, over the moment, of the moment that turns the worst: (n,) T and (n,) T/m."""
        force, torque = np.zeros(len(points)), np.zeros(len(points))
        for direction in np.eye(3):
            moments = np.broadcast_to(self.moment * direction, points.shape)
            _, slope, _ = self.table.derivatives(points, moments + self.table.polarizability * field)
            force = np.maximum(force, np.linalg.norm(slope[:, :3], axis=1))
            torque = np.maximum(torque, np.linalg.norm(np.cross(moments, slope[:, 3:]), axis=1))
        of_force, of_torque = self.table.relative_error(points)
        return torque * of_torque / self.moment, force * of_force / self.moment

    def placed(self, first: int) -> MutualAtPlace:
        """The same about one pose."""
        return MutualAtPlace(self.table, first)

    def in_ball(self, ball: BallField, first: int) -> MutualInBall:
        """The same in a ball."""
        return MutualInBall(self.table, self.moment, ball, first, self.name)


@dataclass(frozen=True, eq=False)
class MutualAtPlace:
    """The same, its energy a polynomial of second degree in place and moment M = m + α B0 about one pose.

    Parameters
    ----------
    table : of the answers
    first : number of the first of its runtime parameters: pose (6), energy, gradient (6), second derivatives (21)
    """

    table: MutualTable
    first: int
    name: str = MUTUAL

    @property
    def count(self) -> int:
        """Of the runtime parameters."""
        return 13 + len(UPPER)

    def added(self, motion: Motion) -> Added:
        """Force, torque and their first derivatives are right at the pose."""
        strength, share = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.PLATE_SHARE]
        induced = hy.par[Parameter.INDUCED]
        number = [hy.par[self.first + k] for k in range(self.count)]

        def energy(position: Vector, moment: Vector, field: Vector) -> hy.expression:
            whole = [strength * m + induced * b for m, b in zip(moment, field, strict=True)]
            away = [q - centre for q, centre in zip([*position, *whole], number[:6], strict=True)]
            parts = [number[6], *(g * q for g, q in zip(number[7:13], away, strict=True))]
            parts += _quadratic(number[13:], away)
            return hy.sum(parts) - 0.5 * share * induced * hy.sum([b * b for b in field])

        return conservative(energy, motion)

    def numbers(self, field: FieldTable, position: Array, moment: Array, values: Array) -> Array:
        """(n, count) for scaled positions and moments (n, 3), and runtime parameters (n, p)."""
        length, strength, share = values[:, WHICH].T[:, :, None]
        place = position * length
        try:
            flux = field.evaluate(place)[0]
        except RangeError:  # some are in a magnet
            flux, known = np.zeros(place.shape), field.in_range(place)
            flux[known] = field.evaluate(place[known])[0]
        whole = strength * moment + self.table.polarizability * share * flux
        energy, slope, second = self.table.derivatives(place, whole / share)
        units = np.repeat(np.concatenate([length, 1 / share], axis=1), 3, axis=1)
        second = second * units[:, :, None] * units[:, None, :]
        told = [energy[:, None], slope * units, second[:, MUTUAL_ROWS, MUTUAL_COLUMNS]]
        return np.concatenate([position, whole, *(share**2 * part for part in told)], axis=1)


def _quadratic(weights: Sequence[hy.expression], away: Sequence[hy.expression]) -> list[hy.expression]:
    return [(0.5 if a == b else 1.0) * w * (away[a] * away[b]) for w, (a, b) in zip(weights, UPPER, strict=True)]


STEP = 0.02
"""Of the differences, in floater radii."""


def rough_force(
    magnets: Sequence[Magnet], floater: Floater, table: FieldTable, place: Array, direction: Array
) -> Array:
    """Force (3,) N that the answers add at a place (3,) m for a direction of the moment; good to a factor of two."""
    step = STEP * floater.radius
    places = place + step * np.concatenate([np.eye(3), -np.eye(3)])
    field = table.evaluate(places)[0]
    energy = -floater.polarizability / 2 * np.sum(field**2, axis=1)
    for magnet in magnets:
        offset = places - magnet.box.center
        distance = np.linalg.norm(offset, axis=1)
        along = offset @ direction / distance
        square = (MU_0 / (4 * np.pi) * floater.moment / distance**3) ** 2 * (1 + 3 * along**2)
        energy -= polarizability(magnet.body.volume, 1 + magnet.contrast) / 2 * square
    return np.asarray((energy[3:] - energy[:3]) / (2 * step))
