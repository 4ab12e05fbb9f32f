"""Where equilibria are looked for, from what starts, and Newton's method from all of these at once."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array, Watch, unwatched
from ...geometry.scenes import Scene
from ..steady import Balance, Indices, solve

THINNED = 8
"""One of so many starts is tried in the whole balance too where there is a rough one."""
ITERATIONS = 30
"""Of Newton's method from the starts; none of those that have not met by then was seen to meet in twice as many."""
STEPS_TOGETHER, CELL, COARSER, AWAY = 3, 0.1, 1.3, 1.0
"""Steps after which the starts are thinned: within a cell of such an edge (radii, and of the moment), which grows by
that factor each time, one is kept, and those that are as far outside the range, in radii, are left out; a test compares
what is found with what all find."""
MET, SAME = 1e-8, 1e-6
"""Newton's method has met a solution when its last step was shorter than the first (radii or rad), which leaves
round-off; solutions nearer to each other than the second, a hundred times that, are one."""


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
            points, met = np.concatenate([position, moment], axis=1), step < MET
            kept = met & self.holds(problem, position, self.margin)
            found.append((problem[kept], points[kept]))
            going = ~met & np.isfinite(step) & self.holds(problem, position, AWAY)
            problem, points = problem[going], points[going]
            first = _first_in_cells(problem, points, CELL * COARSER**turn)
            problem, points = problem[first], points[first]
            if not len(points):
                break
        problem, points = _together(*found)
        first = _first_in_cells(problem, points, SAME)
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
