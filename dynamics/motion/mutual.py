"""Mutual magnetisation: rotor and floater answer to each other's fields, by the energy of a table (`fem.mutual`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.harmonics import BallField
from ...fem.mutual import MutualTable, answers
from ...fem.rotor_tables import FieldTable, RangeError
from ...geometry.basics import Array
from ..motion import Added, Motion, Parameter, Vector, conservative
from .mutual_ball import MutualInBall

MUTUAL = "mutual magnetisation"
UPPER = [(a, b) for a in range(6) for b in range(a, 6)]
ROWS, COLUMNS = np.triu_indices(6)
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
        told = [energy[:, None], slope * units, second[:, ROWS, COLUMNS]]
        return np.concatenate([position, whole, *(share**2 * part for part in told)], axis=1)


def _quadratic(weights: Sequence[hy.expression], away: Sequence[hy.expression]) -> list[hy.expression]:
    return [(0.5 if a == b else 1.0) * w * (away[a] * away[b]) for w, (a, b) in zip(weights, UPPER, strict=True)]
