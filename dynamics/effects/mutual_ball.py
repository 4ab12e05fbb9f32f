"""Mutual magnetisation in a ball of a flight: its energy as polynomials whose weights are runtime parameters.

With M = m + α B0 the energy is u(x) + ½ MᵀH(x)M - ½ α B0²: u and the six entries of H are polynomials of the place in
the ball, and so are their derivatives, which have weights of their own: products of variables cost more than sums.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.harmonics import Ball, BallField
from ...fem.mutual import MutualTable
from ...geometry.basics import Array
from ..motion import Added, Motion, Parameter, cross, dot
from .ball_polynomials import count, fitting, nodes, polynomials, slopes

DEGREE = 3
PARTS = 7
"""u, and xx, xy, xz, yy, yz, zz of H."""
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
        basis = polynomials(DEGREE, self.ball.offset([length * x for x in motion.position]))
        lower = polynomials(DEGREE - 1, self.ball.offset([length * x for x in motion.position]))
        size, less = count(DEGREE), count(DEGREE - 1)
        value, *tensor = (self._sum(k * size, basis) for k in range(PARTS))
        start = PARTS * size
        flux = [share * b for b in motion.field]
        whole = [strength * m + alpha * b for m, b in zip(motion.moment, flux, strict=True)]
        pairs = [(0.5 if a == b else 1.0) * whole[a] * whole[b] for a, b in ENTRIES]
        answer = [-dot([tensor[ENTRIES.index((min(a, b), max(a, b)))] for b in range(3)], whole) for a in range(3)]
        energy = share * share * value + hy.sum([h * p for h, p in zip(tensor, pairs, strict=True)])
        carried = [(alpha * share) * (b + a) for a, b in zip(answer, flux, strict=True)]
        scale, force = length * hy.par[self.ball.first + 3], []
        for j in range(3):
            steep, *change = (self._sum(start + (3 * k + j) * less, lower) for k in range(PARTS))
            slope = share * share * steep + hy.sum([h * p for h, p in zip(change, pairs, strict=True)])
            force.append(length * dot(carried, [motion.gradient[i][j] for i in range(3)]) - scale * slope)
        turn = [strength / hy.par[Parameter.INERTIA] * t for t in cross(motion.moment, answer)]
        return Added(force, turn, energy - 0.5 * alpha * dot(flux, flux))

    def _sum(self, start: int, basis: Sequence[hy.expression]) -> hy.expression:
        first = self.first + start
        return hy.sum([hy.par[first], *(hy.par[first + k] * p for k, p in enumerate(basis) if k)])

    def fit(self, ball: Ball, gradient: Array) -> tuple[Array, float]:
        """The weights (count,) in a ball, and the error of the force by that of the rigid dipole in ∇B0 (3, 3) T/m."""
        places = ball.center + ball.radius * nodes()
        values, _, second = self.table.derivatives(places, np.zeros_like(places))
        parts = np.array([values, *(second[:, 3 + a, 3 + b] for a, b in ENTRIES)])
        solve, basis = fitting(DEGREE)
        weights = parts @ solve.T
        missed = np.abs(weights @ basis.T - parts).max(axis=1)
        energy = missed[0] + self.moment**2 / 2 * missed[1:].max()
        error = DEGREE * energy / (ball.radius * self.moment * float(np.linalg.norm(gradient)))
        steep = np.einsum("akp,cp->cak", slopes(DEGREE), weights)
        return np.concatenate([weights.ravel(), steep.ravel()]), float(error)
