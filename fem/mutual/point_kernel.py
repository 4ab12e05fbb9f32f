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
    seen, pointing = grid.box.to_body(places), moments @ grid.box.rotation
    sums = [_summed(grid, seen[k : k + CHUNK], pointing[k : k + CHUNK]) for k in range(0, len(places), CHUNK)]
    found = np.concatenate([np.zeros((7 + len(ENTRIES), 0)), *sums], axis=1)
    turn, second = np.kron(np.eye(2), grid.box.rotation), np.moveaxis(found[7:][WHERE], 2, 0)
    return found[0], found[1:7].T @ turn.T, turn @ second @ turn.T


def _summed(grid: AnswerGrid, places: Array, moments: Array) -> Array:
    """The kernel's outputs (28, n), summed over the points."""
    count, points = len(places), len(grid.points)
    given = np.empty((6 + NUMBERS, count, points))
    given[:3] = places.T[:, :, None] - grid.points.T[:, None]
    given[3:6] = moments.T[:, :, None]
    given[6:] = grid.numbers.T[:, None]
    pars = np.repeat(np.append(grid.axis, grid.radius)[:, None], count * points, axis=1)
    found = _kernel()(given.reshape(len(given), -1), pars=pars)
    return np.asarray(found.reshape(-1, count, points).sum(axis=2))
