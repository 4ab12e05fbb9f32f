"""The fixed points below a rotor: Newton's method from thousands of starts, and the curves of lateral balance.

Along a curve all but the axial force is balanced; equilibria are the zeros of that force.  What no curve of those that
were met passes through, Newton's method in all unknowns finds from some of the same starts.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ...geometry.common import Array, Watch, unwatched
from ...geometry.scene.contents import Scene
from ..motion.events import rotor_gap
from .balance import AXIAL, CONVERGED_STEP, DUPLICATE_DISTANCE, EVERY, LATERAL, Balance, Indices, solve
from .path import AtRest, Steps, whole_curves

# One of so many starts is tried in the whole balance too where there is a rough one; with 32, 20 scenes lost none.
THINNED = 16
# One of so many starts is tried for what lies on none of the curves: a test of 90 scenes finds no such equilibrium.
SPARE = 3
# Of Newton's method from the starts; none of those that have not met by then was seen to meet in twice as many.
ITERATIONS = 30
# Steps after which the starts are thinned: within a cell of such an edge (radii, and of the moment), which grows by
# that factor each time, one is kept, and those that are as far outside the range, in radii, are left out; a test
# compares what is found with what all find.
STEPS_TOGETHER, CELL, COARSER, AWAY = 3, 0.1, 1.3, 1.0
# Curves of 50 scenes took 176 steps at most. Where a body other than a sphere would be in the rotor they may run into a
# circle of others and never come back to their start.
STEPS = Steps(longest=0.1, shortest=1e-6, turn=0.15, most=1000, first=1 / 4, far=3.0)
DEEP = 0.1  # Radii of an overlap up to which a curve may come out of it
# Equilibria are looked for up to a depth, and distance from the axis, of the rotor's own reach and so many times the
# radii of floater and largest magnet, so that a scene ten times as large has the same; and at least to so many metres.
SIZES, LEAST = 4.0, 0.1
TOGETHER = 8  # Curves that are followed at once


@dataclass(frozen=True, eq=False)
class SearchRange:
    """Positions below the rotor, from contact with it to `bound`, in floater radii."""

    scene: Scene  # its rotor and floater
    ball: bool = False  # whether the whole ball about the floater has to be free, where its multipoles hold

    @cached_property
    def bound(self) -> float:
        """Largest depth, and distance from the axis."""
        bodies, radius = [magnet.body for magnet in self.scene.rotor], self.scene.floater.radius
        reach = max((body.farthest(np.zeros(3)) for body in bodies), default=0.0)
        size = radius + max((body.circumradius for body in bodies), default=0.0)
        return max(LEAST, reach + SIZES * size) / radius

    def holds(self, position: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Which of the scaled positions (n, 3) belong to the range, or lie at most a margin (radii) outside: (n,)."""
        radius = self.scene.floater.radius
        inner = radius if self.ball else self.scene.floater.inner_radius
        bound, height = self.bound + margin, position[:, 2]
        inside = (-bound <= height) & (height <= margin) & (np.hypot(position[:, 0], position[:, 1]) <= bound)
        for magnet in self.scene.rotor:
            inside &= magnet.body.distance(position * radius) > inner - margin * radius
        return np.asarray(inside)

    def free(self, points: Array) -> NDArray[np.bool_]:
        """Which of the scaled poses (n, 6) have a floater that overlaps the rotor by `DEEP` radii at most: (n,)."""
        floater = self.scene.floater
        if floater.is_sphere or floater.mean:  # `holds` knows
            return np.ones(len(points), bool)
        gaps = [rotor_gap(self.scene, point[:3] * floater.radius, point[3:]) for point in points]
        return np.array(gaps, float) > -DEEP * floater.radius

    def starts(self) -> Array:
        """Scaled positions and moments (n, 6) below the rotor and beside it, in fourteen directions each."""
        corners = [magnet.box.corners / self.scene.floater.radius for magnet in self.scene.rotor]
        nearest = 1.0 + max((-c[:, 2].min() for c in corners), default=0.0)
        beside = 1.0 + np.array([1.0, 1.1, 1.3, 2.0]) * max((np.abs(c[:, :2]).max() for c in corners), default=0.0)
        near = _rings(-np.geomspace(nearest, max(self.bound, nearest), 16), np.array([0.0, 0.15, 0.7]), 4)
        places = np.concatenate([near, _rings(np.array([-0.01, -0.1, -0.4, -0.9]), beside, 12)])
        moment = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, v)) in (1.0, 3.0)])
        moment /= np.linalg.norm(moment, axis=1, keepdims=True)
        return np.column_stack([np.repeat(places, len(moment), axis=0), np.tile(moment, (len(places), 1))])


