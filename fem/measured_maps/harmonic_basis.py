"""Fields of single solid harmonics at many points: the columns of a least-squares fit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ..harmonics import (
    Coefficients,
    field_sizes,
    irregular_gradient,
    irregular_values,
    regular_gradient,
    regular_values,
)


@dataclass(frozen=True, eq=False)
class HarmonicBasis:
    """Fields -∇Θ_lm about centres (sources inside the map) and -∇Υ_lm (sources around it, the background).

    The root mean square of a column on its sphere is 3/(2l+1), that of a background's 1. Unknowns (T) are fields there
    then, and of a like size for every degree: in a magnet with corners each part of degree l falls as l^-3/2.
    Order: the background, then degree by degree all centres; the first `count(L)` columns are the basis of degree L.

    Parameters
    ----------
    centers, radii : (k, 3) and (k,) m, spheres that hold the sources
    degree : highest degree about the centres
    background_degree : highest degree of the background: 0 none, 1 uniform, 2 with uniform gradients
    extent : radius of the background's sphere about the first centre, m
    """

    centers: Array
    radii: Array
    degree: int
    background_degree: int = 0
    extent: float = 1.0

    @property
    def background_count(self) -> int:
        """Unknowns of the background."""
        return (self.background_degree + 1) ** 2 - 1

    def count(self, degree: int) -> int:
        """Unknowns of the background and of all harmonics up to `degree`."""
        return self.background_count + len(self.centers) * ((degree + 1) ** 2 - 1)

    def columns(self, points: Array) -> Array:
        """Fields (unknowns, 3, n) at points (n, 3) m."""
        result = np.empty((self.count(self.degree), 3, len(points)))
        scaled = ((points - self.centers[0]) / self.extent).T
        harmonics = regular_values(self.background_degree, *scaled)
        sizes = regular_field_sizes(self.background_degree)
        for row, l, m in _terms(0, self.background_degree, 1):
            _fill(result, row, m, regular_gradient(harmonics, l, m), sizes[l, m])
        sizes = _sizes(self.degree)
        for k, (center, radius) in enumerate(zip(self.centers, self.radii, strict=True)):
            harmonics = irregular_values(self.degree + 1, (points - center) / radius)
            for row, l, m in _terms(self.background_count, self.degree, len(self.centers), k):
                _fill(result, row, m, irregular_gradient(harmonics, l, m), sizes[l, m])
        return result

    def coefficients(self, unknowns: Array, degree: int) -> list[Coefficients]:
        """Expansion coefficients c_lm (T) about each centre from the first `count(degree)` unknowns (T)."""
        sizes = _sizes(degree)
        found = []
        for k in range(len(self.centers)):
            c = np.zeros((degree + 1, degree + 1), complex)
            for row, l, m in _terms(self.background_count, degree, len(self.centers), k):
                c[l, m] = (unknowns[row] + (1j * unknowns[row + 1] if m else 0)) / sizes[l, m]
            found.append(c)
        return found

    def background_field(self, unknowns: Array) -> Array:
        """(3,) T: the background at the first centre; zero where none was fitted."""
        if not self.background_degree:
            return np.zeros(3)
        return np.asarray(unknowns[:3] @ self.columns(self.centers[:1] + self.extent)[:3, :, 0])


def _sizes(degree: int) -> Array:
    """Unknown that belongs to a coefficient c_lm of 1, [l, m]."""
    return field_sizes(degree) * ((2 * np.arange(degree + 1) + 1) / 3)[:, None]


def regular_field_sizes(degree: int) -> Array:
    """As `field_sizes`, for Υ_lm: the mean of |Υ_lm|² is 1/((l-m)!(l+m)!(2l+1)), that of |grad f|² l(2l+1) times f²."""
    l = np.arange(degree + 1.0)[:, None]
    with np.errstate(divide="ignore"):
        inverse = np.where(field_sizes(degree) > 0, 1 / field_sizes(degree), 0.0)
    return np.where(np.arange(degree + 1) == 0, 1.0, 2.0) * np.sqrt(l * (l + 1)) * inverse


def _terms(start: int, degree: int, centers: int, k: int = 0) -> Iterator[tuple[int, int, int]]:
    """Row of the first unknown, degree and order of each harmonic about centre number k."""
    for l in range(1, degree + 1):
        first = start + centers * (l * l - 1) + k * (2 * l + 1)
        for m in range(l + 1):
            yield first + max(2 * m - 1, 0), l, m


def _fill(result: Array, row: int, m: int, gradient: list[Array], size: float) -> None:
    """Field of Re c_lm, and for m > 0 of Im c_lm in the row after; the terms ±m are complex conjugates."""
    factor = -(2.0 if m else 1.0) / size
    for axis in range(3):
        result[row, axis] = factor * gradient[axis].real
        if m:
            result[row + 1, axis] = -factor * gradient[axis].imag
