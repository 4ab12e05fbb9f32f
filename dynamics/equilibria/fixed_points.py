"""Where all five balances vanish: along the curves of lateral balance, and directly from many starts."""

import numpy as np

from ...geometry.basics import Array
from ..steady import EVERY, Balance, solve
from .curve import Curve, all_curves
from .search import SearchRange


def fixed_points(balance: Balance, where: SearchRange) -> tuple[list[Curve], list[tuple[Array, Array]]]:
    """Curves of lateral balance in the range, and the scaled positions and moments of the equilibria on them."""
    curves = all_curves(balance, where)
    guesses = [*(curve.balanced() for curve in curves), scattered(balance, where)]
    position, moment = (np.concatenate(part) for part in zip(*guesses, strict=True))
    return curves, [(r, m) for r, m in _polished(balance, position, moment) if r in where]


def scattered(balance: Balance, where: SearchRange) -> tuple[Array, Array]:
    """What Newton's method in all five unknowns finds from the starts: short curves may pass between them."""
    with np.errstate(all="ignore"):  # many of these starts run away
        position, moment, step = solve(balance, *where.starts(), EVERY, 25)
    points = np.concatenate([position, moment], axis=1)[(step < 1e-8) & where.holds(position)]
    _, first = np.unique(points.round(6), axis=0, return_index=True)
    return points[first, :3], points[first, 3:]


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
