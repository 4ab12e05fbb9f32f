"""The field of a multipole expansion about one centre."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.basics import MU_0, Array, Sphere, frozen_array
from ...geometry.bodies import Magnet
from .body_rules import polynomial_rule
from .compiled import FieldExpressions, Number
from .expressions import harmonic_sums
from .solid import (
    Coefficients,
    derivative,
    field_sizes,
    field_spectrum,
    outer_sums,
    real_terms,
    regular_derivative,
    weighted_sums,
)
from .turning import rotated_harmonics

FOUR_PI = 4 * np.pi
TURNED = 1e-14
"""Of the largest term: what turning there and back leaves at most."""
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))
"""Entries of the gradient that determine the rest: it is symmetric and traceless."""


@dataclass(frozen=True, eq=False)
class MultipoleExpansion:
    """B = -∇̃ Σ c_lm Θ_lm(r̃), with r̃ = (r - center)/radius and ∇̃ its derivative.

    Parameters
    ----------
    center : (3,) m, rotor's frame
    radius : radius of a sphere about the centre that holds all sources, m; the series converges outside it
    coefficients : c_lm (T), complex (L+1, L+1), m ≥ 0, along the rotor's axes
    axes : (3, 3) along whose columns its expressions are written, because fewer terms are left there
    """

    center: Array
    radius: float
    coefficients: Coefficients
    axes: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen_array(self.center, (3,)))
        object.__setattr__(self, "axes", frozen_array(self.axes, (3, 3)))

    @property
    def degree(self) -> int:
        """Highest degree L."""
        return len(self.coefficients) - 1

    @cached_property
    def nearest(self) -> float:
        """Distance from the centre beyond which the series converges, m; a lone dipole or nothing is no series."""
        return self.radius if self.degree > 1 and self.coefficients.any() else 0.0

    @property
    def moment(self) -> Array:
        """(3,) dipole moment, A m²."""
        if self.degree < 1:
            return np.zeros(3)
        c = self.coefficients[1]
        return FOUR_PI * self.radius**3 / MU_0 * np.array([-2 * c[1].real, 2 * c[1].imag, c[0].real])

    @cached_property
    def own_coefficients(self) -> Coefficients:
        """c_lm (T) along its own axes."""
        turned = rotated_harmonics(self.coefficients, self.axes.T)
        return turned if turned is self.coefficients else without_noise(turned, TURNED)

    @cached_property
    def components(self) -> tuple[list[dict[Any, float]], list[list[dict[Any, float]]]]:
        """Real-harmonic weights of B_i and of ∂B_i/∂x̃_j."""
        potentials = [-derivative(self.coefficients, i) for i in range(3)]
        gradients = [[real_terms(derivative(p, j)) for j in range(3)] for p in potentials]
        return [real_terms(p) for p in potentials], gradients

    def expressions(self, position: Sequence[hy.expression], number: Number = float) -> FieldExpressions:
        """B (T) and ∂B_i/∂x_j (T/m) at a position (three expressions, m, rotor's frame)."""
        place = [position[i] - number(self.center[i]) for i in range(3)]
        if not np.array_equal(self.axes, np.eye(3)):
            return self._along_axes(place, number)
        scaled = [component * number(1.0 / self.radius) for component in place]
        fields, gradients = self.components
        slopes = [{k: w / self.radius for k, w in gradients[i][j].items()} for i, j in UPPER]
        sums = harmonic_sums(scaled, [*fields, *slopes], number)
        upper = dict(zip(UPPER, sums[3:], strict=True))
        upper[2, 2] = -upper[0, 0] - upper[1, 1]
        return sums[:3], [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]

    def _along_axes(self, place: list[hy.expression], number: Number) -> FieldExpressions:
        """Expressions along other axes, turned back."""
        own = MultipoleExpansion(np.zeros(3), self.radius, self.own_coefficients)
        return turned_field(self.axes, own.expressions(turned_expressions(self.axes.T, place, number), number), number)

    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m, without compilation."""
        sums = outer_sums(self._derivatives, (points - self.center) / self.radius)
        return sums[:, :3], sums[:, [[3, 4, 5], [4, 6, 7], [5, 7, 8]]]

    @cached_property
    def _derivatives(self) -> list[Coefficients]:
        """Of B_i, and of the upper ∂B_i/∂x_j; of one size."""
        fields = [-derivative(self.coefficients, axis) for axis in range(3)]
        slopes = [derivative(fields[i], j) / self.radius for i in range(3) for j in range(i, 3)]
        return [*(np.pad(field, (0, 1)) for field in fields), *slopes]

    def root_mean_square(self, points: Array) -> tuple[Array, Array]:
        """Sizes (n,) of B (T) and of its gradient (T/m), as a mean over the spheres on which the points lie.

        A degree-l part falls as (radius/r)^(l+2), and its gradient is √((l+2)(2l+3)) / r times as large.
        """
        degree = np.arange(self.degree + 1)
        distance = np.linalg.norm(points - self.center, axis=1)[:, None]
        parts = field_spectrum(self.coefficients) * (self.radius / distance) ** (degree + 2)
        slopes = parts * np.sqrt((degree + 2) * (2 * degree + 3)) / distance
        return np.linalg.norm(parts, axis=1), np.linalg.norm(slopes, axis=1)


def turned_expressions(axes: Array, vector: Sequence[hy.expression], number: Number) -> list[hy.expression]:
    """A vector along the columns of `axes`, along the outer ones."""
    return [hy.sum([number(factor) * part for factor, part in zip(row, vector, strict=True) if factor]) for row in axes]


def turned_field(axes: Array, field: FieldExpressions, number: Number) -> FieldExpressions:
    """A field and its gradient along the columns of `axes`, along the outer ones."""
    b, slope = field
    rows = [turned_expressions(axes, row, number) for row in slope]
    columns = [turned_expressions(axes, [row[j] for row in rows], number) for j in range(3)]
    return turned_expressions(axes, b, number), [[columns[j][i] for j in range(3)] for i in range(3)]


def moments_of_magnetization(
    points: Array, weights: Array, magnetization: Array, center: Array, radius: float, degree: int
) -> Coefficients:
    """Expansion coefficients (T) of a magnetisation given at quadrature points: exact volume functionals.

    q_lm = ∫ M · ∇ conj Υ_lm dV, with `points` (n, 3) m, `weights` (n,) m³ and `magnetization` (n, 3) μ0 M in T.
    """
    weighted = (weights / (FOUR_PI * radius**3))[:, None] * magnetization
    potentials = weighted_sums(degree, (points - center) / radius, weighted)
    return np.asarray(sum(np.conj(regular_derivative(p, axis)) for axis, p in enumerate(potentials)))


def curvature_moments(
    points: Array, weights: Array, matrix: Array, center: Array, radius: float, degree: int
) -> Coefficients:
    """Coefficients (T) ∫ w Σ A_ij ∂_ij conj Υ_lm, with `weights` (n,) w in T m⁴ and `matrix` (3, 3) A, symmetric."""
    (sums,) = weighted_sums(degree, (points - center) / radius, weights[:, None] / (FOUR_PI * radius**4))
    second = [[regular_derivative(regular_derivative(sums, i), j) for j in range(3)] for i in range(3)]
    return np.asarray(sum(np.conj(matrix[i, j] * second[i][j]) for i in range(3) for j in range(3)))


def uniform_moments(magnet: Magnet, degree: int) -> MultipoleExpansion:
    """Moments up to `degree` of a magnet with exactly its remanent polarisation (μr = 1); degree 1 is the dipole.

    The quadrature of the polynomial ∇Υ_lm is exact, so that the coefficients are good to round-off.  A sphere has none
    but its dipole.
    """
    body = magnet.body
    degree = min(degree, 1) if isinstance(body, Sphere) else degree
    center, radius = body.center, body.circumradius
    points, volume = polynomial_rule(body, degree)
    (sums,) = weighted_sums(degree, (points - center) / radius, volume[:, None] / (FOUR_PI * radius**3))
    parts = [along * regular_derivative(sums, axis) for axis, along in enumerate(magnet.polarization_in_rotor)]
    return MultipoleExpansion(center, radius, without_noise(np.conj(np.sum(parts, axis=0)), 1e-15))


def without_noise(coefficients: Coefficients, level: float) -> Coefficients:
    """The coefficients without those whose field at the reference sphere is below `level` of the largest one's.

    What symmetry forbids comes out as round-off; left out, it costs nothing to evaluate.
    """
    field = np.abs(coefficients) * field_sizes(len(coefficients) - 1)
    return np.where(field > level * field.max(initial=0.0), coefficients, 0.0)
