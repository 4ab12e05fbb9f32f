"""What the shape of a body that is not round about its moment adds to the dipole in its centre of mass.

Three forms of one energy. In a ball of a trajectory it is that of its multipoles up to a degree; their components
along the rotor's axes are states of the motion: they turn with the body, Ṁ = (Ω - W)·G M, as the moment of a round one.
Beside a magnet, where no ball is, it is that of dipoles all over the body. About a pose, for equilibria and modes, it
is force and torque on many such dipoles with their exact derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...fem.harmonics.expressions import regular_harmonics
from ...fem.harmonics.interior import Ball, BallField
from ...fem.harmonics.rigid import field_coefficients, matrices, shells, sizes, translation
from ...fem.rotor.floater import FloaterSources, floater_sources, remanent_sources, shares, slopes_of, strength
from ...fem.rotor.table import DerivedField, FieldFormula, FieldTable, RangeError
from ...geometry.common import Array
from ...geometry.scene.floater import Floater
from ...geometry.solids import Solid
from .effect import Added, Motion, Poses
from .floater_effects import FLOATER_SHAPE
from .state import Parameter, State, Vector, cross, dot, dotted, matrices_of

HIGHEST = 7  # degree of the multipoles in a trajectory
WAY = 3  # degree of what they feel, in a place within a ball
# Of the dipole's force, one radius off the body: shells of multipoles with less are left out of simulations
KEPT = 5e-3
# Size of the multipoles' states by those of the dipole: they act so much less. A step must not be short for their sake.
LITTLE = 0.02
ALLOWED = 2e-4  # error of the force in a ball by that of the dipole
REACHES = 0.6, 0.4, 0.25  # of the distance from a magnet: radii of the sphere on which the field is expanded
# Degrees of the polynomials that dipoles integrate: about a pose of a cube, more of long or hollow bodies up to the
# second; and in motion beside a magnet.
SUMMED, MOST, NEAR = 8, 18, 5


@dataclass(frozen=True, eq=False)
class BodyShape:
    """The shape of a floater in the field of a rotor."""

    field: FieldFormula  # the rotor's
    floater: Floater
    magnets: tuple[Solid, ...]  # bodies of the rotor's magnets
    sources: FloaterSources
    name: str = FLOATER_SHAPE
    first: int | None = None  # number of the first of its runtime parameters; None: as the table writes it
    ball: BallField | None = None  # whose centre and radius are among the runtime parameters

    @classmethod
    def of(cls, floater: Floater, field: FieldFormula, magnets: Sequence[Solid]) -> BodyShape:
        """That of a floater in a `field` of `magnets`."""
        degree = int(min(max(1.0, floater.radius / (floater.inner_radius or 1e-9) / 3**0.5) * SUMMED, MOST))
        sources = floater_sources(floater, degree=degree)
        sources = sources.averaged() if floater.mean and not floater.turned else sources
        return cls(field, floater, tuple(magnets), sources)

    def placed(self, first: int) -> BodyShape:
        """See `Placeable`."""
        return replace(self, first=first)

    def in_ball(self, ball: BallField, first: int) -> BodyShape:
        """See `Fittable`."""
        return replace(self, ball=ball, first=first)

    @property
    def count(self) -> int:
        return 3 + 4 + 6 + 36 if self.ball is None else len(self.kept) * (WAY + 1) ** 2

    # The multipoles

    @cached_property
    def moments(self) -> Array:
        """(K,) A m of degrees up to `HIGHEST` beside the dipole, lengths in its radius, along its own axes."""
        found = self.sources.multipoles(HIGHEST, self.floater.radius)
        found[1:4] -= FloaterSources.dipole(self.floater.dipole).multipoles(1, self.floater.radius)[1:4]
        return found

    @cached_property
    def shares(self) -> Array:
        """(`HIGHEST` + 1,) of each degree in the force one radius off the body, see `fem.rotor.floater.shares`."""
        return shares(self.floater, self.sources, HIGHEST)

    @cached_property
    def kept(self) -> NDArray[np.intp]:
        """(k,) numbers of the multipoles in trajectories."""
        degrees = shells(HIGHEST)
        return np.flatnonzero((self.shares[degrees] > KEPT) & (degrees > 0))

    @property
    def truncation(self) -> float:
        """What simulations leave out of the force one radius off the body, by that of the moment."""
        left = self.shares.sum() - self.shares[np.unique(shells(HIGHEST)[self.kept])].sum()
        ratio = self.shares[-1] / max(self.shares[-3], 1e-300) if self.shares[-3] else 0.0
        return float(left + self.shares[-1] * min(ratio, 1.0) ** 0.5)

    @property
    def _unit(self) -> float:
        """Of the multipoles' states, A m."""
        return strength(self.floater) / self.floater.radius / LITTLE

    def states_at(self, state: State) -> Array:
        """See `Stateful`."""
        axes = state.axes
        assert axes is not None
        turned = self.sources.turned(axes).multipoles(HIGHEST, self.floater.radius)
        turned[1:4] -= FloaterSources.dipole(axes @ self.floater.dipole).multipoles(1, self.floater.radius)[1:4]
        return np.asarray((turned / sizes(HIGHEST))[self.kept] / self._unit)

    # Force and torque

    def added(self, motion: Motion) -> Added:
        if self.first is not None and self.ball is None:
            return self._about_pose(motion)
        if not len(self.kept):  # the dipole is all of it
            return Added()
        states = [hy.expression(f"multipole_{k}") for k in range(len(self.kept))]
        unit = sizes(HIGHEST)[self.kept]
        turns = matrices(HIGHEST)[1][:, self.kept[:, None], self.kept] * unit / unit[:, None]
        turned = [[_combined(row, states) for row in matrix] for matrix in turns]  # (3, k) by a unit turn
        rates = [dot(motion.lag, [part[k] for part in turned]) for k in range(len(states))]
        if self.ball is None:
            return replace(self._by_dipoles(motion), states=states, rates=rates)
        return replace(self._in_ball(motion, states, turned), states=states, rates=rates)

    def _in_ball(self, motion: Motion, states: Vector, turned: Sequence[Vector]) -> Added:
        assert self.ball is not None
        assert self.first is not None
        length, inertia, share = (hy.par[p] for p in (Parameter.LENGTH, Parameter.INERTIA, Parameter.PLATE_SHARE))
        place = regular_harmonics(WAY, self.ball.offset([length * p for p in motion.position]))
        size = len(place)
        numbers = [[hy.par[self.first + k * size + n] for n in range(size)] for k in range(len(states))]
        unit = self._unit * share * share
        sums = [dotted(column, states) for column in zip(*numbers, strict=True)]
        field = [dotted(row, place) for row in numbers]
        slopes = matrices(WAY)[0]
        reach = -unit * length * hy.par[self.ball.first + 3]
        force = [reach * dotted([_combined(column, sums) for column in slope.T], place) for slope in slopes]
        return Added(
            force=force,
            torque=[-unit / inertia * dotted(field, part) for part in turned],
            energy=unit * dotted(sums, place),
        )

    def _by_dipoles(self, motion: Motion) -> Added:
        assert motion.axes is not None
        length, inertia, share = (hy.par[p] for p in (Parameter.LENGTH, Parameter.INERTIA, Parameter.PLATE_SHARE))
        axes, unit, near = motion.axes, share * share, remanent_sources(self.floater, NEAR)
        # what permeability does to the dipole it does to all others here: 1e-3 of the force
        true, plain = (np.linalg.norm(part.multipoles(1, 1.0)) for part in (self.sources, near))
        force, torque, energy = [hy.expression(0.0)] * 3, [hy.expression(0.0)] * 3, hy.expression(0.0)
        dipoles = [(np.zeros(3), -self.floater.dipole), *zip(near.places, true / plain * near.moments, strict=True)]
        for own, pole in dipoles:
            arm, source = ([_combined(part, row) for row in axes] for part in (own, pole))
            place = [length * p + a for p, a in zip(motion.position, arm, strict=True)]
            field, gradient = self.field.expressions(place) if own.any() else (motion.field, motion.gradient)
            pull = [dot(source, [gradient[i][j] for i in range(3)]) for j in range(3)]
            turns = zip(cross(source, field), cross(arm, pull), strict=True)
            force = [f + p for f, p in zip(force, pull, strict=True)]
            torque = [t + b + c for t, (b, c) in zip(torque, turns, strict=True)]
            energy = energy - dot(source, field)
        return Added([unit * length * f for f in force], [unit / inertia * t for t in torque], energy=unit * energy)

    def _about_pose(self, motion: Motion) -> Added:
        assert self.first is not None
        given = [hy.par[self.first + k] for k in range(self.count)]
        if motion.quaternion is None:
            turn: Vector = cross(given[3:6], motion.moment)
        else:
            turn = self._turn(given[3:7], motion.quaternion)
        change = [*(p - q for p, q in zip(motion.position, given[:3], strict=True)), *turn]
        values = [given[7 + i] + dotted(given[13 + 6 * i : 19 + 6 * i], change) for i in range(6)]
        return Added(values[:3], values[3:])

    @staticmethod
    def _turn(before: Vector, quaternion: Vector) -> Vector:
        (w, x, y, z), (a, b, c, d) = before, quaternion
        # twice the vector part of q q0*, which is the small turn from the one to the other
        return [
            2.0 * (-a * x + b * w - c * z + d * y),
            2.0 * (-a * y + b * z + c * w - d * x),
            2.0 * (-a * z - b * y + c * x + d * w),
        ]

    def numbers(self, field: DerivedField, poses: Poses) -> Array:
        """See `Placeable`."""
        which = (Parameter.LENGTH, Parameter.INERTIA, Parameter.PLATE_SHARE)
        length, inertia, share = (poses.values[:, [p]] for p in which)
        if poses.quaternion is None:
            axes, turn = np.array([self.floater.axes(m) for m in poses.moment]), np.pad(poses.moment, ((0, 0), (0, 1)))
        else:
            axes, turn = matrices_of(poses.quaternion), poses.quaternion
        wrench, slopes = self.wrench(field, poses.places, axes)
        units = np.concatenate([np.repeat(share**2 * length, 3, 1), np.repeat(share**2 / inertia, 3, 1)], axis=1)
        steps = np.concatenate([np.repeat(length, 3, 1), np.ones_like(poses.moment)], axis=1)
        scaled = units[:, :, None] * slopes * steps[:, None]
        return np.concatenate([poses.position, turn, units * wrench, scaled.reshape(-1, 36)], axis=1)

    def wrench(self, field: DerivedField, position: Array, axes: Array) -> tuple[Array, Array]:
        """Force and torque (n, 6), N and N m, beside the dipole's, and their derivatives (n, 6, 6).

        The latter by a change of place, m, and by a small turn about the rotor's axes.

        Parameters
        ----------
        field : the rotor's, with its derivatives
        position : (n, 3) of the centre, m, rotor's frame
        axes : (n, 3, 3) whose columns are the body's axes
        """
        own = slopes_of(FloaterSources.dipole(self.floater.dipole), field, position, axes)
        whole = slopes_of(self.sources, field, position, axes)
        return whole[0] - own[0], whole[1] - own[1]

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """See `Fittable`; what the place in the ball does beyond `WAY` is its error."""
        apart = min((float(body.distance(ball.center)) for body in self.magnets), default=np.inf)
        degree = HIGHEST + WAY + 1
        for share in REACHES:
            try:
                there = field_coefficients(
                    lambda points: self._table.evaluate(points)[0],
                    ball.center, max(share * min(apart, 10 * self.floater.radius), ball.radius), degree,
                    self.floater.radius,
                )  # fmt: skip
                break
            except RangeError:
                continue
        else:
            raise RangeError("Input ball must lie where the field of the rotor is known; instead it does not.")
        unit = sizes(HIGHEST)[self.kept, None]
        moved = unit * np.einsum("k,kln->ln", there, translation(degree, WAY + 1))[self.kept]
        way = shells(WAY + 1)
        moved = moved * (ball.radius / self.floater.radius) ** way
        rest = np.linalg.norm(moved[:, way == WAY + 1], axis=1) @ np.abs(self.moments[self.kept] / unit[:, 0])
        error = (WAY + 1) * rest / ball.radius / (strength(self.floater) * float(np.linalg.norm(gradient)) or 1.0)
        return moved[:, way <= WAY].ravel(), float(error) / ALLOWED

    @property
    def _table(self) -> FieldTable:
        return self.field  # type: ignore[return-value]


def _combined(weights: Array, values: Vector) -> hy.expression:
    """Σ weight · value without what is zero."""
    return hy.sum([float(w) * v for w, v in zip(weights, values, strict=True) if w] or [hy.expression(0.0)])
