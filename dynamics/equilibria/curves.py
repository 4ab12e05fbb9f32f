"""Where equilibria are looked for, from what starts, and Newton's method from all of these at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.common import Array, Watch, unwatched
from ...geometry.scene.contents import Scene
from .balance import AXIAL, CONVERGED_STEP, DUPLICATE_DISTANCE, EVERY, LATERAL, Balance, Indices, solve
from .path import AtRest, Steps, whole_curves

THINNED = 8
"""One of so many starts is tried in the whole balance too where there is a rough one."""
ITERATIONS = 30
"""Of Newton's method from the starts; none of those that have not met by then was seen to meet in twice as many."""
STEPS_TOGETHER, CELL, COARSER, AWAY = 3, 0.1, 1.3, 1.0
"""Steps after which the starts are thinned: within a cell of such an edge (radii, and of the moment), which grows by
that factor each time, one is kept, and those that are as far outside the range, in radii, are left out; a test compares
what is found with what all find."""


@dataclass(frozen=True, eq=False)
class SearchRange:
    """Positions below the rotor, from contact with it to `farthest`, in floater radii.

    Parameters
    ----------
    scene : its rotor and floater
    farthest : largest depth, and distance from the axis, m
    """

    scene: Scene
    farthest: float

    @property
    def bound(self) -> float:
        """Largest depth, and distance from the axis, in floater radii."""
        return self.farthest / self.scene.floater.radius

    def __contains__(self, position: Array) -> bool:
        """Whether a scaled position (3,) belongs to the range."""
        return bool(self.holds(position[None])[0])

    def holds(self, position: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Which of the scaled positions (n, 3) belong to the range, or lie at most a margin (radii) outside: (n,)."""
        radius, inner = self.scene.floater.radius, self.scene.floater.inner_radius
        bound, height = self.bound + margin, position[:, 2]
        inside = (-bound <= height) & (height <= margin) & (np.hypot(position[:, 0], position[:, 1]) <= bound)
        for magnet in self.scene.rotor:
            inside &= magnet.body.distance(position * radius) > inner - margin * radius
        return np.asarray(inside)

    def starts(self) -> tuple[Array, Array]:
        """Scaled positions and moments (n, 3) below the rotor and beside it, in fourteen directions each."""
        corners = [magnet.box.corners / self.scene.floater.radius for magnet in self.scene.rotor]
        nearest = 1.0 + max((-c[:, 2].min() for c in corners), default=0.0)
        beside = 1.0 + np.array([1.0, 1.1, 1.3, 2.0]) * max((np.abs(c[:, :2]).max() for c in corners), default=0.0)
        below = -np.geomspace(nearest, max(self.bound, nearest), 16)
        places = np.concatenate(
            [_rings(below, np.array([0.0, 0.15, 0.7]), 4), _rings(np.array([-0.01, -0.1, -0.4, -0.9]), beside, 12)]
        )
        moment = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, v)) in (1.0, 3.0)])
        moment /= np.linalg.norm(moment, axis=1, keepdims=True)
        return np.repeat(places, len(moment), axis=0), np.tile(moment, (len(places), 1))


def _rings(heights: Array, radii: Array, number: int) -> Array:
    """Points (n, 3) on rings about the axis, `number` on each."""
    angles = np.arange(number) * (2 * np.pi / number)
    z, r, a = (part.ravel() for part in np.meshgrid(heights, radii, angles, indexing="ij"))
    points = np.column_stack([r * np.cos(a), r * np.sin(a), z])
    return np.asarray(points[(r > 0) | (a == 0)])  # a ring of no radius is one point


@dataclass(frozen=True, eq=False)
class Search:
    """Newton's method from many starts, in one problem or in several side by side.

    Parameters
    ----------
    balance : of problems (n,), one for each point
    holds : which of the scaled positions (n, 3) lie in the ranges of problems (n,), or at most a margin (radii) outside
    free : which balances shall vanish and which unknowns move, see `steady.solve`
    margin : so far outside the range (radii) solutions are kept
    reach, far : longest steps, see `steady.solve`
    watch : is told the stage of the search and its share that is done
    """

    balance: Callable[[Indices], Balance]
    holds: Callable[[Indices, Array, float], NDArray[np.bool_]]
    free: Indices
    margin: float = 0.0
    reach: float = 0.3
    far: float = np.inf
    watch: Watch = unwatched

    def solutions(self, problem: Indices, position: Array, moment: Array) -> tuple[Indices, Array]:
        """What the starts (n, 3), (n, 3) of problems (n,) lead to, each solution once.

        Returns
        -------
        Problems (k,) in order, and positions with moments (k, 6), of each problem the lowest first.
        """
        points = np.concatenate([position, moment], axis=1)
        if self.balance(problem).rates.has_rough:
            near = self._newton(problem, points, rough=True)
            problem, points = _together(near, (problem[::THINNED], points[::THINNED]))
        return self._newton(problem, points)

    def _newton(self, problem: Indices, points: Array, rough: bool = False) -> tuple[Indices, Array]:
        """Every few steps those that ran away are given up, and of those that have come together one goes on."""
        found = [(problem[:0], points[:0])]
        for turn in range(ITERATIONS // STEPS_TOGETHER):
            self.watch("Newton's method from many starts", turn / (ITERATIONS // STEPS_TOGETHER))
            balance = self.balance(problem)
            if rough:
                balance = replace(balance, rates=balance.rates.rough)
            with np.errstate(all="ignore"):
                position, moment, step = solve(
                    balance, points[:, :3], points[:, 3:], self.free, STEPS_TOGETHER, self.reach, self.far
                )
            points, met = np.concatenate([position, moment], axis=1), step < CONVERGED_STEP
            kept = met & self.holds(problem, position, self.margin)
            found.append((problem[kept], points[kept]))
            going = ~met & np.isfinite(step) & self.holds(problem, position, AWAY)
            problem, points = problem[going], points[going]
            first = _first_in_cells(problem, points, CELL * COARSER**turn)
            problem, points = problem[first], points[first]
            if not len(points):
                break
        problem, points = _together(*found)
        first = _first_in_cells(problem, points, DUPLICATE_DISTANCE)
        problem, points = problem[first], points[first]
        order = np.lexsort([points[:, 2], problem])
        return problem[order], points[order]


def _together(*found: tuple[Indices, Array]) -> tuple[Indices, Array]:
    """Problems and points, (n,) and (n, 6), of several sets of them."""
    problem, points = (np.concatenate(part) for part in zip(*found, strict=True))
    return problem, points


def _first_in_cells(problem: Indices, points: Array, edge: float) -> Indices:
    """Numbers (k,) of the first of those points (n, 6) of a problem that round to the same multiples of an edge."""
    keys = np.column_stack([problem, np.round(points / edge)])
    order = np.lexsort(keys.T[::-1])
    new = np.ones(len(keys), bool)
    new[1:] = (np.diff(keys[order], axis=0) != 0).any(axis=1)
    return order[new]


def from_starts(balance: Balance, where: SearchRange, free: Indices, every: int = 1, watch: Watch = unwatched) -> Array:
    """Distinct points (n, 6) in the range, lowest first, at which the balances of `free` vanish, see `fixed_points`.

    One of so many starts is taken.
    """
    position, moment = (part[::every] for part in where.starts())
    search = Search(lambda _: balance, lambda _, position, margin: where.holds(position, margin), free, watch=watch)
    return search.solutions(np.zeros(len(position), int), position, moment)[1]


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
        if size < CONVERGED_STEP and not any(
            np.linalg.norm(r - q) + np.linalg.norm(m - n) < DUPLICATE_DISTANCE for q, n in points
        ):
            points.append((r, m))
    return points
