"""Field expressions compiled to machine code, evaluated at many points in one call."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ..storage import compiled

Number = Callable[[float], Any]
"""What a number of a formula is written as: `float`, or `RuntimeNumbers`."""
FieldExpressions = tuple[list[hy.expression], list[list[hy.expression]]]
"""B_i (T) and ∂B_i/∂x_j (T/m), the latter symmetric."""


FEW = 5000
"""Points of a call for which code is good enough that is compiled in a fourth of the time and evaluated in ten times.

A call of so many takes four milliseconds more. The call alone decides, so that the same one gives the same bits.
"""


class CompiledField:
    """B and its gradient at points, compiled when it is first asked for: for few points, for many, or both.

    The compiler may contract and reorder sums, which makes long expansions twice as fast and moves closed forms by no
    more than their own round-off, 5e-14 of B. An integrator compiles the same expressions without that.

    Parameters
    ----------
    build : takes three heyoka expressions (position, m) and returns `FieldExpressions`
    seldom : at fewer than some 1e5 points in all: as if they were few
    """

    def __init__(self, build: Callable[[Sequence[hy.expression]], FieldExpressions], seldom: bool = False) -> None:
        variables = hy.make_vars("x", "y", "z")
        field, gradient = build(variables)
        symmetric = [gradient[min(i, j)][max(i, j)] for i in range(3) for j in range(3)]
        self._formula = [*field, *symmetric], variables
        self._seldom = seldom

    @cached_property
    def _for_few(self) -> Any:
        return compiled(hy.cfunc, *self._formula, fast_math=True, opt_level=0, batch_size=1)

    @cached_property
    def _for_many(self) -> Any:
        return compiled(hy.cfunc, *self._formula, fast_math=True)

    def rows(self, columns: Array) -> Array:
        """The three components of B (T) and the nine of its gradient (T/m): (12, n) at `columns` (3, n), m."""
        function = self._for_few if self._seldom or columns.shape[1] <= FEW else self._for_many
        return np.asarray(function(columns))

    def __call__(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) in T and ∂B_i/∂x_j (n, 3, 3) in T/m at `points` (n, 3), m."""
        return field_and_gradient(self.rows(as_columns(points)))


def as_columns(points: ArrayLike) -> Array:
    """Points (n, 3) as contiguous (3, n)."""
    return np.ascontiguousarray(np.asarray(points, float).reshape(-1, 3).T)


def field_and_gradient(rows: Array) -> tuple[Array, Array]:
    """B (n, 3) and its gradient (n, 3, 3) as views of (12, n)."""
    return rows[:3].T, np.moveaxis(rows[3:].reshape(3, 3, -1), -1, 0)
