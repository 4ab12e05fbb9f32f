"""Sums over irregular solid harmonics as few expressions.

With x' = x/r² and so on, Θ_lm = (-1)^m (2l-1)!! S_m Q_lm, S_m = (x' + i y')^m / r, and the real

    Q_mm = 1,    Q_lm = z' Q_(l-1)m - ((l-1)² - m²)/((2l-1)(2l-3)) r⁻² Q_(l-2)m.

Each sum is taken over l first, at fixed m, and then over m: real and imaginary parts share the Q.  In Taylor's method
every operation costs, so that this saves time as well as compilation.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import Array
from ..compiled_code import compiled
from .solid import Entry, Member, entries, members, tensors

Terms = Mapping[Member, float]  # weights of real harmonics, by `members`


Vector = Sequence[hy.expression]  # mostly of three
# B_i (T) and ∂B_i/∂x_j (T/m), the latter symmetric
FieldExpressions = tuple[list[hy.expression], list[list[hy.expression]]]

# Entries of the gradient that determine the rest: it is symmetric and traceless
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))


def weighted(weights: Array, terms: Vector) -> hy.expression:
    """Σ weight · term, where weights of zero cost nothing."""
    return hy.sum([float(w) * t for w, t in zip(weights, terms, strict=True) if w])


def turned_expressions(axes: Array, vector: Vector) -> list[hy.expression]:
    """A `vector` along the columns of `axes`, along the outer ones."""
    exact = np.where(np.abs(axes) < 1e-15, 0.0, axes)  # a quarter turn leaves 6e-17, which would cost operations
    return [weighted(row, vector) for row in exact]


def whole_gradient(entries: Vector) -> list[list[hy.expression]]:
    """Symmetric traceless gradient (3 × 3) from its entries in `UPPER`."""
    upper = dict(zip(UPPER, entries, strict=True))
    upper[2, 2] = -upper[0, 0] - upper[1, 1]
    return [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]


def harmonic_sums(position: Vector, sums: Sequence[Terms], monic: bool = False) -> list[hy.expression]:
    """Σ weight Re Θ_lm or Im Θ_lm, one expression for each of `sums`, at a `position` in the harmonics' units.

    `monic`: harmonics without their factors (-1)^m (2l-1)!!, each with the weight 1.
    """
    x, y, z = position
    inverse = 1.0 / (x * x + y * y + z * z)
    highest: dict[int, int] = {}
    for terms in sums:
        for l, m, _ in terms:
            highest[m] = max(highest.get(m, m), l)
    right, up = x * inverse, y * inverse
    sectoral = [(hy.sqrt(inverse), hy.expression(0.0))]  # real and imaginary parts of S_m
    for _ in range(max(highest, default=0)):
        re, im = sectoral[-1]
        sectoral.append((right * re - up * im, right * im + up * re))
    chains = _zonal(z * inverse, inverse, highest)
    found = []
    for terms in sums:
        parts: dict[tuple[int, int], list[tuple[Any, hy.expression]]] = {}
        for (l, m, part), weight in terms.items():
            factor = 1.0 if monic else (-1.0) ** m * weight
            for j in range(1, 0 if monic else l + 1):  # (2l-1)!!
                factor *= 2 * j - 1
            parts.setdefault((m, part), []).append((factor, chains[l, m]))
        products = []
        for (m, part), inner in parts.items():
            first = sectoral[m][part]
            if len(inner) == 1:  # a single harmonic is made before its factor, so that all sums share it
                products.append(inner[0][0] * (first * inner[0][1]))
            else:
                products.append(first * hy.sum([factor * chain for factor, chain in inner]))
        found.append(hy.sum(products) if products else hy.expression(0.0))
    return found


def regular_harmonics(degree: int, position: Vector) -> list[hy.expression]:
    """S_m Q_lm with r² for r⁻², regular at the origin, at a position (three expressions); in the order of `members`."""
    x, y, z = position
    powers = _powers_across(x, y, degree)
    zonal = _zonal(z, hy.sum([t * t for t in position]), dict.fromkeys(range(degree + 1), degree))
    return [powers[m][part] * zonal[l, m] for l, m, part in members(degree)]


def _powers_across(x: hy.expression, y: hy.expression, highest: int) -> list[tuple[hy.expression, hy.expression]]:
    """Real and imaginary parts of (x + iy)^m up to an order, by two or three products each."""
    xx, yy = x * x, y * y
    found = [(hy.expression(1.0), hy.expression(0.0)), (x, y), (xx - yy, 2.0 * (x * y))]
    found.append((x * (xx - 3.0 * yy), y * (3.0 * xx - yy)))
    for m in range(4, highest + 1):
        re, im = found[m // 2 if m % 2 == 0 else m - 1]
        if m % 2 == 0:
            found.append(((re - im) * (re + im), 2.0 * (re * im)))
        else:
            first, second = x * re, y * im
            found.append((first - second, (x + y) * (re + im) - (first + second)))
    return found


def _zonal(z: hy.expression, square: hy.expression, highest: dict[int, int]) -> dict[tuple[int, int], hy.expression]:
    """Q_lm of each m up to its highest l; short ones as products of factors, which takes fewer than the recurrence."""
    found: dict[tuple[int, int], hy.expression] = {}
    even = z * z, square
    odd = z * even[0], z * square
    for m, last in highest.items():
        for l in range(m, last + 1):
            if l - m < 2:
                found[l, m] = z if l > m else hy.expression(1.0)
            elif l - m < 6:
                first, *others = np.roots(_leading(l, m)).tolist()
                whole, part = odd if (l - m) % 2 else even
                found[l, m] = whole - first * part
                for root in others:
                    found[l, m] = found[l, m] * (even[0] - root * square)
            else:
                found[l, m] = z * found[l - 1, m] - _factor(l, m) * (square * found[l - 2, m])
    return found


def _factor(l: int, m: int) -> float:
    """Of Q_(l-2)m in the recurrence of Q_lm."""
    return ((l - 1) ** 2 - m * m) / ((2 * l - 1) * (2 * l - 3))


@cache
def _leading(l: int, m: int) -> Array:
    """Coefficients of Q_lm by powers of z², the highest first, r = 1, without a factor of z where l - m is odd."""
    if l - m < 2:
        return np.ones(1)
    above = np.append(_leading(l - 1, m), [0.0] * ((l - m) % 2 == 0))
    return np.polysub(above, _factor(l, m) * _leading(l - 2, m))


class CompiledField:
    """B and its derivatives at points by what `build` makes of a position, compiled when they are first asked for.

    Sums may be contracted and reordered, which moves closed forms by their own round-off, 5e-14 of B.
    """

    def __init__(self, build: Callable[[Vector], FieldExpressions]) -> None:
        self._build, self._known = build, dict[int, Any]()

    def __call__(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) in T and ∂B_i/∂x_j (n, 3, 3) in T/m at `points` (n, 3), m."""
        field, gradient = tensors(self.derivatives(np.asarray(points, float).reshape(-1, 3), 2))
        return field, gradient

    def derivatives(self, points: Array, order: int) -> Array:
        """B and its derivatives up to `order` - 1, by their `entries` (n, order (order + 2)), at `points` (n, 3) m."""
        if order not in self._known:
            variables = hy.make_vars("x", "y", "z")
            field, gradient = self._build(variables)
            known = {each: gradient[each[0]][each[1]] for each in entries(2)}
            rest = differentiated(known, variables, order)
            self._known[order] = compiled(hy.cfunc, [*field, *known.values(), *rest], variables, fast_math=True)
        return np.asarray(self._known[order](np.ascontiguousarray(points.T))).T


def differentiated(known: Mapping[Entry, hy.expression], variables: Vector, last: int) -> list[hy.expression]:
    """Derivatives by `variables` x, y, z, by `entries`, from those `known` of one degree to the `last`."""
    found: list[hy.expression] = []
    for degree in range(len(next(iter(known))) + 1, last + 1):
        slopes = hy.diff_tensors(list(known.values()), diff_args=list(variables), diff_order=1).jacobian
        rows = dict(zip(known, np.asarray(slopes).reshape(-1, 3), strict=True))
        known = {each: rows[each[:-1]][each[-1]] for each in entries(degree)}
        found += known.values()
    return found
