"""Currents in the rotor in a ball of a flight: the matrix of their losses with runtime parameters as weights.

A rate u_k = d/dt m·c_k is linear in eight numbers, the five of the traceless symmetric part of m ⊗ (drift) and the
three of the rate of m, by the five of ∇c_k and the three of c_k.  So the power is quadratic in them, with a matrix S of
place alone, S_ab = Σ_k w_ka w_kb, whatever the moment is: q⁻³ times polynomials of degree 1 (`ball_polynomials`).
The work that force and torque do is that power exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.harmonics.interior import Ball
from ...fem.harmonics.local import BallField
from ...fem.rotor.table import FieldTable
from ...fem.rotor_metal import RotorLosses
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from .effect import Added, Motion, dissipative
from .mutual import count, fallen, falling, fitting, nodes, polynomials, weighted_sum
from .state import Parameter, Scales, State, Vector, cross, dot

NUMBERS = 8
UPPER = ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2))
"""Entries of the gradient that tell it."""
ENTRIES = [(a, b) for a in range(NUMBERS) for b in range(a, NUMBERS)]
DIAGONAL = [ENTRIES.index((a, a)) for a in range(NUMBERS)]
UNIT = 1e-2
"""Length by which gradients count beside fields, m: about a place's distance from the currents."""
ALLOWED = 5e-3
"""Error of S by its largest entry; the table has 1e-2 in contact and 1e-3 farther off."""


@dataclass(frozen=True, eq=False)
class RotorCurrentsInBall:
    """The brake in a ball.

    Parameters
    ----------
    table : of the losses
    ball : whose centre and radius are among the runtime parameters
    first : number of the first of the weights: of q (10), and of the 36 entries of S (4 each)
    name : in results
    """

    table: RotorLosses
    ball: BallField
    first: int
    name: str

    @property
    def count(self) -> int:
        """Of the weights."""
        return count(2) + len(ENTRIES) * count(1)

    def added(self, motion: Motion) -> Added:
        """Force and torque are minus half the derivatives of the power by drift and turning."""
        length, moment, drift = hy.par[Parameter.LENGTH], motion.moment, motion.drift
        offset = self.ball.offset([length * x for x in motion.position])
        linear, start = polynomials(1, offset), self.first + count(2)
        known = {pair: weighted_sum(start + k * count(1), linear) for k, pair in enumerate(ENTRIES)}
        inverse = 1.0 / weighted_sum(self.first, polynomials(2, offset))
        last = moment[2] * drift[2]
        pairs = [moment[0] * drift[0] - last, moment[1] * drift[1] - last]
        pairs += [moment[i] * drift[j] + moment[j] * drift[i] for i, j in UPPER[2:]]
        rates = [*(length * p for p in pairs), *cross(motion.lag, moment)]
        strength = hy.par[Parameter.PLATE_MOMENT] * hy.par[Parameter.PLATE_MOMENT] / hy.par[Parameter.TIME]
        scale = -strength * fallen(inverse)
        sums = [hy.sum([known[min(a, b), max(a, b)] * r for b, r in enumerate(rates)]) for a in range(NUMBERS)]
        xx, yy, xy, xz, yz, *field = (scale * s for s in sums)
        slopes = [[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]]
        force = [length * hy.sum([m * s for m, s in zip(moment, row, strict=True)]) for row in slopes]
        return braked(force, field, motion)

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """See `InBall`."""
        fields, slopes = self.table.fields(ball.center + ball.radius * nodes())
        upper = np.stack([slopes[..., i, j] for i, j in UPPER], axis=2)
        rows = np.concatenate([upper, fields], axis=2)
        parts = np.array([np.einsum("nk,nk->n", rows[..., a], rows[..., b]) for a, b in ENTRIES])
        lengths = np.repeat([UNIT, 1.0], (5, 3))
        units = np.array([lengths[a] * lengths[b] for a, b in ENTRIES])
        solve, basis = fitting(1)
        quadratic, fall = falling(units[DIAGONAL] @ parts[DIAGONAL])
        weights = (parts / fall) @ solve.T
        missed = units * np.abs(fall * (weights @ basis.T) - parts).max(axis=1)
        error = float(missed.max() / (units * np.abs(parts).max(axis=1)).max())
        return np.concatenate([quadratic, weights.ravel()]), error / ALLOWED


def braked(force: Vector, field: Vector, motion: Motion) -> Added:
    """An effect by its force and by the field (scaled) that turns the moment."""
    torque = [t / hy.par[Parameter.INERTIA] for t in cross(motion.moment, field)]
    return dissipative(force, torque, motion)


ROTOR_CURRENTS = "currents in the rotor"
UPPER_ = [(a, b) for a in range(6) for b in range(a, 6)]


