"""Sums over irregular solid harmonics as few expressions.

With x' = x/r² and so on, Θ_lm = (-1)^m (2l-1)!! S_m Q_lm, S_m = (x' + i y')^m / r, and the real

    Q_mm = 1,    Q_lm = z' Q_(l-1)m - ((l-1)² - m²)/((2l-1)(2l-3)) r⁻² Q_(l-2)m.

Each sum is taken over l first, at fixed m, and then over m: real and imaginary parts share the Q.  In Taylor's method
every operation costs, so that this saves time as well as compilation.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import heyoka as hy

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
