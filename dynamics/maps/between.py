"""Branches followed from points of a map towards their neighbours, many at once, through folds.

The parameter is the way λ from one point to the next: a branch ends where it comes to the neighbour (λ = 1) or, after
a fold, back to its own point (λ = 0), or leaves the range.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..equilibria import END, ON, AtRest, Steps, directions, follow
from ..steady import EVERY, Indices, solve
from .grid import Grid

UNIT = 0.1
"""Length of the way between two points, in radii and rad."""
STEPS = Steps(longest=0.1, shortest=1e-5, turn=0.2, most=300)
FAR = 1.5
"""The range is left where the floater is this much farther than its farthest."""


@dataclass(frozen=True, eq=False)
class _Ways(AtRest):
    """Balances on the ways from points `start` (n,) to points `end` (n,); unknown are position, moment and λ UNIT."""

    grid: Grid
    start: Indices
    end: Indices

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Balances and |m̂| = 1 (n, 6), and their derivatives (n, 6, 7); that along the way by a difference: 1e-6."""
        position, moment, way = points[:, :3], points[:, 3:6], points[:, 6] / UNIT
        start, end = self.start[which], self.end[which]
        value, slope = self.grid.balance(start, end, way)(position, moment)
        ahead = self.grid.balance(start, end, way + 1e-6)(position, moment)[0]
        along = (ahead - value) / (1e-6 * UNIT)
        return self.extended(value, np.concatenate([slope, along[:, :, None]], axis=2), moment)


def between(grid: Grid, start: Indices, end: Indices, position: Array, moment: Array) -> tuple[Indices, Array, Array]:
    """Follow branches from equilibria (n, 3), (n, 3) of points `start` (n,) towards those of points `end` (n,).

    Returns
    -------
    Points (k,), positions and moments (k, 3) of the equilibria in which they ended.
    """
    ways, bound = _Ways(grid, start, end), FAR * max(where.bound for where in grid.ranges)
    points = np.column_stack([position, moment, np.zeros(len(start))])
    tangents = directions(ways, points, np.eye(7)[6] + np.zeros((len(start), 1)), np.arange(len(start)))
    ended: list[tuple[Indices, Array]] = [(start[:0], points[:0])]

    def watch(which: Indices, points: Array, tangents: Array, lengths: Array) -> NDArray[np.int_]:
        way = points[:, 6]
        there, back = way >= UNIT, way <= 0.0
        ended.extend(((end[which[there]], points[there]), (start[which[back]], points[back])))
        return np.where(there | back | (np.linalg.norm(points[:, :3], axis=1) > bound), END, ON)

    follow(ways, points, tangents, STEPS, watch)
    point, places = (np.concatenate(part) for part in zip(*ended, strict=True))
    position, moment, size = solve(grid.balance(point), places[:, :3], places[:, 3:6], EVERY, 12)
    good = size < 1e-8
    return point[good], position[good], moment[good]
