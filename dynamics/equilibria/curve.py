"""Curves along which everything but the axial force is balanced.

Four balances in five unknowns leave curves in the space of positions and moment directions.  Equilibria are the points
of these curves at which the axial force vanishes too, so that following each curve once finds all of its equilibria,
folds included.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from ...geometry.basics import Array, Watch, unwatched
from ..steady import AXIAL, LATERAL, Balance, Indices
from .continuation import AtRest, Steps
from .search import SearchRange, from_starts
from .tracing import whole_curves

STEPS = Steps(longest=0.1, shortest=1e-6, turn=0.15, most=5000, first=1 / 4, far=3.0)
TOGETHER = 8
"""Curves that are followed at once."""


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

    def passes(self, point: Array) -> bool:
        """Whether the curve goes through a point (6,), judged by cubic interpolation at the point's own height."""
        crossings = self._height.solve(point[2], extrapolate=False)
        apart = self._spline(crossings[np.isfinite(crossings)]) - point
        return bool(np.min(np.linalg.norm(apart, axis=1), initial=np.inf) < 1e-3)

    def balanced(self) -> tuple[Array, Array]:
        """Estimates (k, 3) of positions and moments where the axial force vanishes as well."""
        crossings = scipy.interpolate.CubicHermiteSpline(self.arc, self.force, self.slope).roots(extrapolate=False)
        points = self._spline(crossings[np.isfinite(crossings)])
        moment = points[:, 3:]
        return points[:, :3], moment / np.linalg.norm(moment, axis=1, keepdims=True)

    @cached_property
    def _spline(self) -> scipy.interpolate.CubicHermiteSpline:
        return scipy.interpolate.CubicHermiteSpline(
            self.arc, np.concatenate([self.position, self.moment], axis=1), self.tangent
        )

    @cached_property
    def _height(self) -> scipy.interpolate.CubicHermiteSpline:
        return scipy.interpolate.CubicHermiteSpline(self.arc, self.position[:, 2], self.tangent[:, 2])


@dataclass(frozen=True, eq=False)
class Lateral(AtRest):
    """Everything but the axial force, as equations of a curve."""

    balance: Balance

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Four balances and |m̂| = 1 (n, 5) at positions and moments (n, 6), and their derivatives (n, 5, 6)."""
        value, slope = self.balance(points[:, :3], points[:, 3:])
        return self.extended(value[:, LATERAL], slope[:, LATERAL], points[:, 3:])


def curves_through(balance: Balance, points: Array, where: SearchRange) -> list[Curve | None]:
    """The curves through points (n, 6), both ways, until they leave the range or close.

    None where four balances do not fix a curve (a field of revolution about the axis).
    """
    found = whole_curves(Lateral(balance), points, STEPS, lambda points: where.holds(points[:, :3]))
    return [None if one is None or len(one[0]) < 2 else _curve(balance, *one) for one in found]


def _curve(balance: Balance, points: Array, tangents: Array) -> Curve:
    value, slope = balance(points[:, :3], points[:, 3:])
    slope = AtRest.extended(value, slope, points[:, 3:])[1][:, AXIAL]
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    arc, along = np.append(0.0, np.cumsum(chords)), np.sum(slope * tangents, axis=1)
    return Curve(arc, points[:, :3], points[:, 3:], tangents, value[:, AXIAL], along)


def all_curves(balance: Balance, where: SearchRange, watch: Watch = unwatched) -> list[Curve]:
    """Every curve that is met in the range, from its starts at their own heights."""
    seeds = from_starts(balance, where, LATERAL, watch=watch)
    curves: list[Curve] = []
    count = len(seeds)
    while len(seeds):
        watch("curves of balance", 1 - len(seeds) / count)
        # What is at one height lies on different curves, or on both sides of a fold.
        heights, number = np.unique(np.round(seeds[:, 2], 6), return_counts=True)
        chosen = np.abs(seeds[:, 2] - heights[np.argmax(number)]) < 1e-5
        chosen &= np.cumsum(chosen) <= TOGETHER
        for seed, curve in zip(seeds[chosen], curves_through(balance, seeds[chosen], where), strict=True):
            if curve is not None and not any(known.passes(seed) for known in curves):
                curves.append(curve)
        seeds = np.array([seed for seed in seeds[~chosen] if not any(curve.passes(seed) for curve in curves)])
    return curves
