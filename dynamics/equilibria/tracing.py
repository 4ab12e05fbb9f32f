"""A curve of solutions near a point, and the whole of it."""

from collections.abc import Callable

import numpy as np

from ...geometry.basics import Array
from ..steady import Indices
from .continuation import END, ON, ONE, Equations, Steps, corrected, follow


def near_curve(equations: Equations, guess: Array, reach: float) -> Array | None:
    """The point of a curve (k + 1,) across its direction at a guess (k + 1,) that is nearer than about `reach`."""
    slope = equations.linear(guess[None], ONE)[1]
    if not np.isfinite(slope).all():
        return None
    points, good = corrected(equations, guess[None], np.linalg.svd(slope)[2][:, -1], np.array([reach]))
    return points[0] if good[0] else None


def whole_curve(
    equations: Equations, start: Array, steps: Steps, inside: Callable[[Array], bool]
) -> tuple[Array, Array] | None:
    """Points and tangents (n, k + 1) of the curve through `start` (k + 1,), both ways, until it closes or leaves.

    The first point that is not `inside` belongs to it; a closed curve ends in its start.  None where the equations do
    not fix a curve.
    """
    _, sizes, rows = np.linalg.svd(equations.linear(start[None], ONE)[1][0])
    if sizes[-1] < 1e-12 * sizes[0]:
        return None
    ahead = _half(equations, start, rows[-1], steps, inside)
    if len(ahead) > 1 and ahead[-1][0] is start:
        pairs = ahead
    else:
        behind = _half(equations, start, -rows[-1], steps, inside)
        pairs = [*((point, -tangent) for point, tangent in behind[:0:-1]), *ahead]
    points, tangents = (np.array(column) for column in zip(*pairs, strict=True))
    return points, tangents


def _half(
    equations: Equations, start: Array, tangent: Array, steps: Steps, inside: Callable[[Array], bool]
) -> list[tuple[Array, Array]]:
    found = [(start, tangent)]

    def watch(which: Indices, points: Array, tangents: Array, lengths: Array) -> int:
        point, turned = points[0], tangents[0]
        travelled, gap = np.linalg.norm(point - found[-1][0]), np.linalg.norm(point - start)
        closed = len(found) > 2 and gap < travelled and turned @ tangent > 0.9
        found.append((point, turned))
        if closed:
            found[-1] = found[0]
        return END if closed or not inside(point) else ON

    follow(equations, start[None], tangent[None], steps, watch)
    return found
