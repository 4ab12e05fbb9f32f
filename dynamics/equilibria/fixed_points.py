"""Where all five balances vanish: along the curves of lateral balance, and directly from many starts.

Newton's method runs from all starts in the `rough` balance, where effects with numbers of their own cost nothing, and
goes on in the whole one from what it found and from every eighth of the starts.
"""

import numpy as np

from ...geometry.basics import Array, Watch, unwatched
from ..steady import EVERY, Balance, solve
from .curve import Curve, all_curves
from .search import SearchRange, from_starts

SPARE = 3
"""One of so many starts is tried for what lies on none of the curves: a test of 90 scenes finds no such equilibrium."""


def fixed_points(
    balance: Balance, where: SearchRange, watch: Watch = unwatched
) -> tuple[list[Curve], list[tuple[Array, Array]]]:
    """Curves of lateral balance in the range, and the scaled positions and moments of the equilibria on them."""
    curves = all_curves(balance, where, watch)
    guesses = [*(curve.balanced() for curve in curves), scattered(balance, where, SPARE, watch)]
    position, moment = (np.concatenate(part) for part in zip(*guesses, strict=True))
    return curves, [(r, m) for r, m in _polished(balance, position, moment) if r in where]


def scattered(balance: Balance, where: SearchRange, every: int = 1, watch: Watch = unwatched) -> tuple[Array, Array]:
    """What Newton's method in all unknowns finds from one of so many starts: short curves may pass between them."""
    points = from_starts(balance, where, EVERY, every, watch)
    return points[:, :3], points[:, 3:]


def _polished(balance: Balance, position: Array, moment: Array) -> list[tuple[Array, Array]]:
    """Distinct zeros of all five balances near the guesses (n, 3), to round-off."""
    if not len(position):
        return []
    position, moment, step = solve(balance, position, moment, EVERY)
    points: list[tuple[Array, Array]] = []
    for r, m, size in zip(position, moment, step, strict=True):
        if size < 1e-8 and not any(np.linalg.norm(r - q) + np.linalg.norm(m - n) < 1e-6 for q, n in points):
            points.append((r, m))
    return points
