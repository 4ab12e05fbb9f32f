"""Folds and losses of stability as curves in the plane of two parameters of a scene.

Beside the five balances one more number shall vanish, the test of the boundary.  Seven unknowns (place, direction of
the moment, two parameters) leave a curve, which is followed by its arc length (W. J. F. Govaerts, Numerical Methods for
Bifurcations of Dynamical Equilibria, 2000, ch. 4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...geometry.basics import Array
from ..motion import Parameter
from ..steady import Balance, EquilibriumError, tangent_basis
from .boundary_equations import COLLISION, CROSSING, Boundary, BoundaryPoint, Plane
from .branch import FOLD, Point

DISSIPATIVE = [Parameter.LINEAR_DRAG, Parameter.TILT_DRAG, Parameter.TILT_EDDY]
LONGEST, SHORTEST, MOST, TURN = 0.1, 1e-6, 500, 0.2


def follow_boundary(plane: Plane, start: Point, place: Array, kind: str | None = None) -> list[BoundaryPoint]:
    """The boundary through a marked point of a branch, both ways, until it leaves the plane's part or closes.

    Parameters
    ----------
    start : a point of `arclength.follow_branch` with a kind, "fold" or "oscillatory"
    place : (2,) the two parameters there
    kind : "fold", "collision" or "crossing"; None: that of the start, a collision where nothing damps the motion.
        A drag so weak that it moves frequencies by less than 1e-4 of the rotor's counts as none here: take "collision"

    Returns
    -------
    Points in order along the curve, good to round-off.

    Raises
    ------
    EquilibriumError : there is no such boundary near the start
    """
    state = start.state
    values = plane.values(*np.asarray(place, float)[:, None])[0]
    kind = kind or (FOLD if start.kind == FOLD else CROSSING if values[DISSIPATIVE].any() else COLLISION)
    slope = Balance(plane.rates, values, plane.spin)(state[None, :3], state[None, 6:9])[1][0]
    boundary = Boundary(plane, kind, float(np.prod(np.linalg.svd(slope)[1][:4])))
    frequency = 0.0 if kind == FOLD else 2 * np.pi * start.leading_hz * start.time_unit
    guess = BoundaryPoint(np.asarray(place, float), state[:3], state[6:9], frequency)
    first = _corrected(boundary, guess, None)
    if first is None:
        raise EquilibriumError(f"Input start must lie on a {kind} of the plane; instead there was none near it.")
    ahead, closed = _half(boundary, first, 1.0)
    return [first, *ahead] if closed else [*_half(boundary, first, -1.0)[0][::-1], first, *ahead]


def _half(boundary: Boundary, start: BoundaryPoint, sense: float) -> tuple[list[BoundaryPoint], bool]:
    """Points after `start`, and whether they came back to it."""
    tangent = sense * _tangent(boundary, start, None)
    here, step, points = start, LONGEST / 10, list[BoundaryPoint]()
    while len(points) < MOST and step > SHORTEST:
        new = _corrected(boundary, boundary.stepped(here, step * _local(here, tangent)), tangent)
        turned = None if new is None else _tangent(boundary, new, tangent)
        if new is None or turned is None or turned @ tangent < np.cos(TURN) or _apart(boundary, new, here) > 2 * step:
            step /= 2
            continue
        if not boundary.plane.holds(new.place):
            break
        points.append(new)
        if len(points) > 3 and _apart(boundary, new, start) < step:
            return points, True
        here, tangent, step = new, turned, min(1.4 * step, LONGEST)
    return points, False


def _corrected(boundary: Boundary, guess: BoundaryPoint, tangent: Array | None) -> BoundaryPoint | None:
    """The nearest point of the boundary, across the tangent (8,) if there is one; None where Newton's method fails."""
    point = guess
    for _ in range(10):
        value, slope, frequency = boundary.linear(point)
        if not np.isfinite(slope).all():
            return None
        if tangent is None:
            change = -np.asarray(np.linalg.lstsq(slope, value, rcond=None)[0])
        else:
            matrix = np.vstack([slope, _local(point, tangent)])
            change = -np.asarray(np.linalg.lstsq(matrix, np.append(value, 0.0), rcond=None)[0])
        size = float(np.linalg.norm(change))
        if size > 1.0:
            return None
        point = boundary.stepped(replace(point, angular_frequency=frequency), change)
        if size < 1e-10:
            return point
    return None


def _tangent(boundary: Boundary, at: BoundaryPoint, before: Array | None) -> Array:
    """Unit direction (8,) of the boundary: place, direction of the moment, parameters by their units."""
    along = np.linalg.svd(boundary.linear(at)[1])[2][6]
    tangent = np.concatenate([along[:3], along[3:5] @ tangent_basis(at.moment[None])[0], along[5:]])
    return tangent if before is None or tangent @ before > 0 else -tangent


def _local(at: BoundaryPoint, tangent: Array) -> Array:
    """A direction (8,) in the seven unknowns of a point."""
    return np.concatenate([tangent[:3], tangent_basis(at.moment[None])[0] @ tangent[3:6], tangent[6:]])


def _apart(boundary: Boundary, a: BoundaryPoint, b: BoundaryPoint) -> float:
    places = (a.place - b.place) / boundary.plane.units
    return float(np.linalg.norm(np.concatenate([a.position - b.position, a.moment - b.moment, places])))
