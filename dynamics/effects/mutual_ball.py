"""Mutual magnetisation in a ball of a flight: its energy as polynomials whose weights are runtime parameters.

With M = m + α B0 the energy is q⁻³ (u(x) + M·V(x) + ½ MᵀH(x)M) - ½ α B0²: q, u, the three parts of V and the six
entries of H are polynomials of the place in the ball (`ball_polynomials`).  Its change with the place is that of one
polynomial, whose derivatives at the centre are sums of theirs: they have weights of their own.
"""

from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ...fem.harmonics import Ball, BallField
from ...fem.mutual import MutualTable
from ...geometry.basics import Array
from ..motion import Added, Motion, Parameter, dot
from .ball_polynomials import FALL, count, derivatives, fallen, falling, fitting, nodes, polynomials, weighted_sum

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
