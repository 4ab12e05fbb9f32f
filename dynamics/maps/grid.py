"""The points of a map, frequency by measure of the rotor, the balances there, and the equilibria that are known."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..equilibria import SearchRange
from ..steady import Balance, Indices
from .families import RotorFamily

SAME = 1e-6
"""Equilibria nearer to each other than this, in radii and rad together, are one."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A map's points, numbered row by row.

    Parameters
    ----------
    family : its scenes
    frequencies, measures : (n,) Hz and (m,) m or rad
    spin : body spin s
    farthest : of the range in which equilibria are looked for, m
    """

    family: RotorFamily
    frequencies: Array
    measures: Array
    spin: float
    farthest: float

    def __len__(self) -> int:
        return len(self.frequencies) * len(self.measures)

    @cached_property
    def _ranges(self) -> list[SearchRange]:
        return [SearchRange(self.family.at(self.frequencies[0], m), self.farthest) for m in self.measures]

    def place(self, point: Indices) -> tuple[Array, Array]:
        """Frequencies and measures (n,) of points (n,)."""
        row, column = np.divmod(point, len(self.measures))
        return self.frequencies[row], self.measures[column]

    def balance(self, point: Indices) -> Balance:
        """The balance in which every point has its own problem."""
        return Balance(self.family.rates, self.family.values(*self.place(point)), self.spin)

    def alone(self, point: int) -> Balance:
        """The balance of one point, for any number of positions."""
        return Balance(self.family.rates, self.family.values(*self.place(np.array([point])))[0], self.spin)

    def range(self, point: int) -> SearchRange:
        """Where equilibria of one point are looked for."""
        return self._ranges[point % len(self.measures)]

    def holds(self, point: Indices, position: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Which of the scaled positions (n, 3) lie in the range of their points (n,), or at most a margin outside."""
        inside, column = np.zeros(len(point), bool), point % len(self.measures)
        for k in np.unique(column):
            chosen = column == k
            inside[chosen] = self._ranges[k].holds(position[chosen], margin)
        return inside

    def neighbours(self, point: Indices) -> tuple[Indices, Indices]:
        """Pairs of a place in `point` and one of the up to four points beside it."""
        row, column = np.divmod(point, len(self.measures))
        pairs = []
        for along, across in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            r, c = row + along, column + across
            inside = (r >= 0) & (r < len(self.frequencies)) & (c >= 0) & (c < len(self.measures))
            pairs.append((np.flatnonzero(inside), (r * len(self.measures) + c)[inside]))
        return np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs])

    def coarse(self, spacing: int) -> Indices:
        """Points of a coarse grid with at most `spacing` steps between, the borders included."""
        rows, columns = (
            np.unique(np.linspace(0, n - 1, -(-(n - 1) // spacing) + 1).round().astype(int))
            for n in (len(self.frequencies), len(self.measures))
        )
        return np.asarray((rows[:, None] * len(self.measures) + columns).ravel())


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
            fresh = chosen[~(apart < SAME).any(axis=1)]
            if self._count[point[fresh]].max(initial=0) == self._known.shape[1]:
                self._known = np.concatenate([self._known, np.full_like(self._known, np.nan)], axis=1)
            self._known[point[fresh], self._count[point[fresh]]] = places[fresh]
            self._count[point[fresh]] += 1
            new[fresh] = True
        return new

    def all(self) -> tuple[Indices, Array, Array]:
        """Points (k,) in order, positions and moments (k, 3)."""
        point, slot = np.nonzero(np.arange(self._known.shape[1]) < self._count[:, None])
        found = self._known[point, slot]
        return point, found[:, :3], found[:, 3:]
