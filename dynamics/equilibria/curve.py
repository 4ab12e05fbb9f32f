"""Curves along which everything but the axial force is balanced.

Four balances in five unknowns leave curves in the space of positions and moment directions.  Equilibria are the points
of these curves at which the axial force vanishes too, so that following each curve once finds all of its equilibria,
folds included.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ...geometry.basics import Array
from ..steady import AXIAL, LATERAL, Balance, Indices, solve
from .continuation import AtRest, Steps
from .search import SearchRange
from .tracing import whole_curve

STEPS = Steps(longest=0.1, shortest=1e-6, turn=0.15, most=5000, first=1 / 4)


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of one curve, in scaled units.

    Parameters
    ----------
    arc : (n,) length along the curve
    position, moment : (n, 3)
    tangent : (n, 6) unit direction of the curve: position and moment
    force : (n,) axial force that is left over, gravity included
    slope : (n,) its derivative along the curve
    """

    arc: Array
    position: Array
    moment: Array
    tangent: Array
    force: Array
    slope: Array

    def passes(self, position: Array, moment: Array) -> bool:
        """Whether the curve goes through a point, judged by cubic interpolation at the point's own height."""
        spline = CubicHermiteSpline(self.arc, self._points, self.tangent)
        height = CubicHermiteSpline(self.arc, self._points[:, 2] - position[2], self.tangent[:, 2])
        crossings = height.roots(extrapolate=False)
        crossings = crossings[np.isfinite(crossings)]
        if not len(crossings):
            return False
        apart = spline(crossings) - np.concatenate([position, moment])
        return bool(np.min(np.linalg.norm(apart, axis=1)) < 1e-3)

    def balanced(self) -> tuple[Array, Array]:
        """Estimates (k, 3) of positions and moments where the axial force vanishes as well."""
        crossings = CubicHermiteSpline(self.arc, self.force, self.slope).roots(extrapolate=False)
        points = CubicHermiteSpline(self.arc, self._points, self.tangent)(crossings[np.isfinite(crossings)])
        moment = points[:, 3:]
        return points[:, :3], moment / np.linalg.norm(moment, axis=1, keepdims=True)

    @property
    def _points(self) -> Array:
        return np.concatenate([self.position, self.moment], axis=1)


@dataclass(frozen=True, eq=False)
class Lateral(AtRest):
    """Everything but the axial force, as equations of a curve."""

    balance: Balance

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Four balances and |m̂| = 1 (n, 5) at positions and moments (n, 6), and their derivatives (n, 5, 6)."""
        value, slope = self.balance(points[:, :3], points[:, 3:])
        return self.extended(value[:, LATERAL], slope[:, LATERAL], points[:, 3:])


def curve_through(balance: Balance, position: Array, moment: Array, where: SearchRange) -> Curve | None:
    """The curve through a point (3,), (3,) both ways, until it leaves the range or closes.

    None where four balances do not fix a curve (a field of revolution about the axis).
    """
    start = np.concatenate([position, moment])
    found = whole_curve(Lateral(balance), start, STEPS, lambda point: point[:3] in where)
    if found is None or len(found[0]) < 2:
        return None
    points, tangents = found
    value, slope = balance(points[:, :3], points[:, 3:])
    slope = AtRest.extended(value, slope, points[:, 3:])[1][:, AXIAL]
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    arc, along = np.append(0.0, np.cumsum(chords)), np.sum(slope * tangents, axis=1)
    return Curve(arc, points[:, :3], points[:, 3:], tangents, value[:, AXIAL], along)


def all_curves(balance: Balance, where: SearchRange) -> list[Curve]:
    """Every curve that is met in the range, from its starts at their own heights."""
    position, moment, step = solve(balance, *where.starts(), LATERAL)
    curves: list[Curve] = []
    for r, m in _distinct(position[step < 1e-8], moment[step < 1e-8]):
        if r not in where or any(curve.passes(r, m) for curve in curves):
            continue
        curve = curve_through(balance, r, m, where)
        if curve is not None:
            curves.append(curve)
    return curves


def _distinct(position: Array, moment: Array) -> list[tuple[Array, Array]]:
    """Points that differ by more than 1e-6, lowest first."""
    _, first = np.unique(np.round(np.concatenate([position, moment], axis=1), 6), axis=0, return_index=True)
    order = first[np.argsort(position[first, 2])]
    return [(position[i], moment[i]) for i in order]
