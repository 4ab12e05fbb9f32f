"""Currents in the rotor in a ball of a flight: the matrix of their losses with runtime parameters as weights.

A rate u_k = d/dt m·c_k is linear in eight numbers, the five of the traceless symmetric part of m ⊗ (drift) and the
three of the rate of m, by the five of ∇c_k and the three of c_k.  So the power is quadratic in them, with a matrix S of
place alone, S_ab = Σ_k w_ka w_kb, whatever the moment is: q⁻³ times polynomials of degree 1 (`ball_polynomials`).
The work that force and torque do is that power exactly.
"""

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.harmonics import Ball, BallField
from ...fem.rotor_losses import RotorLosses
from ...geometry.basics import Array
from ..motion import Added, Motion, Parameter, Vector, cross, dissipative
from .ball_polynomials import count, fallen, falling, fitting, nodes, polynomials, weighted_sum

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
