"""Field expressions compiled to machine code, evaluated at many points in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ..geometry.box import Array

FieldExpressions = tuple[list[hy.expression], list[list[hy.expression]]]
"""B_i (T) and ∂B_i/∂x_j (T/m), the latter symmetric."""

SYMMETRIC = np.array([[3, 4, 5], [4, 6, 7], [5, 7, 8]])
"""Where the entries of a symmetric 3 × 3 matrix lie among the nine outputs."""


class CompiledField:
    """B and its gradient at points.

    Parameters
    ----------
    build : takes three heyoka expressions (position, m) and returns `FieldExpressions`
    """

    def __init__(self, build: Callable[[Sequence[hy.expression]], FieldExpressions]) -> None:
        variables = hy.make_vars("x", "y", "z")
        field, gradient = build(variables)
        self._function = hy.cfunc([*field, *(gradient[i][j] for i in range(3) for j in range(i, 3))], variables)

    def __call__(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) in T and ∂B_i/∂x_j (n, 3, 3) in T/m at `points` (n, 3), m."""
        inputs = np.ascontiguousarray(np.asarray(points, float).reshape(-1, 3).T)
        values = self._function(inputs)
        return values[:3].T, np.moveaxis(values[SYMMETRIC], -1, 0)
