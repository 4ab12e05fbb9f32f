"""Sums over regular solid harmonics as few expressions, with weights that are runtime parameters.

Up to a factor Re Υ_lm and Im Υ_lm are the real and imaginary part of S_m Q_lm, with S_m = (x + iy)^m and

    Q_mm = 1,    Q_lm = z Q_(l-1)m - ((l-1)² - m²)/((2l-1)(2l-3)) r² Q_(l-2)m.

As the weights are no part of the compiled code, one code serves all fields everywhere.
"""

from collections.abc import Sequence

import heyoka as hy
import numpy as np

from ...geometry.basics import Array
from .solid import Coefficients


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