@dataclass(frozen=True, eq=False)
class RotorCurrents:
    """The brake of a table."""

    table: RotorLosses
    name: str = ROTOR_CURRENTS

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin."""
        length, weights = hy.par[Parameter.LENGTH], self.table.weights
        strength = hy.par[Parameter.PLATE_MOMENT] * hy.par[Parameter.TIME] ** -0.5  # m/√E per √T
        multipoles = self.table.multipoles.expressions([length * x for x in motion.position])
        moment, drift, turning = motion.moment, motion.drift, cross(motion.lag, motion.moment)
        heard = []
        for field, slope in multipoles:
            carried = [dot(moment, [slope[i][j] for i in range(3)]) for j in range(3)]
            heard.append(length * dot(carried, drift) + dot(field, turning))
        rates = [strength * _sum(row, heard) for row in weights]
        answers = [-strength * _sum(column, rates) for column in weights.T]
        field = [hy.sum([s * b[i] for s, (b, _) in zip(answers, multipoles, strict=True)]) for i in range(3)]
        slopes = [
            [hy.sum([s * g[i][j] for s, (_, g) in zip(answers, multipoles, strict=True)]) for j in range(3)]
            for i in range(3)
        ]
        force = [length * dot(moment, [slopes[i][j] for i in range(3)]) for j in range(3)]
        return braked(force, field, motion)

    def placed(self, first: int) -> RotorCurrentsAtPlace:
        """The same about one pose."""
        return RotorCurrentsAtPlace(self.table, first)

    def in_ball(self, ball: BallField, first: int) -> RotorCurrentsInBall:
        """The same in a ball."""
        return RotorCurrentsInBall(self.table, ball, first, self.name)


@dataclass(frozen=True, eq=False)
class RotorCurrentsAtPlace:
    """The same with the matrix D of one pose: right there, and its derivatives where the floater is in step.

    Parameters
    ----------
    table : of the losses
    first : number of the first of its runtime parameters: D (21) by drift and by the rate of m̂, scaled
    """

    table: RotorLosses
    first: int
    name: str = ROTOR_CURRENTS

    @property
    def count(self) -> int:
        """Of the runtime parameters."""
        return len(UPPER_)

    def added(self, motion: Motion) -> Added:
        """Force and torque are -D of drift and turning."""
        known = {pair: hy.par[self.first + k] for k, pair in enumerate(UPPER_)}
        rates = [*motion.drift, *cross(motion.lag, motion.moment)]
        force = [-hy.sum([known[min(a, b), max(a, b)] * r for b, r in enumerate(rates)]) for a in range(6)]
        return braked(force[:3], force[3:], motion)

    def numbers(self, field: FieldTable, position: Array, moment: Array, values: Array) -> Array:
        """(n, count) for scaled positions and moments (n, 3), and runtime parameters (n, p)."""
        length, strength, time = (
            values[:, p, None, None] for p in (Parameter.LENGTH, Parameter.PLATE_MOMENT, Parameter.TIME)
        )
        fields, slopes = self.table.fields(position * length[:, 0])
        rates = np.concatenate([length * np.einsum("ni,nkia->nka", moment, slopes), fields], axis=2)
        scaled = rates * strength / np.sqrt(time)
        matrix = np.einsum("nka,nkb->nab", scaled, scaled)
        return np.array([matrix[:, a, b] for a, b in UPPER_]).T


def _sum(weights: Array, terms: Sequence[hy.expression]) -> hy.expression:
    return hy.sum([float(w) * t for w, t in zip(weights, terms, strict=True) if w])


class Dissipation(Protocol):
    """Losses in metal that turns with the rotor."""

    def dissipation(self, positions: ArrayLike, moments: ArrayLike) -> Array:
        """D (n, 6, 6) of dipoles (n, 3) A m² at (n, 3) m: N s/m, N s and N m s."""


def brake_slope(table: Dissipation, scene: Scene, state: State) -> Array:
    """(12, 12): what the currents add to the derivatives of the scaled rates of a floater in step with the rotor."""
    scales, floater = Scales.of(scene), scene.floater
    matrix = table.dissipation(state.position[None], floater.moment * state.moment[None])[0]
    units = np.repeat([scales.length, 1.0], 3) / scales.time
    masses = np.repeat([floater.mass * scales.length, floater.inertia], 3) / scales.time**2
    spin = scales.pack(state)[9:] - [0.0, 0.0, scene.angular_velocity * scales.time]
    rates = np.zeros((6, 12))
    rates[:, 3:6], rates[:, 9:] = np.eye(6)[:, :3], np.eye(6)[:, 3:]
    rates[0, 1] = scene.angular_velocity * scales.time
    rates[1, 0] = -rates[0, 1]
    rates[3:, 6:9] = -float(spin @ state.moment) * np.eye(3)  # turning m̂ in a spin about it is a turn as well
    found = np.zeros((12, 12))
    found[[3, 4, 5, 9, 10, 11]] = -(matrix * units / masses[:, None]) @ rates
    return found
