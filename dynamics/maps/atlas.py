"""Equilibria at many points of a map, each kept once."""

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..steady import Indices

SAME = 1e-6
"""Equilibria nearer to each other than this, in radii and rad together, are one."""


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
