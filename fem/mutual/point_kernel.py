"""What one point of an `AnswerGrid` contributes, compiled once for all points, magnets and rotors.

A sum over the points of a magnet at many places is then one call on their product, and the first and second derivatives
come with it: for a cube, in a few microseconds a place.
"""

from functools import cache
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.basics import Array
from ..storage import compiled
from .answer_grid import AnswerGrid, point_energy

ENTRIES = [(a, b) for a in range(6) for b in range(a, 6)]
"""Of a symmetric matrix over place and moment: those that are computed."""
WHERE = np.array([[ENTRIES.index((min(a, b), max(a, b))) for b in range(6)] for a in range(6)])
"""Which of them each entry is."""

NUMBERS = 13
"""Of a point."""
IDENTITY = np.eye(3)


@cache
def _kernel() -> Any:
    place, moment = hy.make_vars("x", "y", "z"), hy.make_vars("m_x", "m_y", "m_z")
    numbers = [hy.expression(f"n_{k}") for k in range(NUMBERS)]
    energy = point_energy(place, moment, numbers, [hy.par[0], hy.par[1], hy.par[2]], hy.par[3])
    free = [*place, *moment]
    gradient = list(hy.diff_tensors([energy], diff_args=free, diff_order=1).gradient)
    hessian = np.asarray(hy.diff_tensors(gradient, diff_args=free, diff_order=1).jacobian)
    outputs = [energy, *gradient, *(hessian[a, b] for a, b in ENTRIES)]
    return compiled(hy.cfunc, outputs, [*free, *numbers], fast_math=True)


CHUNK = 48
"""Places at once, so that all numbers stay in the processor's cache."""


def grid_derivatives(grid: AnswerGrid, places: Array, moments: Array) -> tuple[Array, Array, Array]:
    """Energy (n,) J, gradient (n, 6) and second derivatives (n, 6, 6) by place (m) and moment (A m²) at (n, 3) each."""
    rotation = grid.box.rotation
    seen, pointing = grid.box.to_body(places), moments @ rotation
    if len(places) <= CHUNK:
        found = _summed(grid, seen, pointing)
    else:
        sums = [_summed(grid, seen[k : k + CHUNK], pointing[k : k + CHUNK]) for k in range(0, len(places), CHUNK)]
        found = np.concatenate(sums, axis=1)
    slope, second = found[1:7].T, found[7:].T[:, WHERE]
    if np.array_equal(rotation, IDENTITY):
        return found[0], slope, second
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotation
    return found[0], slope @ turn.T, turn @ second @ turn.T


def _summed(grid: AnswerGrid, places: Array, moments: Array) -> Array:
    """The kernel's outputs (28, n), summed over the points."""
    count, points = len(places), len(grid.points)
    given = np.empty((6 + NUMBERS, count, points))
    np.subtract(places.T[:, :, None], grid.points.T[:, None], out=given[:3])
    given[3:6] = moments.T[:, :, None]
    given[6:] = grid.numbers.T[:, None]
    pars = np.empty((4, count * points))
    pars[:3], pars[3] = grid.axis[:, None], grid.radius
    found = _kernel()(given.reshape(len(given), -1), pars=pars)
    return np.asarray(found.reshape(len(found), count, points).sum(axis=2))
