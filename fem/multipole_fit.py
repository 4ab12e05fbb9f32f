"""Fit of field functions by few multipoles: greedy choice among many candidates.

From many candidates those are taken one by one that lower the remaining error most (orthogonal least squares:
S. Chen et al., Int. J. Control 50 (1989) 1873), until the fit on the surface of the region meets the tolerance;
inside, harmonic functions are at most as wrong as there.  What finite elements cannot do sets a floor: their
currents are free of divergence only weakly, so that their field is harmonic only to their own accuracy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.box import Array
from .accuracy_error import AccuracyError
from .field_functions import Multipoles

INDEPENDENT = 1e-10
"""Squared part of a multipole that the chosen ones must leave for it to be taken."""
NOISE = 1e-11
"""Weights below this share of the largest are what symmetry forbids."""


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
    choice: Multipoles, points: Array, values: Array, state_scale: Array, point_scale: Array, tolerance: float
) -> Fit:
    """Fewest multipoles with which all points meet the tolerance.

    Parameters
    ----------
    values : (functions, n, 3) B of each function at `points` (n, 3)
    state_scale, point_scale : (functions,) and (n,) factors that make errors comparable
    tolerance : for the norm of the scaled error over functions and components, at every point

    Raises
    ------
    AccuracyError : not reached with all candidates
    """
    columns = choice.evaluate(points)[0] * point_scale[:, None, None]
    columns = columns.swapaxes(1, 2).reshape(-1, len(choice.kinds))
    target = (values * state_scale[:, None, None] * point_scale[:, None]).reshape(len(values), -1).T
    size = np.linalg.norm(columns, axis=0)
    free, rest, basis = columns / size, target, np.zeros((len(target), 0))
    chosen: list[int] = []
    while _worst(rest) > tolerance:
        remaining = np.einsum("ij,ij->j", free, free)
        gain = np.where(
            remaining > INDEPENDENT, np.sum((free.T @ rest) ** 2, axis=1) / np.maximum(remaining, 1e-300), 0
        )
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            raise AccuracyError(
                f"Input rtol must be larger: {len(chosen)} multipoles leave {_worst(rest):.1e}; or refine the mesh."
            )
        chosen.append(best)
        direction = free[:, best] - basis @ (basis.T @ free[:, best])
        direction = direction / np.linalg.norm(direction)
        basis = np.column_stack([basis, direction])
        free = free - np.outer(direction, direction @ free)
        rest = rest - np.outer(direction, direction @ rest)
    scaled = np.linalg.lstsq(columns[:, chosen] / size[chosen], target, rcond=None)[0]
    weights = (scaled / size[chosen][:, None]).T
    small = np.abs(scaled.T) < NOISE * np.abs(scaled).max(initial=0.0)
    error = rest.T.reshape(values.shape) / state_scale[:, None, None] / point_scale[:, None]
    return Fit(choice.subset(chosen), np.where(small, 0.0, weights / state_scale[:, None]), error)


def _worst(rest: Array) -> float:
    return float(np.sqrt(np.max(np.sum((rest**2).reshape(-1, 3, rest.shape[1]), axis=(1, 2)))))
