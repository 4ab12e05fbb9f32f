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
from ..equilibria import solutions
from ..steady import EVERY, Indices, solve
from .between import between
from .grid import Atlas, Grid

SPACING = 5
"""Points of the map between two searches."""
WHOLE, PART = 8, 8
"""Every eighth search has all starts, the others an eighth of them."""
MARGIN = 0.3
"""Sheets are followed so far beyond the range (radii): what its border cuts into pieces is whole there."""
JUMP = 0.15
"""A neighbour farther away than this (radii and rad) may be another branch's."""


def filled(grid: Grid, nodes: Indices, progress: Callable[[float], None] | None = None) -> Atlas:
    """What is found from searches at `nodes`; an equilibrium that is carried is good to round-off like any other."""
    atlas, seeds, random = Atlas(len(grid)), [], np.random.default_rng(0)
    for number, point in enumerate(nodes):
        seeds.append(_searched(grid, int(point), None if number % WHOLE == 0 else random))
        if progress is not None:
            progress(0.9 * (number + 1) / len(nodes))
    point, position, moment = (np.concatenate(part) for part in zip(*seeds, strict=True))
    _spread(grid, atlas, point, position, moment)
    return atlas


def _searched(grid: Grid, point: int, random: np.random.Generator | None) -> tuple[Indices, Array, Array]:
    """Equilibria of one point, from all starts or from some."""
    where = grid.range(point)
    position, moment = where.starts()
    if random is not None:
        chosen = random.choice(len(position), len(position) // PART, replace=False)
        position, moment = position[chosen], moment[chosen]
    found = solutions(grid.alone(point), where, position, moment, EVERY, MARGIN)
    return np.full(len(found), point), found[:, :3], found[:, 3:]


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
