"""Curves along which everything but the axial force is balanced, followed by their arc length.

Four balances in five unknowns leave curves in the space of positions and moment directions.  Equilibria are the points
of these curves at which the axial force vanishes too, so that following each curve once finds all of its equilibria,
folds included.  Predictor along the tangent, corrector by Newton's method across it (H. B. Keller, 1977; E. L. Allgower
and K. Georg, Numerical Continuation Methods, 1990, ch. 2 and 6).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ..steady import AXIAL, LATERAL, Balance, moved, solve, tangent_basis
from .curve import Curve
from .search import SearchRange

LONGEST_STEP, SHORTEST_STEP = 0.1, 1e-6
SHARPEST_TURN = 0.15
"""Steps along a curve (floater radii and rad) and the largest angle between its tangents at their ends (rad)."""
MOST_STEPS = 5000


@dataclass(frozen=True, eq=False)
class _Point:
    position: Array
    moment: Array
    tangent: Array
    force: float
    slope: float


def follow(balance: Balance, position: Array, moment: Array, where: SearchRange) -> Curve | None:
    """The curve through a point (3,), (3,) both ways, until it leaves the range or closes.

    None where four balances do not fix a curve (a field of revolution about the axis).
    """
    start = _point(balance, position, moment, None)
    if start is None:
        return None
    ahead, closed = _half(balance, start, where)
    if closed:
        return _curve([start, *ahead])
    back = _Point(start.position, start.moment, -start.tangent, start.force, -start.slope)
    behind, _ = _half(balance, back, where)
    reverse = [_Point(p.position, p.moment, -p.tangent, p.force, -p.slope) for p in behind[::-1]]
    points = [*reverse, start, *ahead]
    return _curve(points) if len(points) > 1 else None


def _half(balance: Balance, start: _Point, where: SearchRange) -> tuple[list[_Point], bool]:
    """Points after `start` along its tangent, the first one outside included, and whether they came back to it."""
    points, step, here = [start], LONGEST_STEP / 4, start
    while len(points) < MOST_STEPS and step > SHORTEST_STEP:
        new = _stepped(balance, here, step)
        if new is None:
            step /= 2
            continue
        points.append(new)
        if new.position not in where:
            break
        travelled, gap = _apart(new, here), _apart(new, start)
        if len(points) > 3 and gap < travelled and new.tangent @ start.tangent > 0.9:
            return [*points[1:-1], start], True
        here, step = new, min(1.4 * step, LONGEST_STEP)
    return points[1:], False


def _apart(a: _Point, b: _Point) -> float:
    return float(np.linalg.norm(np.concatenate([a.position - b.position, a.moment - b.moment])))


def _stepped(balance: Balance, here: _Point, step: float) -> _Point | None:
    """The next point of the curve, or None where the step is too long."""
    position = here.position[None] + step * here.tangent[:3]
    moment = here.moment[None] + step * here.tangent[3:]
    moment = moment / np.linalg.norm(moment)
    for _ in range(5):
        value, slope = balance(position, moment)
        if not np.isfinite(slope).all():
            return None
        along = np.concatenate([here.tangent[:3], tangent_basis(moment)[0] @ here.tangent[3:]])
        try:
            change = np.linalg.solve(np.vstack([slope[0, LATERAL], along]), -np.append(value[0, LATERAL], 0.0))
        except np.linalg.LinAlgError:
            return None
        if np.linalg.norm(change) > step / 2:
            return None
        position, moment = moved(position, moment, change[None])
        if np.linalg.norm(change) < 1e-9:
            new = _point(balance, position[0], moment[0], here.tangent)
            turn = 0.0 if new is None else float(new.tangent @ here.tangent)
            return new if turn > np.cos(SHARPEST_TURN) else None
    return None


def _point(balance: Balance, position: Array, moment: Array, before: Array | None) -> _Point | None:
    """Tangent and axial force at a point of the curve; the tangent goes on in the direction of `before`."""
    value, slope = balance(position[None], moment[None])
    _, sizes, rows = np.linalg.svd(slope[0, LATERAL])
    if sizes[3] < 1e-12 * sizes[0]:
        return None
    along = rows[4]
    tangent = np.concatenate([along[:3], along[3:] @ tangent_basis(moment[None])[0]])
    sign = 1.0 if before is None or tangent @ before > 0 else -1.0
    return _Point(position, moment, sign * tangent, float(value[0, AXIAL]), sign * float(slope[0, AXIAL] @ along))


def _curve(points: list[_Point]) -> Curve:
    position, moment, tangent = (np.array([getattr(p, k) for p in points]) for k in ("position", "moment", "tangent"))
    chords = np.linalg.norm(np.diff(np.concatenate([position, moment], axis=1), axis=0), axis=1)
    force, slope = np.array([p.force for p in points]), np.array([p.slope for p in points])
    return Curve(np.append(0.0, np.cumsum(chords)), position, moment, tangent, force, slope)


def all_curves(balance: Balance, where: SearchRange) -> list[Curve]:
    """Every curve that is met in the range, from its starts at their own heights."""
    position, moment, step = solve(balance, *where.starts(), LATERAL)
    curves: list[Curve] = []
    for r, m in _distinct(position[step < 1e-8], moment[step < 1e-8]):
        if r not in where or any(curve.passes(r, m) for curve in curves):
            continue
        curve = follow(balance, r, m, where)
        if curve is not None:
            curves.append(curve)
    return curves


def _distinct(position: Array, moment: Array) -> list[tuple[Array, Array]]:
    """Points that differ by more than 1e-6, lowest first."""
    _, first = np.unique(np.round(np.concatenate([position, moment], axis=1), 6), axis=0, return_index=True)
    order = first[np.argsort(position[first, 2])]
    return [(position[i], moment[i]) for i in order]
