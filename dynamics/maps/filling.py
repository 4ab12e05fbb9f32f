"""All equilibria at the points of a grid: searched for at some, carried from point to point to the others.

On a coarse grid Newton's method searches from the starts of `equilibria.search`, all of them at some points and a
random eighth at others.  From what is found each equilibrium is carried to the points beside it, all at once, until
nothing new is found.  Where that does not lead to the neighbour the branch is followed by its arc length, around the
fold and back on the other side if there is one (`between`).  So a sheet of equilibria is found whole if one of its
points, or of a sheet that meets it in a fold, is found by a search; only one that fits between the points of the coarse
grid, and meets no other, can be missed.
"""

from collections.abc import Callable

import numpy as np

from ...geometry.basics import Array
from ..equilibria import Search
from ..steady import EVERY, Indices, solve
from .between import between
from .grid import Atlas, Grid

SPACING = 5
"""Points of the map between two searches."""
WHOLE, PART = 64, 8
"""One of so many searches has all starts, the others an eighth of them, which misses less than one in a hundred of a
point's equilibria: a sheet is lost only if every search that meets it does."""
REACH, FAR = 0.8, 1.0
"""Longest steps of the searches, rad of the moment and radii of the position, and beyond that distance (radii) as a
part of it, as the field changes: with 0.3 rad and radii they are more than twice as many, and an eighth of the starts
misses several times as much."""
TOGETHER = 8
"""Searches that are made side by side: enough that NumPy's calls cost less than what they compute."""
MARGIN = 0.3
"""Sheets are followed so far beyond the range (radii): what its border cuts into pieces is whole there."""
JUMP = 0.15
"""A neighbour farther away than this (radii and rad) may be another branch's."""


def filled(grid: Grid, nodes: Indices, progress: Callable[[float], None] | None = None) -> Atlas:
    """What is found from searches at `nodes`; an equilibrium that is carried is good to round-off like any other."""
    search = Search(grid.balance, grid.holds, EVERY, MARGIN, REACH, FAR)
    random, seeds = np.random.default_rng(0), []
    for first in range(0, len(nodes), TOGETHER):
        some = range(first, min(first + TOGETHER, len(nodes)))
        starts = [_starts(grid, int(nodes[k]), None if k % WHOLE == 0 else random) for k in some]
        seeds.append(search.solutions(*(np.concatenate(part) for part in zip(*starts, strict=True))))
        if progress is not None:
            progress(0.9 * (some[-1] + 1) / len(nodes))
    point, places = (np.concatenate(part) for part in zip(*seeds, strict=True))
    atlas = Atlas(len(grid))
    _spread(grid, atlas, point, places[:, :3], places[:, 3:])
    return atlas


def _starts(grid: Grid, point: int, random: np.random.Generator | None) -> tuple[Indices, Array, Array]:
    """All starts at a point, or some: the point and scaled positions and moments, (n,), (n, 3) and (n, 3)."""
    position, moment = grid.range(point).starts()
    if random is not None:
        chosen = random.choice(len(position), len(position) // PART, replace=False)
        position, moment = position[chosen], moment[chosen]
    return np.full(len(position), point), position, moment


def _spread(grid: Grid, atlas: Atlas, point: Indices, position: Array, moment: Array) -> None:
    """Carry equilibria from point to point until nothing new is found."""
    while len(point):
        new = atlas.add(point, position, moment)
        point, position, moment = point[new], position[new], moment[new]
        source, target = grid.neighbours(point)
        if not len(source):
            return
        arrived, turned, size = solve(grid.balance(target), position[source], moment[source], EVERY, 12)
        apart = np.linalg.norm(np.concatenate([arrived - position[source], turned - moment[source]], axis=1), axis=1)
        good = (size < 1e-8) & (apart < JUMP)
        rest = source[~good]
        walked = between(grid, point[rest], target[~good], position[rest], moment[rest])
        point = np.concatenate([target[good], walked[0]])
        position = np.concatenate([arrived[good], walked[1]])
        moment = np.concatenate([turned[good], walked[2]])
        inside = grid.holds(point, position, MARGIN)
        point, position, moment = point[inside], position[inside], moment[inside]
