"""Fields that are harmonic where the floater is, as sums over the same few multipoles at points beyond.

B = -∇ Σ c_k Θ_k: each multipole is free of divergence and curl by construction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations_with_replacement, product

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array, Watch, frozen_array, unwatched
from ..compiled_code import compiled
from ..harmonics.expansion import MultipoleExpansion
from ..harmonics.expressions import FieldExpressions
from ..harmonics.solid import derivative, outer_sums

INDEPENDENT = 1e-10  # Squared part of a multipole that the chosen ones must leave for it to be taken
NOISE = 1e-11  # Weights below this share of the largest are what symmetry forbids
# Multipoles at a time, by default; the fit ends where so many steps leave more than this share of the error.
STEP, PATIENCE, STALLED = 2, 6, 0.95


def _unfolded(rank: int) -> NDArray[np.int_]:
    """Where the entries of a symmetric tensor (3, …, 3) lie among those with indices in order."""
    distinct = list(combinations_with_replacement(range(3), rank))
    places = [distinct.index(tuple(sorted(indices))) for indices in product(range(3), repeat=rank)]
    return np.array(places).reshape((3,) * rank)


def real_kinds(lowest: int, highest: int) -> list[tuple[int, int, int]]:
    """Degree, order and part of all multipoles with degrees from the lowest to the highest."""
    return [(l, m, i) for l in range(lowest, highest + 1) for m in range(l + 1) for i in (0, 1)[: 1 + (m > 0)]]


TWICE, THRICE = _unfolded(2), _unfolded(3)  # For the gradient of a curl-free field, and for its second derivatives


@dataclass(frozen=True, eq=False)
class Multipoles:
    """Single multipoles Re Θ_lm and Im Θ_lm of unit strength (T) at given centres.

    Parameters
    ----------
    centers : (k, 3) m
    kinds : (k, 3) whole numbers: degree l, order m, and 0 for the real or 1 for the imaginary part
    scale : length that makes coordinates free of units, m
    """

    centers: Array = field(metadata={"units": "m"})
    kinds: Array
    scale: float = field(metadata={"units": "m"})

    def __post_init__(self) -> None:
        for name in ("centers", "kinds"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), (len(self.kinds), 3)))

    @classmethod
    def at(cls, centers: Iterable[Array], kinds: Sequence[tuple[int, int, int]], scale: float) -> Multipoles:
        """All of these kinds at each of these centres."""
        pairs = list(product(centers, kinds))
        return cls(np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs], float), scale)

    def subset(self, numbers: Sequence[int]) -> Multipoles:
        return Multipoles(self.centers[list(numbers)], self.kinds[list(numbers)], self.scale)

    @cached_property
    def _expansions(self) -> list[MultipoleExpansion]:
        found = []
        for center, (degree, order, imaginary) in zip(self.centers, self.kinds.astype(int), strict=True):
            coefficients = np.zeros((degree + 1, degree + 1), complex)
            coefficients[degree, order] = 1j if imaginary else 1.0
            found.append(MultipoleExpansion(center, self.scale, coefficients))
        return found

    def expressions(self, position: Sequence[hy.expression]) -> list[FieldExpressions]:
        """B (T) and its gradient (T/m) of each as heyoka expressions of a position (m)."""
        return [expansion.expressions(position) for expansion in self._expansions]

    @cached_property
    def _compiled(self) -> hy.cfunc_dbl:
        variables = hy.make_vars("x", "y", "z")
        outputs: list[hy.expression] = []
        for flux, gradient in self.expressions(variables):
            outputs += [*flux, *(gradient[i][j] for i in range(3) for j in range(i, 3))]
        # Optimised it would be twice as fast at best, and compiled in ten times the time.
        return compiled(hy.cfunc, outputs, variables, compact_mode=len(outputs) > 2000, opt_level=0, batch_size=1)

    @cached_property
    def _compiled_curvature(self) -> hy.cfunc_dbl:
        variables = hy.make_vars("x", "y", "z")
        outputs = [
            hy.diff(gradient[i][j], variables[k])
            for _, gradient in self.expressions(variables)
            for i, j, k in combinations_with_replacement(range(3), 3)
        ]
        return compiled(hy.cfunc, outputs, variables, compact_mode=True, opt_level=0)

    def curvature(self, points: Array) -> Array:
        """∂²B_i/∂x_j∂x_k (n, k, 3, 3, 3) T/m² at points (n, 3) m."""
        values = self._compiled_curvature(np.ascontiguousarray(points.T)).reshape(len(self.kinds), 10, -1)
        return np.moveaxis(values[:, THRICE], -1, 0)

    def fields(self, points: Array) -> Array:
        """B (n, k, 3) T at points (n, 3) m, without compilation."""
        found = np.zeros((len(points), len(self.kinds), 3))
        degree = int(self.kinds[:, 0].max())
        for center in np.unique(self.centers, axis=0):
            here = np.flatnonzero((self.centers == center).all(axis=1))
            single = np.zeros((len(here), degree + 1, degree + 1), complex)
            for row, number in enumerate(here):
                coefficients = self._expansions[number].coefficients
                single[row, : len(coefficients), : len(coefficients)] = coefficients
            parts = [-derivative(coefficients, axis) for coefficients in single for axis in range(3)]
            found[:, here] = outer_sums(parts, (points - center) / self.scale).reshape(len(points), len(here), 3)
        return found

    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (n, k, 3) T and ∂B_i/∂x_j (n, k, 3, 3) T/m at points (n, 3) m."""
        values = self._compiled(np.ascontiguousarray(points.T)).reshape(len(self.kinds), 9, -1)
        return np.moveaxis(values[:, :3], -1, 0), np.moveaxis(values[:, 3:][:, TWICE], -1, 0)


@dataclass(frozen=True, eq=False)
class Fit:
    """Field functions as sums of multipoles."""

    multipoles: Multipoles  # the k chosen
    weights: Array  # (functions, k) c_k
    error: Array  # (functions, n, 3) what is left at the points of the fit


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
    watch : progress callback
    """
    columns = choice.fields(points) * point_scale[:, None, None]
    columns = columns.swapaxes(1, 2).reshape(-1, len(choice.kinds))
    target = (values * state_scale[:, None, None] * point_scale[:, None]).reshape(len(values), len(columns)).T
    size = np.linalg.norm(columns, axis=0)
    free, rest = columns / size, target
    chosen: list[int] = []
    left = [_worst(rest)]
    while True:
        least = max(tolerance, np.finfo(float).eps * left[0])  # progress goes by the orders of magnitude to it
        gone = 1.0 if left[-1] <= least else float(np.log(left[0] / left[-1]) / np.log(left[0] / least))
        watch("field functions", gone)
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


def _worst(rest: Array) -> float:
    return float(np.sqrt(np.max(np.sum((rest**2).reshape(len(rest) // 3, 3 * rest.shape[1]), axis=1))))
