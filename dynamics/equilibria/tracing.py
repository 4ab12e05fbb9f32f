"""A curve of solutions near a point, and whole curves through points of them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..steady import Indices
from .continuation import END, ON, ONE, Equations, Steps, Truth, corrected, follow


def near_curve(equations: Equations, guess: Array, reach: float) -> Array | None:
    """The point of a curve (k + 1,) across its direction at a guess (k + 1,) that is nearer than about `reach`."""
    slope = equations.linear(guess[None], ONE)[1]
    if not np.isfinite(slope).all():
        return None
    points, good = corrected(equations, guess[None], np.linalg.svd(slope)[2][:, -1], np.array([reach]))
    return points[0] if good[0] else None


Traced = tuple[Array, Array]
"""Points and tangents (n, k + 1) of a curve."""


def whole_curves(
    equations: Equations, starts: Array, steps: Steps, inside: Callable[[Array], Truth]
) -> list[Traced | None]:
    """Points and tangents (n, k + 1) of the curve through each of the starts (m, k + 1), followed all at once.

    Each is followed both ways until it closes or leaves: the first point that is not `inside` belongs to it, and a
    closed curve ends in its start.  None where the equations do not fix a curve.
    """
    _, sizes, rows = np.linalg.svd(equations.linear(starts, np.zeros(len(starts), int))[1])
    fixed = np.flatnonzero(sizes[:, -1] >= 1e-12 * sizes[:, 0])
    begin, tangent = np.repeat(starts[fixed], 2, axis=0), np.repeat(rows[fixed, -1], 2, axis=0)
    tangent[1::2] *= -1
    ways = _followed(equations, begin, tangent, steps, inside)
    found: list[Traced | None] = [None] * len(starts)
    for number, curve in enumerate(fixed):
        found[curve] = _joined(ways[2 * number], ways[2 * number + 1])
    return found


def _followed(
    equations: Equations, starts: Array, tangents: Array, steps: Steps, inside: Callable[[Array], Truth]
) -> list[list[Traced]]:
    """The points and tangents (k + 1,) of curves from their starts (m, k + 1) on, one way."""
    found: list[list[Traced]] = [[pair] for pair in zip(starts, tangents, strict=True)]
    before = starts.copy()

    def watch(which: Indices, points: Array, turned: Array, lengths: Array) -> NDArray[np.int_]:
        travelled = np.linalg.norm(points - before[which], axis=1)
        near = np.linalg.norm(points - starts[which], axis=1) < travelled
        closed = near & (np.sum(turned * tangents[which], axis=1) > 0.9)
        before[which] = points
        for k, (curve, point, tangent) in enumerate(zip(which, points, turned, strict=True)):
            closed[k] &= len(found[curve]) > 2
            found[curve].append(found[curve][0] if closed[k] else (point, tangent))
        return np.where(closed | ~inside(points), END, ON)

    follow(equations, starts, tangents, steps, watch)
    return found


def _joined(ahead: list[Traced], behind: list[Traced]) -> Traced:
    """One curve from its two halves; a closed one is whole in the first."""
    if len(ahead) == 1 or ahead[-1] is not ahead[0]:
        ahead = [*((point, -tangent) for point, tangent in behind[:0:-1]), *ahead]
    points, tangents = (np.array(column) for column in zip(*ahead, strict=True))
    return points, tangents
