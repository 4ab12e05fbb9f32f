"""The points of a map or a sweep, the balances there, and the equilibria that are known."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from ..equilibria.balance import DUPLICATE_DISTANCE, EVERY, Balance, Indices
from ..equilibria.curves import SearchRange, newton_search
from ..equilibria.path import carried
from ..motion.rates import Rates

FAR_APART = 1.5  # Equilibria are followed up to so many times the farthest distance of the ranges
SPACING = 5  # Points of the map between two searches
# One of so many searches has all starts, the others an eighth of them, which misses less than one in a hundred of a
# point's equilibria: a sheet is lost only if every search that meets it does.
WHOLE, PART = 64, 8
# Longest steps of the searches, rad of the moment and radii of the position, and beyond that distance (radii) as a part
# of it, as the field changes: with 0.3 rad and radii they are more than twice as many, and an eighth of the starts
# misses several times as much.
REACH, FAR = 0.8, 1.0
TOGETHER = 8  # Searches that are made side by side: enough that NumPy's calls cost less than what they compute
MARGIN = 0.3  # Sheets are followed so far beyond the range (radii): what its border cuts into pieces is whole there


@dataclass(frozen=True, eq=False)
class Grid:
    """Problems at points with whole-numbered coordinates, all in one rotor's field."""

    rates: Rates  # compiled for that field
    values: Array  # (n, p) runtime parameters of the points
    spin: Array  # (n,) body spin s
    ranges: Sequence[SearchRange]  # in which equilibria are looked for
    region: Indices  # (n,) which of them is the point's
    places: Indices  # (n, axes) coordinates; not every place of the grid need have a point

    def __len__(self) -> int:
        return len(self.values)

    def balance(self, point: Indices) -> Balance:
        """The balance in which every point has its own problem."""
        return Balance(self.rates, self.values[point], self.spin[point])

    def alone(self, point: int) -> Balance:
        """The balance of one point, for any number of positions."""
        return Balance(self.rates, self.values[point], float(self.spin[point]))

    def range(self, point: int) -> SearchRange:
        return self.ranges[int(self.region[point])]

    def holds(self, point: Indices, position: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Which of the scaled positions (n, 3) lie in the range of their points (n,), or at most a margin outside."""
        inside = np.zeros(len(point), bool)
        for k in np.unique(self.region[point]):
            chosen = self.region[point] == k
            inside[chosen] = self.ranges[k].holds(position[chosen], margin)
        return inside

    def neighbours(self, point: Indices) -> tuple[Indices, Indices]:
        """Pairs of a place in `point` and one of the points beside it, up to two along each axis."""
        which, beside = [np.zeros(0, int)], [np.zeros(0, int)]
        for axis in range(self.places.shape[1]):
            for step in (1, -1):
                found = self._at(self.places[point] + step * np.eye(self.places.shape[1], dtype=int)[axis])
                which.append(np.flatnonzero(found >= 0))
                beside.append(found[found >= 0])
        return np.concatenate(which), np.concatenate(beside)

    def coarse(self, spacing: int) -> Indices:
        """Points of a coarse grid with at most `spacing` steps between along each axis, the borders included."""
        chosen = np.ones(len(self), bool)
        for column in self.places.T:
            last = int(column.max())
            chosen &= np.isin(column, np.linspace(0, last, -(-last // spacing) + 1).round().astype(int))
        if len(self) < np.prod(self._shape):  # where its points are missing, others stand in for them
            for point in range(len(self)):
                apart = np.abs(self.places[chosen] - self.places[point]).max(axis=1, initial=0)
                chosen[point] |= not len(apart) or apart.min() > spacing
        return np.flatnonzero(chosen)

    @cached_property
    def _shape(self) -> tuple[int, ...]:
        return tuple(self.places.max(axis=0) + 1)

    @cached_property
    def _numbers(self) -> Indices:
        numbers = np.full(self._shape, -1)
        numbers[tuple(self.places.T)] = np.arange(len(self))
        return numbers

    def _at(self, places: Indices) -> Indices:
        """Numbers (n,) of the points at places (n, axes); -1 where there is none."""
        inside = ((places >= 0) & (places < self._shape)).all(axis=1)
        found = np.full(len(places), -1)
        found[inside] = self._numbers[tuple(places[inside].T)]
        return found


class Atlas:
    """Positions and moments known at each point of a map.

    Parameters
    ----------
    points : how many points the map has
    """

    def __init__(self, points: int) -> None:
        self._known = np.full((points, 8, 6), np.nan)
        self._count = np.zeros(points, int)

    def add(self, point: Indices, position: Array, moment: Array) -> NDArray[np.bool_]:
        """Keep equilibria (n, 3), (n, 3) of the points (n,); says which of them were new."""
        places, new = np.concatenate([position, moment], axis=1), np.zeros(len(point), bool)
        order = np.argsort(point, kind="stable")
        first = np.searchsorted(point[order], point[order])
        rank = np.empty(len(point), int)
        rank[order] = np.arange(len(point)) - first
        for k in range(rank.max(initial=-1) + 1):  # one of each point at a time
            chosen = np.flatnonzero(rank == k)
            apart = np.linalg.norm(self._known[point[chosen]] - places[chosen, None], axis=2)
            fresh = chosen[~(apart < DUPLICATE_DISTANCE).any(axis=1)]
            if self._count[point[fresh]].max(initial=0) == self._known.shape[1]:
                self._known = np.concatenate([self._known, np.full_like(self._known, np.nan)], axis=1)
            self._known[point[fresh], self._count[point[fresh]]] = places[fresh]
            self._count[point[fresh]] += 1
            new[fresh] = True
        return new

    def within(self, grid: Grid) -> tuple[Indices, Array, Array]:
        """Points (k,) in order, positions and moments (k, 3) of the equilibria that lie in the ranges of a grid."""
        point, slot = np.nonzero(np.arange(self._known.shape[1]) < self._count[:, None])
        found = self._known[point, slot]
        inside = grid.holds(point, found[:, :3])
        return point[inside], found[inside, :3], found[inside, 3:]


def filled(grid: Grid, nodes: Indices) -> Atlas:
    """What is found from searches at `nodes`; an equilibrium that is carried is good to round-off like any other."""
    random, seeds = np.random.default_rng(0), []
    for first in range(0, len(nodes), TOGETHER):
        some = range(first, min(first + TOGETHER, len(nodes)))
        starts = [_starts(grid, int(nodes[k]), None if k % WHOLE == 0 else random) for k in some]
        problem, points = (np.concatenate(part) for part in zip(*starts, strict=True))
        seeds.append(newton_search(grid.balance, grid.holds, problem, points, EVERY, MARGIN, REACH, FAR))
    point, places = (np.concatenate(part) for part in zip(*seeds, strict=True))
    atlas = Atlas(len(grid))
    _spread(grid, atlas, point, places[:, :3], places[:, 3:])
    return atlas


def _starts(grid: Grid, point: int, random: np.random.Generator | None) -> tuple[Indices, Array]:
    """All starts at a point, or some: the point (n,) and scaled positions and moments (n, 6)."""
    points = grid.range(point).starts()
    if random is not None:
        points = points[random.choice(len(points), len(points) // PART, replace=False)]
    return np.full(len(points), point), points


def _spread(grid: Grid, atlas: Atlas, point: Indices, position: Array, moment: Array) -> None:
    """Carry equilibria from point to point until nothing new is found."""
    bound = FAR_APART * max(where.bound for where in grid.ranges)
    while len(point):
        new = atlas.add(point, position, moment)
        point, position, moment = point[new], position[new], moment[new]
        source, target = grid.neighbours(point)
        if not len(source):
            return
        which, arrived, position, moment = carried(
            grid.balance(point[source]), grid.balance(target), position[source], moment[source], bound
        )
        point = np.where(arrived, target[which], point[source[which]])
        inside = grid.holds(point, position, MARGIN)
        point, position, moment = point[inside], position[inside], moment[inside]
