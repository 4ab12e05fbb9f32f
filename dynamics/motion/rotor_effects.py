"""What rotor and floater do to each other beyond the rotor's field: mutual magnetisation, and a brake by its currents.

Both are known as tables, whose expressions are long.  About a pose and in a ball they are polynomials about a place,
whose numbers are runtime parameters.  What bodies do to each other falls steeply with their distance, but much the same
in all its parts: in a ball they are q⁻³ times polynomials with one q of degree 2, which with degree 2 err by a tenth of
what polynomials of degree 3 alone do.

With M = m + α B0 the floater's whole moment, mutual magnetisation has the energy u(x) + V(x)·M + ½ M·H(x)·M.  About one
pose (searches, modes) u, V and H are polynomials of degree 2, 1 and 0, and M is counted from the pose's.

The currents are in metal that turns with the rotor.  A rate u_k = d/dt m·c_k is linear in eight numbers, the five of
the traceless symmetric part of m ⊗ (drift) and the three of the rate of m, by the five of ∇c_k and the three of c_k. So
the power is quadratic in them, with a matrix S of place alone, S_ab = Σ_k w_ka w_kb.  About one pose S is a constant:
where the floater is frequency-locked the rates vanish, so that derivatives are right as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol, Self

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.harmonics.expressions import weighted
from ...fem.harmonics.interior import Ball, BallField
from ...fem.mutual.table import MutualTable
from ...fem.rotor.table import DerivedField, FieldTable
from ...fem.rotor_metal import GRADIENT, PRODUCTS, RotorLosses
from ...geometry.common import MU_0, Array, even_directions
from ...geometry.magnets import Magnet, polarizability
from ...geometry.scene.contents import Scene
from ...geometry.scene.floater import Floater
from .effect import SMALLEST, ZERO, Added, Motion, Poses, conservative, dissipative
from .state import Parameter, Scales, State, Vector, add, cross, dot, dotted, rotation_slopes, subtract

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


def falling(size: Array, kept: ArrayLike = True) -> tuple[Array, Array]:
    """Weights (10,) of q and q⁻³ (n,) for the size (n,) > 0, at the nodes, of what it bounds; those not `kept` zero."""
    solve, basis = fitting(2)
    weights = solve @ (size / size[0]) ** (-1 / FALL) * np.asarray(kept)
    return weights, (basis @ weights) ** -FALL


@dataclass(frozen=True, eq=False, kw_only=True)
class _Near:
    """An effect as its table writes it, about a pose, or in a ball."""

    first: int | None = None  # number of the first of its runtime parameters; None: as the table writes it
    ball: BallField | None = None  # whose centre and radius are among the runtime parameters

    def placed(self, first: int) -> Self:
        return replace(self, first=first)

    def in_ball(self, ball: BallField, first: int) -> Self:
        return replace(self, ball=ball, first=first)


MUTUAL = "mutual magnetisation"
# Degrees of u, the three of V, and xx, xy, xz, yy, yz, zz of H in a ball; V is small.
IN_BALL = (2, *(1, 1, 1), *(2, 2, 2, 2, 2, 2))
# The same in the smallest ball of a body that is not round: 3e-5 of the force at its surface
IN_SMALLEST = (1, *(0, 0, 0), *(1, 1, 1, 1, 1, 1))
# Whether q, u, V and H are odd in y where the rotor is its own mirror image, and which monomials are
ODD_PARTS = (False, False, *(i == 1 for i in range(3)), *((a == 1) != (b == 1) for a, b in PAIRS))
ODD_MONOMIALS = (False, *(i == 1 for i in range(3)), *((a == 1) != (b == 1) for a, b in PAIRS))
AT_POSE = (2, *(1, 1, 1), *(0, 0, 0, 0, 0, 0))
ALLOWED, ALLOWED_IN_SMALLEST = 1e-5, 1e-4  # Error of the force by that of the rigid dipole
WHICH = [Parameter.LENGTH, Parameter.PLATE_MOMENT, Parameter.PLATE_SHARE]
STEP = 0.02  # Of the differences of `rough_force`, in floater radii


@dataclass(frozen=True, eq=False)
class Mutual(_Near):
    """Rotor and floater magnetise each other."""

    table: MutualTable  # of what they induce in each other
    moment: float  # of the floater, A m²
    name: str = MUTUAL

    @property
    def count(self) -> int:
        return 6 + sum(COUNT[n] for n in AT_POSE) if self.ball is None else sum(COUNT[n] for n in (2, *self._degrees))

    @property
    def _degrees(self) -> tuple[int, ...]:
        return IN_SMALLEST if self.ball is not None and self.ball.degree == SMALLEST else IN_BALL

    def added(self, motion: Motion) -> Added:
        if self.first is None:
            return conservative(self._energy, motion)
        length, strength, share = (motion.given[p] for p in WHICH)
        induced = motion.given[Parameter.INDUCED]
        flux = [share * b for b in motion.field]
        # in the unit of √energy, so that the unit of energy enters nowhere else
        away = [strength * m + induced * b for m, b in zip(motion.moment, motion.field, strict=True)]
        if self.ball is None:
            centre = [hy.par[self.first + k] for k in range(6)]
            offset, unit = subtract(motion.position, centre[:3]), hy.expression(1.0)
            away, start, degrees = subtract(away, centre[3:]), self.first + 6, [*AT_POSE]
        else:
            offset = self.ball.offset([length * x for x in motion.position])
            unit, start, degrees = length * hy.par[self.ball.first + 3], self.first, [2, *self._degrees]
        basis, weights = monomials(2, offset, hy.expression(1.0)), []
        for degree, kept in zip(degrees, self._kept[-len(degrees) :], strict=True):
            weights.append([hy.par[start + k] if kept[k] else ZERO for k in range(COUNT[degree])])
            start += COUNT[degree]
        value, *rest = [polynomial(row, basis) for row in weights[-len(AT_POSE) :]]
        linear = [share * v for v in rest[:3]]
        rows = [[rest[3 + _pair(a, b)] for b in range(3)] for a in range(3)]
        seen = [v + dot(row, away) for v, row in zip(linear, rows, strict=True)]  # the energy's derivative by M
        level = share * share * value + 0.5 * dot(away, add(linear, seen))
        # the energy is Σ factor · part: first the factors are summed into one polynomial, which is then differentiated
        factors = [share * share, *(share * m for m in away)]
        factors += [(0.5 if a == b else 1.0) * away[a] * away[b] for a, b in PAIRS]
        fall = hy.expression(1.0)
        if self.ball is not None:
            inverse = 1.0 / polynomial(weights[0], basis)
            fall, factors = inverse * inverse * inverse, [-FALL * (level * inverse), *factors]
        pairs = list(zip(factors, weights, strict=True))
        slope = [hy.sum([f * row[1 + j] for f, row in pairs if len(row) > 1]) for j in range(3)]
        bend = [hy.sum([f * row[4 + k] for f, row in pairs if len(row) > 4]) for k in range(len(PAIRS))]
        scale, induced_field = -unit * fall, [-fall * s for s in seen]
        return Added(
            force=[
                scale * hy.sum([slope[j], *(_twice(j, b) * bend[_pair(j, b)] * offset[b] for b in range(3))])
                for j in range(3)
            ],
            pulled=[(length * induced) * (a + b) for a, b in zip(induced_field, flux, strict=True)],
            turning=[strength / motion.given[Parameter.INERTIA] * b for b in induced_field],
            energy=fall * level - 0.5 * induced * dot(motion.field, flux),
        )

    @property
    def _kept(self) -> Array:
        """(11, 10) which weights of q, u, V and H are not zero."""
        mirrored = self.ball is not None and self.ball.mirrored
        return np.asarray((np.array(ODD_PARTS)[:, None] == np.array(ODD_MONOMIALS)) | (not mirrored))

    def _energy(self, position: Vector, moment: Vector, field: Vector) -> hy.expression:
        place = [hy.par[Parameter.LENGTH] * x for x in position]
        strength, share = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.PLATE_SHARE]
        return self.table.energy(place, [strength * m for m in moment], [share * b for b in field], share)

    def numbers(self, field: DerivedField, poses: Poses) -> Array:
        length, strength, share = poses.values[:, WHICH].T[:, :, None]
        whole = strength * poses.moment + self.table.polarizability * share * poses.flux
        energy, slope, second = self.table.derivatives(poses.places, whole / share)
        units = np.repeat(np.concatenate([length, np.ones_like(length)], axis=1), 3, axis=1)
        slope, second = slope * units, second * units[:, :, None] * units[:, None, :]
        quadratic = np.stack([second[:, a, b] / _twice(a, b) for a, b in PAIRS], axis=1)
        linear = np.concatenate([slope[:, 3:, None], second[:, 3:, :3]], axis=2).reshape(-1, 12)
        constant = np.stack([second[:, 3 + a, 3 + b] for a, b in PAIRS], axis=1)
        return np.concatenate(
            [poses.position, whole, energy[:, None], slope[:, :3], quadratic, linear, constant], axis=1
        )

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """See `Fittable`; what is missed of the energy is taken to change as fast as a cubic."""
        places = ball.center + ball.radius * nodes()
        values, slope, second = self.table.derivatives(places, np.zeros_like(places))
        parts = np.array([values, *slope[:, 3:].T, *(second[:, 3 + a, 3 + b] for a, b in PAIRS)])
        units = np.array([1.0, *[self.moment] * 3, *[self.moment**2 / 2] * len(PAIRS)])
        of_size, *of_parts = self._kept
        quadratic, fall = falling(np.linalg.norm(units[:, None] * parts, axis=0), of_size)
        numbers, missed = [quadratic], []
        for degree, unit, part, kept in zip(self._degrees, units, parts, of_parts, strict=True):
            solve, basis = fitting(degree)
            numbers.append(solve @ (part / fall) * kept[: len(solve)])
            missed.append(unit * np.abs(fall * (basis @ numbers[-1]) - part).max())
        wrong = missed[0] + max(missed[1:4]) + max(missed[4:])
        error = 3 * wrong / (ball.radius * self.moment * float(np.linalg.norm(gradient)))
        return np.concatenate(numbers), float(error) / (ALLOWED if self._degrees is IN_BALL else ALLOWED_IN_SMALLEST)

    def wrench(self, place: Array, direction: Array, field: Array, gradient: Array) -> tuple[Array, Array]:
        """Force (n, 3) N and torque (n, 3) N m at places and directions (n, 3), in `field` B0 and `gradient` ∇B0."""
        _, force, torque = self.table.added(place, self.moment * direction, field, gradient)
        return force, torque

    def doubt(self, points: Array, field: Array) -> tuple[Array, Array]:
        """Errors of torque and force, over the moment, of the moment that turns the worst: (n,) T and (n,) T/m."""
        of_force, of_torque = self.table.relative_error(points)
        torque, force = self.sizes(points, field)
        return torque * of_torque, force * of_force

    def sizes(self, points: Array, field: Array) -> tuple[Array, Array]:
        """Torque and force over the moment, as for `doubt`."""
        force, torque = np.zeros(len(points)), np.zeros(len(points))
        for direction in np.eye(3):
            moments = np.broadcast_to(self.moment * direction, points.shape)
            _, slope, _ = self.table.derivatives(points, moments + self.table.polarizability * field)
            force = np.maximum(force, np.linalg.norm(slope[:, :3], axis=1))
            torque = np.maximum(torque, np.linalg.norm(np.cross(moments, slope[:, 3:]), axis=1))
        return torque / self.moment, force / self.moment


def _pair(a: int, b: int) -> int:
    return PAIRS.index((min(a, b), max(a, b)))


def _twice(a: int, b: int) -> float:
    """Second derivative of the monomial x_a x_b."""
    return 2.0 if a == b else 1.0


def rough_force(
    magnets: Sequence[Magnet], floater: Floater, table: FieldTable, place: Array, direction: Array
) -> Array:
    """Force (3,) N that induced magnetisation of `magnets` and `floater` adds to that in `table`, to a factor of two.

    At a `place` (3,) m, for a `direction` of the moment; NaN in a ring's hole, where dipoles stand for no magnet.
    """
    if any(np.linalg.norm(place - m.box.center) < m.box.half_edges.min() + floater.inner_radius for m in magnets):
        return np.full(3, np.nan)
    step = STEP * floater.radius
    places = place + step * np.concatenate([np.eye(3), -np.eye(3)])
    energy = -floater.polarizability / 2 * np.sum(table.evaluate(places)[0] ** 2, axis=1)
    for magnet in magnets:
        offset = places - magnet.box.center
        distance = np.linalg.norm(offset, axis=1)
        along = offset @ direction / distance
        square = (MU_0 / (4 * np.pi) * floater.moment / distance**3) ** 2 * (1 + 3 * along**2)
        energy -= polarizability(magnet.body.volume, 1 + magnet.contrast) / 2 * square
    return np.asarray((energy[3:] - energy[:3]) / (2 * step))


ROTOR_CURRENTS = "currents in the rotor"
NUMBERS = 8
DIAGONAL = [PRODUCTS.index((a, a)) for a in range(NUMBERS)]
UNIT = 1e-2  # Length by which gradients count beside fields, m: about a place's distance from the currents
BRAKE_ALLOWED = 5e-3  # Error of S by its largest entry; the table has 1e-2 in contact and 1e-3 farther off


@dataclass(frozen=True, eq=False)
class RotorCurrents(_Near):
    """The brake of a table."""

    table: RotorLosses  # of the losses
    name: str = ROTOR_CURRENTS

    @property
    def count(self) -> int:
        return len(PRODUCTS) if self.ball is None else COUNT[2] + len(PRODUCTS) * COUNT[1]

    def added(self, motion: Motion) -> Added:
        """Force and torque are minus half the derivatives of the power by drift and turning."""
        length, moment, drift = hy.par[Parameter.LENGTH], motion.moment, motion.drift
        last = moment[2] * drift[2]
        pairs = [moment[0] * drift[0] - last, moment[1] * drift[1] - last]
        pairs += [moment[i] * drift[j] + moment[j] * drift[i] for i, j in GRADIENT[2:]]
        rates = [*(length * p for p in pairs), *cross(motion.lag, moment)]
        strength = hy.par[Parameter.PLATE_MOMENT] * hy.par[Parameter.PLATE_MOMENT] / hy.par[Parameter.TIME]
        xx, yy, xy, xz, yz, *field = (-strength * s for s in self._response(motion, rates))
        force = [length * dotted(moment, row) for row in [[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]]]
        return dissipative(force, [t / hy.par[Parameter.INERTIA] for t in cross(moment, field)], motion)

    def _response(self, motion: Motion, rates: Vector) -> Vector:
        metres = [hy.par[Parameter.LENGTH] * x for x in motion.position]
        if self.first is None:
            parts = self.table.multipoles.expressions(metres)
            rows = [[*(slope[i][j] for i, j in GRADIENT), *field] for field, slope in parts]
            signals, weights = [dotted(row, rates) for row in rows], self.table.weights
            induced = [weighted(w, signals) for w in weights]
            strengths = [weighted(w, induced) for w in weights.T]
            return [dotted(strengths, column) for column in zip(*rows, strict=True)]
        if self.ball is None:
            entries = [hy.par[self.first + k] for k in range(len(PRODUCTS))]
        else:
            basis, start = monomials(2, self.ball.offset(metres), hy.expression(1.0)), self.first
            inverse = 1.0 / polynomial([hy.par[start + k] for k in range(COUNT[2])], basis)
            rates = [inverse * inverse * inverse * r for r in rates]
            start, size = start + COUNT[2], COUNT[1]
            entries = [
                polynomial([hy.par[start + n * size + k] for k in range(size)], basis) for n in range(len(PRODUCTS))
            ]
        known = dict(zip(PRODUCTS, entries, strict=True))
        return [dotted([known[min(a, b), max(a, b)] for b in range(NUMBERS)], rates) for a in range(NUMBERS)]

    def numbers(self, field: DerivedField, poses: Poses) -> Array:
        return self.table.products(poses.places).T

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        parts = self.table.products(ball.center + ball.radius * nodes())
        lengths = np.repeat([UNIT, 1.0], (5, 3))
        units = np.array([lengths[a] * lengths[b] for a, b in PRODUCTS])
        solve, basis = fitting(1)
        quadratic, fall = falling(units[DIAGONAL] @ parts[DIAGONAL])
        weights = (parts / fall) @ solve.T
        missed = units * np.abs(fall * (weights @ basis.T) - parts).max(axis=1)
        error = float(missed.max() / (units * np.abs(parts).max(axis=1)).max())
        return np.concatenate([quadratic, weights.ravel()]), error / BRAKE_ALLOWED


class Dissipation(Protocol):
    """Losses in metal that turns with the rotor."""

    def dissipation(self, positions: ArrayLike, moments: ArrayLike) -> Array:
        """D (n, 6, 6) of dipoles (n, 3) A m² at (n, 3) m: N s/m, N s and N m s."""


def brake_slope(table: Dissipation, scene: Scene, state: State) -> Array:
    """(12, 12) or (13, 13): what currents of `table` add to slopes of scaled rates of `scene` in `state`, locked."""
    scales, floater = Scales.of(scene), scene.floater
    matrix = table.dissipation(state.position[None], floater.moment * state.moment[None])[0]
    units = np.repeat([scales.length, 1.0], 3) / scales.time
    masses = np.repeat([floater.mass * scales.length, floater.inertia], 3) / scales.time**2
    packed, size, rate = scales.pack(state), scales.size, scene.angular_velocity * scales.time
    rates = np.zeros((6, size))
    rates[:3, 3:6], rates[0, 1], rates[1, 0] = np.eye(3), rate, -rate
    if state.axes is None:
        lag = packed[9:] - [0.0, 0.0, rate]
        rates[3:, 6:9] = -float(lag @ state.moment) * np.eye(3)  # turning m̂ in a spin about it is a turn as well
        rates[3:, 9:] = np.eye(3)
    else:
        rates[3:, 6:10], rates[3:, 10:] = (rotation_slopes(packed[6:10]) @ packed[10:]).T, state.axes
    push = -(matrix * units / masses[:, None]) @ rates
    if state.axes is not None:
        push[3:] = state.axes.T @ push[3:] * (floater.inertia / floater.principal_inertia)[:, None]
    found = np.zeros((size, size))
    found[[3, 4, 5, -3, -2, -1]] = push
    return found
