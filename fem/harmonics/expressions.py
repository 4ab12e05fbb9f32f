"""Sums over irregular solid harmonics as few expressions.

With x' = x/r² and so on, Θ_lm = (-1)^m (2l-1)!! S_m Q_lm, S_m = (x' + i y')^m / r, and the real

    Q_mm = 1,    Q_lm = z' Q_(l-1)m - ((l-1)² - m²)/((2l-1)(2l-3)) r⁻² Q_(l-2)m.

Each sum is taken over l first, at fixed m, and then over m: real and imaginary parts share the Q.  In Taylor's method
every operation costs, so that this saves time as well as compilation.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import Array
from ..compiled_code import compiled
from .solid import Coefficients

Terms = Mapping[Any, float]
"""Weights of real harmonics: keys (l, m, "re") and (l, m, "im")."""


def harmonic_sums(
    position: Sequence[hy.expression], sums: Sequence[Terms], number: Callable[[Any], Any] = lambda weight: weight
) -> list[hy.expression]:
    """Σ weight Re Θ_lm or Im Θ_lm at a position (three expressions), one expression for each of `sums`.

    The weights are written as `number` has them.
    """
    x, y, z = position
    inverse = 1.0 / (x * x + y * y + z * z)
    highest: dict[int, int] = {}
    for terms in sums:
        for l, m, _ in terms:
            highest[m] = max(highest.get(m, m), l)
    sectoral = _sectoral(x * inverse, y * inverse, inverse, max(highest, default=0))
    chains = {m: _chain(z * inverse, inverse, m, l) for m, l in highest.items()}
    return [_summed(terms, sectoral, chains, number) for terms in sums]


def _sectoral(x: hy.expression, y: hy.expression, inverse: hy.expression, highest: int) -> list[dict[str, Any]]:
    """Real and imaginary parts of S_m up to an order."""
    found = [{"re": hy.sqrt(inverse), "im": hy.expression(0.0)}]
    for _ in range(highest):
        re, im = found[-1]["re"], found[-1]["im"]
        found.append({"re": x * re - y * im, "im": x * im + y * re})
    return found


def _chain(z: hy.expression, inverse: hy.expression, m: int, highest: int) -> dict[int, hy.expression]:
    """Q_lm of one m, by l."""
    found = {m: hy.expression(1.0)}
    for l in range(m + 1, highest + 1):
        found[l] = z * found[l - 1]
        if l - 2 >= m:
            factor = ((l - 1) ** 2 - m * m) / ((2 * l - 1) * (2 * l - 3))
            found[l] = found[l] - factor * (inverse * found[l - 2])
    return found


def _summed(
    terms: Terms, sectoral: list[dict[str, Any]], chains: dict[int, dict[int, Any]], number: Callable[[Any], Any]
) -> hy.expression:
    parts: dict[tuple[int, str], list[tuple[Any, hy.expression]]] = {}
    for (l, m, part), weight in terms.items():
        factor = (-1.0) ** m * weight
        for j in range(1, l + 1):
            factor *= 2 * j - 1
        parts.setdefault((m, part), []).append((number(factor), chains[m][l]))
    found = [_product(sectoral[m][part], inner) for (m, part), inner in parts.items()]
    return hy.sum(found) if found else hy.expression(0.0)


def _product(sectoral: hy.expression, inner: Sequence[tuple[Any, hy.expression]]) -> hy.expression:
    """S_m Σ factor Q_lm; a single harmonic is made before its factor, so that all sums share it."""
    if len(inner) == 1:
        return inner[0][0] * (sectoral * inner[0][1])
    return sectoral * hy.sum([factor * chain for factor, chain in inner])


def members(degree: int) -> list[tuple[int, int, int]]:
    """(l, m, 0 for the real and 1 for the imaginary part) of all harmonics up to a degree, the lowest degrees first."""
    return [(l, m, part) for l in range(degree + 1) for m in range(l + 1) for part in (0, 1)[: 1 + (m > 0)]]


def regular_harmonics(degree: int, position: Sequence[hy.expression], square: hy.expression) -> list[hy.expression]:
    """S_m Q_lm at a position (three expressions), in the order of `members`; `square` is r²."""
    x, y, z = position
    sectoral = [(hy.expression(1.0), hy.expression(0.0)), (x, y)]
    while len(sectoral) <= degree:
        re, im = sectoral[-1]
        sectoral.append((x * re - y * im, x * im + y * re))
    zonal: dict[tuple[int, int], hy.expression] = {}
    for m in range(degree + 1):
        zonal[m, m] = hy.expression(1.0)
        for l in range(m + 1, degree + 1):
            zonal[l, m] = z * zonal[l - 1, m]
            if l - 2 >= m:
                factor = ((l - 1) ** 2 - m * m) / ((2 * l - 1) * (2 * l - 3))
                zonal[l, m] = zonal[l, m] - factor * (square * zonal[l - 2, m])
    return [sectoral[m][part] * zonal[l, m] for l, m, part in members(degree)]


def weighted(first: int, harmonics: Sequence[hy.expression]) -> hy.expression:
    """Σ weight · harmonic, the weights being runtime parameters from number `first` on; the first harmonic is 1."""
    return hy.sum([hy.par[first], *(hy.par[first + k] * h for k, h in enumerate(harmonics) if k)])


def real_weights(coefficients: Coefficients) -> Array:
    """Weights in the order of `members` of Σ conj a_lm Υ_lm over positive and negative m."""
    degree = len(coefficients) - 1
    scaled = coefficients * _sizes(degree) * np.where(np.arange(degree + 1), 2.0, 1.0)
    return np.array([(scaled[l, m].imag if part else scaled[l, m].real) for l, m, part in members(degree)])


def real_sizes(degree: int) -> Array:
    """Re Υ_lm and Im Υ_lm by the members that `regular_harmonics` gives, in their order."""
    sizes = _sizes(degree)
    return np.array([sizes[l, m] for l, m, _ in members(degree)])


def _sizes(degree: int) -> Array:
    """[l, m]: Υ_lm by S_m Q_lm."""
    sizes = np.zeros((degree + 1, degree + 1))
    for m in range(degree + 1):
        sizes[m, m] = 1.0 if m == 0 else -sizes[m - 1, m - 1] / (2 * m)
        for l in range(m + 1, degree + 1):
            sizes[l, m] = sizes[l - 1, m] * (2 * l - 1) / ((l + m) * (l - m))
    return sizes


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
