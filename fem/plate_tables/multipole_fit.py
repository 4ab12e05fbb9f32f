"""Fit of field functions by few multipoles: greedy choice among many candidates.

From many candidates those are taken one by one that lower the remaining error most (orthogonal least squares:
S. Chen et al., Int. J. Control 50 (1989) 1873), until the fit on the surface of the region is good enough;
inside, harmonic functions are at most as wrong as there.  Two things set a floor, where the fit ends too: the
highest degree among the candidates, and the finite elements, whose currents are free of divergence only weakly, so
that their field is harmonic only to their own accuracy.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array, Watch, unwatched
from .field_functions import Multipoles

INDEPENDENT = 1e-10
"""Squared part of a multipole that the chosen ones must leave for it to be taken."""
NOISE = 1e-11
"""Weights below this share of the largest are what symmetry forbids."""
STEP, PATIENCE, STALLED = 2, 6, 0.95
"""Multipoles at a time, unless told; the fit ends where so many steps leave more than this share of the error."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Field functions as sums of multipoles.

    Parameters
    ----------
    multipoles : the k chosen
    weights : (functions, k) c_k
    error : (functions, n, 3) what is left at the points of the fit
    """

    multipoles: Multipoles
    weights: Array
    error: Array


def fit_multipoles(
    choice: Multipoles,
    points: Array,
    values: Array,
    state_scale: Array,
    point_scale: Array,
    tolerance: float,
    enough: Callable[[Array], bool],
    step: int = STEP,
    watch: Watch = unwatched,
) -> Fit:
    """Few multipoles that meet the tolerance and are `enough`, or as many as still help.

    Parameters
    ----------
    values : (functions, n, 3) B of each function at `points` (n, 3)
    state_scale, point_scale : (functions,) and (n,) factors that make errors comparable
    tolerance : for the norm of the scaled error over functions and components, at every point
    enough : whether errors (functions, n, 3) are small enough
    step : multipoles between two looks at the error
    watch : hears of the progress, told by the orders of magnitude between the first error and the tolerance
    """
    columns = choice.fields(points) * point_scale[:, None, None]
    columns = columns.swapaxes(1, 2).reshape(-1, len(choice.kinds))
    target = (values * state_scale[:, None, None] * point_scale[:, None]).reshape(len(values), len(columns)).T
    size = np.linalg.norm(columns, axis=0)
    free, rest = columns / size, target
    chosen: list[int] = []
    left = [_worst(rest)]
    while True:
        watch("field functions", _share(left, tolerance))
        error = rest.T.reshape(values.shape) / state_scale[:, None, None] / point_scale[:, None]
        stalled = len(left) > PATIENCE and left[-1] > STALLED * left[-1 - PATIENCE]
        if stalled or (left[-1] <= tolerance and enough(error)):
            break
        for _ in range(step):
            remaining = np.einsum("ij,ij->j", free, free)
            gain = np.sum((free.T @ rest) ** 2, axis=1) / np.maximum(remaining, INDEPENDENT)
            best = int(np.argmax(np.where(remaining > INDEPENDENT, gain, 0.0)))
            if remaining[best] <= INDEPENDENT:  # none is left: the error stays until the fit has stalled
                break
            direction = free[:, best] / np.linalg.norm(free[:, best])
            chosen.append(best)
            free = free - np.outer(direction, direction @ free)
            rest = rest - np.outer(direction, direction @ rest)
        left.append(_worst(rest))
    scaled = np.linalg.lstsq(columns[:, chosen] / size[chosen], target, rcond=None)[0]
    weights = (scaled / size[chosen][:, None]).T
    small = np.abs(scaled.T) < NOISE * np.abs(scaled).max(initial=0.0)
    return Fit(choice.subset(chosen), np.where(small, 0.0, weights / state_scale[:, None]), error)


def _share(left: Sequence[float], tolerance: float) -> float:
    """How far the errors have come to the tolerance, or to round-off, by orders of magnitude."""
    least = max(tolerance, np.finfo(float).eps * left[0])
    return 1.0 if left[-1] <= least else float(np.log(left[0] / left[-1]) / np.log(left[0] / least))


def _worst(rest: Array) -> float:
    return float(np.sqrt(np.max(np.sum((rest**2).reshape(len(rest) // 3, 3 * rest.shape[1]), axis=1))))
