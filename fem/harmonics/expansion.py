"""Quadrature of polynomials over bodies, exact up to a degree."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.common import MU_0, Array, frozen_array
from ...geometry.magnets import Magnet
from ...geometry.meshes.solids import part_rule
from ...geometry.shapes import Box, Ring, Sphere
from ...geometry.solids import Part as SolidPart, Solid
from .expressions import FieldExpressions, Number, harmonic_sums
from .solid import (
    Coefficients,
    derivative,
    field_sizes,
    field_spectrum,
    irregular_gradient,
    irregular_values,
    outer_sums,
    real_terms,
    regular_derivative,
    rotated_harmonics,
    weighted_sums,
)


def polynomial_rule(body: Solid, degree: int) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ that integrate polynomials up to `degree` over a body.

    To round-off, but for a part: as well as curved elements fill it, 1e-8.
    """
    if isinstance(body, SolidPart):
        return part_rule(body, degree)
    if isinstance(body, Box):
        return box_rule(body, (degree // 2 + 1,) * 3)
    if isinstance(body, Sphere):
        local, weights = _sphere_rule(body.radius, degree)
    else:
        inner = body.inner_radius if isinstance(body, Ring) else 0.0
        local, weights = _ring_rule(inner, body.radius, body.height / 2, degree)
    return body.center + local @ body.rotation.T, weights


def box_rule(box: Box, counts: tuple[int, int, int]) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ of Gauss's rule in a box, with so many points along each edge."""
    nodes, weights = zip(*(np.polynomial.legendre.leggauss(n) for n in counts), strict=True)
    grid = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    volumes = np.prod(box.half_edges) * np.einsum("i,j,k->ijk", *weights).ravel()
    return box.center + (box.half_edges * grid) @ box.rotation.T, volumes


def _circle(count: int) -> Array:
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _ring_rule(inner: float, outer: float, half: float, degree: int) -> tuple[Array, Array]:
    """Even powers of the distance from the axis are polynomials of its square."""
    t, weight = np.polynomial.legendre.leggauss(degree // 2 + 1)
    square = inner**2 + (t + 1) / 2 * (outer**2 - inner**2)
    circle = _circle(degree + 1)
    shape = (len(t), len(t), len(circle))
    across = np.sqrt(square)[:, None, None, None] * circle[None, None]
    across = np.broadcast_to(across, (*shape, 2))
    height = np.broadcast_to((half * t)[None, :, None, None], (*shape, 1))
    points = np.concatenate([across, height], axis=-1).reshape(-1, 3)
    ring = weight * (outer**2 - inner**2) / 4 * (2 * np.pi / len(circle))
    return points, np.repeat(np.outer(ring, half * weight).ravel(), len(circle))


def _sphere_rule(radius: float, degree: int) -> tuple[Array, Array]:
    t, weight = np.polynomial.legendre.leggauss(degree // 2 + 2)
    circle = _circle(degree + 1)
    shape = (len(t), len(t), len(circle))
    distance, cosine = radius * (t + 1) / 2, t
    across = (distance[:, None] * np.sqrt(1 - cosine**2))[:, :, None, None] * circle
    height = np.broadcast_to(np.outer(distance, cosine)[:, :, None, None], (*shape, 1))
    points = np.concatenate([across, height], axis=-1).reshape(-1, 3)
    shell = weight * radius / 2 * distance**2 * (2 * np.pi / len(circle))
    return points, np.repeat(np.outer(shell, weight).ravel(), len(circle))


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

    center: Array = field(metadata={"units": "m"})
    radius: float = field(metadata={"units": "m"})
    coefficients: Coefficients = field(metadata={"units": "T"})
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


Part = tuple[int, int, int, complex]
"""Number of the expansion, l, m, and the real or imaginary part of the coefficient."""
MOST = 300
"""Coefficients up to which a fit is worth its time."""
ROUNDS = 6
"""Of reweighting in a fit."""


def trimmed_expansions(
    expansions: Sequence[MultipoleExpansion], points: Array, allowed: Array
) -> tuple[list[MultipoleExpansion], list[MultipoleExpansion]]:
    """The coefficients that matter, and what they leave out: at most `allowed` (n,) T at points (n, 3) m.

    The smallest ones are left out first. Those that stay are fitted to the whole field (weighted least squares), and
    stand in for what is missing: little more than half as many do then. Dipole moments stay as they are.  Coefficients
    are those along each expansion's own axes, where its expressions are written.
    """
    parts = [
        (k, int(l), int(m), part)
        for k, expansion in enumerate(expansions)
        for own in (expansion.own_coefficients,)
        for l, m in zip(*np.nonzero(own), strict=True)
        for part in (own[l, m].real, 1j * own[l, m].imag)
        if part
    ]
    if not parts:
        return list(expansions), [_with(e, [], 0) for e in expansions]
    fields = np.concatenate([_fields(e, [p for p in parts if p[0] == k], points) for k, e in enumerate(expansions)])
    fields /= allowed[:, None]
    dipoles = [part for part in parts if part[1] == 1]
    if _largest(fields.sum(axis=0)) <= 1:
        dipoles = []
    order = [i for i in np.argsort(-np.linalg.norm(fields, axis=2).max(axis=1)) if parts[i] not in dipoles]
    factors = _fewest(fields[order])
    kept = [(k, l, m, c * f) for (k, l, m, c), f in zip((parts[i] for i in order), factors, strict=False)]
    kept += dipoles
    missing = [(k, l, m, -c) for k, l, m, c in kept] + parts
    return (
        [_with(e, kept, k) for k, e in enumerate(expansions)],
        [_with(e, missing, k) for k, e in enumerate(expansions)],
    )


def _fewest(fields: Array) -> Array:
    """Factors of the first few of the fields (k, n, 3), with which they make the sum of all to 1 at every point."""
    total = fields.sum(axis=0)
    too_few, enough, left_out = 0, 0, total.copy()
    while enough < len(fields) and _largest(left_out) > 1:
        left_out -= fields[enough]
        enough += 1
    if not enough:
        return np.zeros(0)
    factors = np.ones(enough)
    if enough > MOST:
        return factors
    while enough - too_few > 1:
        count = (enough + too_few) // 2
        found = _fitted(fields[:count], total)
        if found is None:
            too_few = count
        else:
            factors, enough = found, count
    return factors


def _fitted(fields: Array, total: Array) -> Array | None:
    """Factors (k,) with which the fields make the total to 1 at every point; None if none were found."""
    columns, weights = fields.reshape(len(fields), -1), np.ones(len(total))
    scale = 1 / np.sqrt(np.einsum("kn,kn->k", columns, columns))
    for _ in range(ROUNDS):
        weighted = columns * np.repeat(weights, 3) * scale[:, None]
        factors = scale * _solved(weighted, total.ravel() * np.repeat(weights, 3))
        error = np.linalg.norm(total - (factors @ columns).reshape(total.shape), axis=1)
        if error.max() <= 1:
            return np.asarray(factors)
        weights *= np.sqrt(0.3 + error / error.max())  # towards equal largest errors
        weights /= weights.mean()
    return None


def _solved(rows: Array, right: Array) -> Array:
    """Least squares (k,) by normal equations, which suffice for rows (k, n) of like size: the error is looked at."""
    return np.asarray(np.linalg.lstsq(rows @ rows.T, rows @ right, rcond=None)[0])


def _largest(field: Array) -> float:
    """The largest size of vectors (n, 3)."""
    return float(np.sqrt(np.einsum("ni,ni->n", field, field).max(initial=0.0)))


def _fields(expansion: MultipoleExpansion, parts: list[Part], points: Array) -> Array:
    """B (parts, n, 3) of every single part, which is along the expansion's own axes."""
    if not parts:
        return np.zeros((0, len(points), 3))
    places = (points - expansion.center) @ expansion.axes / expansion.radius
    harmonics = irregular_values(expansion.degree + 1, places)
    fields = []
    for _, l, m, value in parts:
        gradient = irregular_gradient(harmonics, l, m)
        fields.append([-(1 if m == 0 else 2) * np.real(value * component) for component in gradient])
    return np.moveaxis(np.array(fields), 1, 2) @ expansion.axes.T


def _with(expansion: MultipoleExpansion, parts: list[Part], number: int) -> MultipoleExpansion:
    """The expansion with only the given parts among those of its number, along its own axes; as long as they need."""
    mine = [part for part in parts if part[0] == number]
    degree = max((l for _, l, _, _ in mine), default=0)
    coefficients = np.zeros((degree + 1, degree + 1), complex)
    for _, l, m, value in mine:
        coefficients[l, m] += value
    return replace(expansion, coefficients=rotated_harmonics(coefficients, expansion.axes))
