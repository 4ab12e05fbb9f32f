"""Brake by currents in metal that turns with the rotor, in the table's own form, about a pose and in a ball.

A rate u_k = d/dt m·c_k is linear in eight numbers, the five of the traceless symmetric part of m ⊗ (drift) and the
three of the rate of m, by the five of ∇c_k and the three of c_k.  So the power is quadratic in them, with a matrix S of
place alone, S_ab = Σ_k w_ka w_kb, whatever the moment is.  About one pose S is a constant: where the floater is in step
the rates vanish, so that derivatives are right as well.  In a ball S is q⁻³ times polynomials of degree 1
(`local_polynomials`).  The work that force and torque do is that power exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.harmonics.interior import Ball
from ...fem.harmonics.local import BallField
from ...fem.plate.multipoles import weighted
from ...fem.rotor.table import FieldTable
from ...fem.rotor_metal import RotorLosses
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from .effect import Added, Motion, dissipative
from .local_polynomials import COUNT, falling, fitting, monomials, nodes, polynomial
from .state import Parameter, Scales, State, Vector, cross, dotted

ROTOR_CURRENTS = "currents in the rotor"
NUMBERS = 8
UPPER = ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2))  # Entries of the gradient that tell it
ENTRIES = [(a, b) for a in range(NUMBERS) for b in range(a, NUMBERS)]
DIAGONAL = [ENTRIES.index((a, a)) for a in range(NUMBERS)]
UNIT = 1e-2  # Length by which gradients count beside fields, m: about a place's distance from the currents
ALLOWED = 5e-3  # Error of S by its largest entry; the table has 1e-2 in contact and 1e-3 farther off


@dataclass(frozen=True, eq=False)
class RotorCurrents:
    """The brake of a table."""

    table: RotorLosses  # of the losses
    name: str = ROTOR_CURRENTS
    # number of the first of its runtime parameters about a pose or in a ball; None: as the table writes it
    first: int | None = None
    ball: BallField | None = None  # whose centre and radius are among the runtime parameters

    def placed(self, first: int) -> RotorCurrents:
        return replace(self, first=first)

    def in_ball(self, ball: BallField, first: int) -> RotorCurrents:
        return replace(self, ball=ball, first=first)

    @property
    def count(self) -> int:
        return len(ENTRIES) if self.ball is None else COUNT[2] + len(ENTRIES) * COUNT[1]

    def added(self, motion: Motion) -> Added:
        """Force and torque are minus half the derivatives of the power by drift and turning."""
        length, moment, drift = hy.par[Parameter.LENGTH], motion.moment, motion.drift
        last = moment[2] * drift[2]
        pairs = [moment[0] * drift[0] - last, moment[1] * drift[1] - last]
        pairs += [moment[i] * drift[j] + moment[j] * drift[i] for i, j in UPPER[2:]]
        rates = [*(length * p for p in pairs), *cross(motion.lag, moment)]
        strength = hy.par[Parameter.PLATE_MOMENT] * hy.par[Parameter.PLATE_MOMENT] / hy.par[Parameter.TIME]
        xx, yy, xy, xz, yz, *field = (-strength * s for s in self._response(motion, rates))
        slopes = [[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]]
        force = [length * dotted(moment, row) for row in slopes]
        torque = [t / hy.par[Parameter.INERTIA] for t in cross(moment, field)]
        return dissipative(force, torque, motion)

    def _response(self, motion: Motion, rates: Vector) -> Vector:
        """S · rates."""
        metres = [hy.par[Parameter.LENGTH] * x for x in motion.position]
        if self.first is None:
            parts = self.table.multipoles.expressions(metres)
            rows = [[*(slope[i][j] for i, j in UPPER), *field] for field, slope in parts]
            signals, weights = [dotted(row, rates) for row in rows], self.table.weights
            induced = [weighted(w, signals) for w in weights]
            strengths = [weighted(w, induced) for w in weights.T]
            return [dotted(strengths, column) for column in zip(*rows, strict=True)]
        if self.ball is None:
            entries = [hy.par[self.first + k] for k in range(len(ENTRIES))]
        else:
            basis, start = monomials(2, self.ball.offset(metres), hy.expression(1.0)), self.first
            inverse = 1.0 / polynomial([hy.par[start + k] for k in range(COUNT[2])], basis)
            rates = [inverse * inverse * inverse * r for r in rates]
            start, size = start + COUNT[2], COUNT[1]
            entries = [
                polynomial([hy.par[start + n * size + k] for k in range(size)], basis) for n in range(len(ENTRIES))
            ]
        known = dict(zip(ENTRIES, entries, strict=True))
        return [dotted([known[min(a, b), max(a, b)] for b in range(NUMBERS)], rates) for a in range(NUMBERS)]

    def numbers(self, field: FieldTable, position: Array, moment: Array, values: Array) -> Array:
        return self._entries(position * values[:, Parameter.LENGTH, None]).T

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        parts = self._entries(ball.center + ball.radius * nodes())
        lengths = np.repeat([UNIT, 1.0], (5, 3))
        units = np.array([lengths[a] * lengths[b] for a, b in ENTRIES])
        solve, basis = fitting(1)
        quadratic, fall = falling(units[DIAGONAL] @ parts[DIAGONAL])
        weights = (parts / fall) @ solve.T
        missed = units * np.abs(fall * (weights @ basis.T) - parts).max(axis=1)
        error = float(missed.max() / (units * np.abs(parts).max(axis=1)).max())
        return np.concatenate([quadratic, weights.ravel()]), error / ALLOWED

    def _entries(self, places: Array) -> Array:
        """(36, n) of S at places (n, 3) m."""
        fields, slopes = self.table.fields(places)
        rows = np.concatenate([np.stack([slopes[..., i, j] for i, j in UPPER], axis=2), fields], axis=2)
        return np.array([np.einsum("nk,nk->n", rows[..., a], rows[..., b]) for a, b in ENTRIES])


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