def _rings(heights: Array, radii: Array, number: int) -> Array:
    angles = np.arange(number) * (2 * np.pi / number)
    z, r, a = (part.ravel() for part in np.meshgrid(heights, radii, angles, indexing="ij"))
    points = np.column_stack([r * np.cos(a), r * np.sin(a), z])
    return np.asarray(points[(r > 0) | (a == 0)])  # a ring of no radius is one point


def newton_search(
    balance: Callable[[Indices], Balance],
    holds: Callable[[Indices, Array, float], NDArray[np.bool_]],
    problem: Indices,
    points: Array,
    free: Indices = EVERY,
    margin: float = 0.0,
    reach: float = 0.3,
    far: float = np.inf,
    watch: Watch = unwatched,
) -> tuple[Indices, Array]:
    """Solutions that Newton's method finds from starts, in one problem or in several as a batch, each once.

    Returns problems (k,) in order, and positions with moments (k, 6), of each problem the lowest first. `balance` is
    of problems (n,), one for each point; `holds` says which of the scaled positions (n, 3) lie in the ranges of
    problems (n,), or at most a margin (radii) outside: solutions are kept up to `margin`. Starts are `points` (n, 6),
    scaled positions and moments, each of a `problem` (n,); `free`, `reach`, `far` are as of `balance.solve`, and
    `watch` gets progress.
    """

    def solved(problem: Indices, points: Array, rough: bool) -> tuple[Indices, Array]:
        found = [(problem[:0], points[:0])]
        for turn in range(ITERATIONS // STEPS_TOGETHER):
            watch("Newton's method from many starts", turn / (ITERATIONS // STEPS_TOGETHER))
            here = balance(problem)
            here = replace(here, rates=here.rates.rough) if rough else here
            with np.errstate(all="ignore"):
                position, moment, step = solve(here, points[:, :3], points[:, 3:], free, STEPS_TOGETHER, reach, far)
            points, met = np.concatenate([position, moment], axis=1), step < CONVERGED_STEP
            kept = met & holds(problem, position, margin)
            found.append((problem[kept], points[kept]))
            # Those that ran away are given up, and of those that have come together one goes on.
            going = ~met & np.isfinite(step) & holds(problem, position, AWAY)
            problem, points = _thinned(problem[going], points[going], CELL * COARSER**turn)
            if not len(points):
                break
        problem, points = (np.concatenate(part) for part in zip(*found, strict=True))
        return _thinned(problem, points, DUPLICATE_DISTANCE)

    if balance(problem).rates.has_rough:
        near = solved(problem, points, True)
        problem, points = np.append(near[0], problem[::THINNED]), np.append(near[1], points[::THINNED], axis=0)
    problem, points = solved(problem, points, False)
    order = np.lexsort([points[:, 2], problem])
    return problem[order], points[order]


def _thinned(problem: Indices, points: Array, edge: float) -> tuple[Indices, Array]:
    """The first of those points (n, 6) of a problem that round to the same multiples of an edge."""
    keys = np.column_stack([problem, np.round(points / edge)])
    order = np.lexsort(keys.T[::-1])
    new = np.ones(len(keys), bool)
    new[1:] = (np.diff(keys[order], axis=0) != 0).any(axis=1)
    return problem[order[new]], points[order[new]]


def from_starts(
    balance: Balance, where: SearchRange, free: Indices = EVERY, every: int = 1, watch: Watch = unwatched
) -> Array:
    """Distinct points (n, 6) `where` the `free` of a `balance` vanish, lowest first, from one of `every` starts."""
    points = where.starts()[::every]
    one = np.zeros(len(points), int)
    return newton_search(lambda _: balance, lambda _, *places: where.holds(*places), one, points, free, watch=watch)[1]


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of one curve of lateral balance, in scaled units."""

    arc: Array  # (n,) length along the curve
    points: Array  # (n, 6) positions and moments
    tangents: Array  # (n, 6) unit directions of the curve
    force: Array  # (n,) axial force that is left over, gravity included
    slope: Array  # (n,) its derivative along the curve

    def passes(self, point: Array) -> bool:
        """Whether the curve goes through a point (6,), judged by cubic interpolation at the point's own height."""
        crossings = self._height.solve(point[2], extrapolate=False)
        apart = self._spline(crossings[np.isfinite(crossings)]) - point
        return bool(np.min(np.linalg.norm(apart, axis=1), initial=np.inf) < 1e-3)

    def balanced(self) -> Array:
        """Estimates (k, 6) of positions and moments where the axial force vanishes as well."""
        crossings = CubicHermiteSpline(self.arc, self.force, self.slope).roots(extrapolate=False)
        return AtRest().onto(self._spline(crossings[np.isfinite(crossings)]))

    @cached_property
    def _spline(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.arc, self.points, self.tangents)

    @cached_property
    def _height(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.arc, self.points[:, 2], self.tangents[:, 2])


@dataclass(frozen=True, eq=False)
class _Lateral(AtRest):
    balance: Balance  # but for the axial force; unknown are position and moment

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        value, slope = self.balance(points[:, :3], points[:, 3:])
        return self.extended(value[:, LATERAL], slope[:, LATERAL], points[:, 3:])


def fixed_points(balance: Balance, where: SearchRange, watch: Watch = unwatched) -> tuple[list[Curve], Array]:
    """Curves of lateral balance in a range `where`, and scaled poses (k, 6) of equilibria; `watch` gets progress."""
    seeds = from_starts(balance, where, LATERAL, watch=watch)
    seeds = seeds[where.free(seeds)]  # about the edges of a rotor in it a body is balanced on dozens of curves
    curves, count = list[Curve](), len(seeds)
    while len(seeds):
        watch("curves of balance", 1 - len(seeds) / count)
        # What is at one height lies on different curves, or on both sides of a fold.
        heights, number = np.unique(np.round(seeds[:, 2], 6), return_counts=True)
        chosen = np.abs(seeds[:, 2] - heights[np.argmax(number)]) < 1e-5
        chosen &= np.cumsum(chosen) <= TOGETHER
        # Four balances do not fix a curve in a field of revolution about the axis.
        traced = whole_curves(_Lateral(balance), seeds[chosen], STEPS, lambda points: where.holds(points[:, :3]))
        for seed, one in zip(seeds[chosen], traced, strict=True):
            if one is None or len(one[0]) < 2 or any(curve.passes(seed) for curve in curves):
                continue
            points, tangents = one
            value, slope = balance(points[:, :3], points[:, 3:])
            slope = AtRest.extended(value, slope, points[:, 3:])[1][:, AXIAL]
            # dipoles of a flat floater may meet an edge of a magnet
            known = np.isfinite(value).all(axis=1) & np.isfinite(slope).all(axis=1)
            points, tangents, value, slope = (part[known] for part in (points, tangents, value, slope))
            arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
            curves.append(Curve(arc, points, tangents, value[:, AXIAL], np.sum(slope * tangents, axis=1)))
        seeds = np.array([seed for seed in seeds[~chosen] if not any(curve.passes(seed) for curve in curves)])
    guesses = [*(curve.balanced() for curve in curves), from_starts(balance, where, EVERY, SPARE, watch)]
    points = np.concatenate(guesses)
    if not len(points):
        return curves, points
    position, moment, step = solve(balance, points[:, :3], points[:, 3:], EVERY)
    found: list[Array] = []
    for point in np.concatenate([position, moment], axis=1)[(step < CONVERGED_STEP) & where.holds(position)]:
        if all(np.linalg.norm(point - known) > DUPLICATE_DISTANCE for known in found):
            found.append(point)
    return curves, np.reshape(found, (-1, 6))
