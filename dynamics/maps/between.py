"""Branches followed from points of a map towards their neighbours, many at once, through folds.

Pseudo-arclength as in `arclength`, with the way λ from one point to the next as the parameter: a branch ends where it
comes to the neighbour (λ = 1) or, after a fold, back to its own point (λ = 0), or leaves the range.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..steady import EVERY, Balance, Indices, moved, solve, tangent_basis
from .grid import Grid

Truth = NDArray[np.bool_]
UNIT = 0.1
"""Length of the way between two points, in radii and rad."""
FIRST, LONGEST, SHORTEST, MOST = 0.01, 0.1, 1e-5, 300
"""Steps along a branch, and how many."""
TURN = 0.2
"""Largest angle between the tangents at the ends of a step, rad."""
FAR = 1.5
"""The range is left where the floater is this much farther than its farthest."""


@dataclass
class _Walk:
    """Branches (n,) on their way: where they are, and the step that is tried next."""

    start: Indices
    end: Indices
    position: Array
    moment: Array
    way: Array
    tangent: Array
    step: Array

    def kept(self, rows: NDArray[Any]) -> _Walk:
        return _Walk(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def between(grid: Grid, start: Indices, end: Indices, position: Array, moment: Array) -> tuple[Indices, Array, Array]:
    """Follow branches from equilibria (n, 3), (n, 3) of points `start` (n,) towards those of points `end`.

    Returns
    -------
    Points (k,), positions and moments (k, 3) of the equilibria in which they ended.
    """
    count = len(start)
    walk = _Walk(start, end, position, moment, np.zeros(count), np.zeros((count, 7)), np.full(count, FIRST))
    first = np.zeros((count, 7))
    first[:, 6] = 1.0
    walk.tangent = _tangent(grid, walk, first)
    walk = walk.kept(np.flatnonzero(np.isfinite(walk.tangent).all(axis=1)))
    ended: list[tuple[Indices, Array, Array]] = []
    for _ in range(MOST):
        if not len(walk.start):
            break
        walk, done = _advanced(grid, walk)
        ended.append(_landed(grid, walk.kept(done)))
        bound = FAR * grid.farthest / grid.family.scene.floater.radius
        lost = (walk.step < SHORTEST) | (np.linalg.norm(walk.position, axis=1) > bound)
        walk = walk.kept(~done & ~lost)
    points, places, moments = zip(*ended, strict=True) if ended else ([start[:0]], [position[:0]], [moment[:0]])
    return np.concatenate(points), np.concatenate(places), np.concatenate(moments)


def _advanced(grid: Grid, walk: _Walk) -> tuple[_Walk, Truth]:
    """One step of each branch, or a shorter one to try where it was too long; and which have come to an end."""
    position = walk.position + walk.step[:, None] * walk.tangent[:, :3]
    moment = walk.moment + walk.step[:, None] * walk.tangent[:, 3:6]
    moment /= np.linalg.norm(moment, axis=1, keepdims=True)
    new = _Walk(walk.start, walk.end, position, moment, walk.way, walk.tangent, walk.step)
    new.way = walk.way + walk.step * walk.tangent[:, 6] / UNIT
    good = _corrected(grid, new, walk.step)
    new.tangent = _tangent(grid, new, walk.tangent)
    with np.errstate(invalid="ignore"):
        good &= np.sum(new.tangent * walk.tangent, axis=1) > np.cos(TURN)
    for name in ("position", "moment", "way", "tangent"):
        column = good if name == "way" else good[:, None]
        setattr(new, name, np.where(column, getattr(new, name), getattr(walk, name)))
    new.step = np.where(good, np.minimum(1.4 * walk.step, LONGEST), walk.step / 2)
    return new, good & ((new.way >= 1.0) | (new.way <= 0.0))


def _corrected(grid: Grid, walk: _Walk, step: Array) -> Truth:
    """Newton's method across the tangents, in place; says where it found the branch again."""
    active, good = np.arange(len(step)), np.zeros(len(step), bool)
    for _ in range(5):
        part = walk.kept(active)
        value, slope = _extended(grid, part)
        across = np.einsum("nka,na->nk", tangent_basis(part.moment), part.tangent[:, 3:6])
        row = np.concatenate([part.tangent[:, :3], across, part.tangent[:, 6:]], axis=1)
        change = -_solved(np.concatenate([slope, row[:, None]], axis=1), np.pad(value, ((0, 0), (0, 1))))
        size = np.linalg.norm(change, axis=1)
        near = size < np.maximum(step[active] / 2, 1e-8)  # not a number is not near
        active, change, size = active[near], change[near], size[near]
        walk.position[active], walk.moment[active] = moved(walk.position[active], walk.moment[active], change[:, :5])
        walk.way[active] += change[:, 5] / UNIT
        good[active[size < 1e-9]] = True
        active = active[size >= 1e-9]
        if not len(active):
            break
    return good


def _balance(grid: Grid, walk: _Walk, way: Array) -> Balance:
    (f, m), (g, n) = grid.place(walk.start), grid.place(walk.end)
    return Balance(grid.family.rates, grid.family.values(f + way * (g - f), m + way * (n - m)), grid.spin)


def _extended(grid: Grid, walk: _Walk) -> tuple[Array, Array]:
    """Balances (n, 5) and their derivatives (n, 5, 6), the last along the way by a difference, good to 1e-6."""
    value, slope = _balance(grid, walk, walk.way)(walk.position, walk.moment)
    ahead = _balance(grid, walk, walk.way + 1e-6)(walk.position, walk.moment)[0]
    return value, np.concatenate([slope, ((ahead - value) / (1e-6 * UNIT))[:, :, None]], axis=2)


def _tangent(grid: Grid, walk: _Walk, before: Array) -> Array:
    """Unit directions (n, 7) of the branches, going on as `before` (n, 7); not a number where there is none."""
    _, slope = _extended(grid, walk)
    basis = tangent_basis(walk.moment)
    old = np.concatenate([before[:, :3], np.einsum("nka,na->nk", basis, before[:, 3:6]), before[:, 6:]], axis=1)
    along = _solved(np.concatenate([slope, old[:, None]], axis=1), np.eye(6)[5] + np.zeros((len(old), 1)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return np.concatenate([along[:, :3], np.einsum("nk,nka->na", along[:, 3:5], basis), along[:, 5:]], axis=1)


def _solved(matrices: Array, vectors: Array) -> Array:
    """Solutions (n, k); not a number where a matrix is singular or not finite."""
    good: Truth = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    sign = np.zeros(len(matrices))
    sign[good] = np.linalg.slogdet(matrices[good])[0]
    good &= sign != 0
    found = np.full(vectors.shape, np.nan)
    found[good] = np.linalg.solve(matrices[good], vectors[good][..., None])[..., 0]
    return found


def _landed(grid: Grid, walk: _Walk) -> tuple[Indices, Array, Array]:
    """The equilibria at the points in which branches ended."""
    if not len(walk.start):
        return walk.start, walk.position, walk.moment
    point = np.where(walk.way >= 1.0, walk.end, walk.start)
    position, moment, size = solve(grid.balance(point), walk.position, walk.moment, EVERY, 12)
    good = size < 1e-8
    return point[good], position[good], moment[good]
