"""Eddy currents in the rotor's own metal (`fem.rotor_losses`): a brake that turns with the rotor.

The floater's dipole m drives current pattern k by u_k = d/dt m·c_k(x), as seen from the rotor.  The currents make the
field B = -Σ u_k c_k there, which acts on the floater by (m·∇)B and m × B and takes the power Σ u_k².
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.harmonics import BallField
from ...fem.rotor_losses import RotorLosses
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import Added, Motion, Parameter, Scales, State, cross, dot
from .rotor_losses_ball import RotorCurrentsInBall, braked

ROTOR_CURRENTS = "currents in the rotor"
UPPER = [(a, b) for a in range(6) for b in range(a, 6)]


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
        return len(UPPER)

    def added(self, motion: Motion) -> Added:
        """Force and torque are -D of drift and turning."""
        known = {pair: hy.par[self.first + k] for k, pair in enumerate(UPPER)}
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
        return np.array([matrix[:, a, b] for a, b in UPPER]).T


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
