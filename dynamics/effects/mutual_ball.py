"""Mutual magnetisation in a ball of a flight: its energy as polynomials whose weights are runtime parameters.

With M = m + α B0 the energy is q⁻³ (u(x) + ½ MᵀH(x)M) - ½ α B0²: q, u and the six entries of H are polynomials of the
place in the ball (`ball_polynomials`), and so are their derivatives, which have weights of their own: products of
variables cost more than sums.
"""

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.harmonics import Ball, BallField
from ...fem.mutual import MutualTable
from ...geometry.basics import Array
from ..motion import Added, Motion, Parameter, cross, dot
from .ball_polynomials import FALL, count, fallen, falling, fitting, nodes, polynomials, slopes, weighted_sum

DEGREE = 2
PARTS = 8
"""q, u, and xx, xy, xz, yy, yz, zz of H."""
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
        return PARTS * (count(DEGREE) + 3 * count(DEGREE - 1))

    def added(self, motion: Motion) -> Added:
        """Force and torque are the derivatives of one energy."""
        length, alpha = hy.par[Parameter.LENGTH], self.table.polarizability
        strength, share = hy.par[Parameter.PLATE_MOMENT], hy.par[Parameter.PLATE_SHARE]
        offset = self.ball.offset([length * x for x in motion.position])
        basis, lower = polynomials(DEGREE, offset), polynomials(DEGREE - 1, offset)
        size, less = count(DEGREE), count(DEGREE - 1)
        quadratic, value, *tensor = (weighted_sum(self.first + k * size, basis) for k in range(PARTS))
        start = self.first + PARTS * size
        inverse = 1.0 / quadratic
        fall = fallen(inverse)
        flux = [share * b for b in motion.field]
        whole = [strength * m + alpha * b for m, b in zip(motion.moment, flux, strict=True)]
        pairs = [(0.5 if a == b else 1.0) * whole[a] * whole[b] for a, b in ENTRIES]
        rows = [[tensor[ENTRIES.index((min(a, b), max(a, b)))] for b in range(3)] for a in range(3)]
        answer = [-fall * dot(row, whole) for row in rows]
        level = share * share * value + hy.sum([h * p for h, p in zip(tensor, pairs, strict=True)])
        carried = [(alpha * share) * (b + a) for a, b in zip(answer, flux, strict=True)]
        scale, steep, force = length * hy.par[self.ball.first + 3], FALL * (level * inverse), []
        for j in range(3):
            shrinks, *change = (weighted_sum(start + (3 * k + j) * less, lower) for k in range(PARTS))
            slope = share * share * change[0] + hy.sum([h * p for h, p in zip(change[1:], pairs, strict=True)])
            pulled = length * dot(carried, [motion.gradient[i][j] for i in range(3)])
            force.append(pulled + scale * fall * (steep * shrinks - slope))
        turn = [strength / hy.par[Parameter.INERTIA] * t for t in cross(motion.moment, answer)]
        return Added(force, turn, fall * level - 0.5 * alpha * dot(flux, flux))

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """See `InBall`; what is missed of the energy is taken to change as fast as a cubic."""
        places = ball.center + ball.radius * nodes()
        values, _, second = self.table.derivatives(places, np.zeros_like(places))
        parts = np.array([values, *(second[:, 3 + a, 3 + b] for a, b in ENTRIES)])
        solve, basis = fitting(DEGREE)
        units = np.array([1.0, *[self.moment**2 / 2] * len(ENTRIES)])
        quadratic, fall = falling(np.linalg.norm(units[:, None] * parts, axis=0))
        weights = (parts / fall) @ solve.T
        missed = units * np.abs(fall * (weights @ basis.T) - parts).max(axis=1)
        error = 3 * (missed[0] + missed[1:].max()) / (ball.radius * self.moment * float(np.linalg.norm(gradient)))
        weights = np.concatenate([quadratic[None], weights])
        steep = np.einsum("akp,cp->cak", slopes(DEGREE), weights)
        return np.concatenate([weights.ravel(), steep.ravel()]), float(error) / ALLOWED
