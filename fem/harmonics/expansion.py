"""Multipole expansions of magnets' fields: their moments by quadrature, their fields, and the fewest that will do."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ...geometry.common import Array, freeze
from ...geometry.magnets import Magnet
from ...geometry.meshes.solids import part_rule
from ...geometry.shapes import Box, Cylinder, Sphere
from ...geometry.solids import Part, Solid
from . import solid
from .expressions import FieldExpressions, Vector, harmonic_sums, turned_expressions, whole_gradient
from .interior import Ball, moment
from .solid import FOUR_PI, Coefficients


def polynomial_rule(body: Solid, degree: int) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³, exact for polynomials up to `degree` in a body; of parts to 1e-8."""
    if isinstance(body, Part):
        return part_rule(body, degree)
    nodes = degree // 2 + 1
    if isinstance(body, Box):
        return box_rule(body, [gauss(-h, h, nodes) for h in body.half_edges])
    if isinstance(body, Sphere):
        return round_rule(body, gauss(0.0, body.radius, nodes + 1), gauss(-1.0, 1.0, nodes + 1), degree + 1)
    # even powers of the distance from the axis are polynomials of its square
    square, weights = gauss(body.inner_radius**2, body.radius**2, nodes)
    across = np.sqrt(square)
    half = body.height / 2
    return round_rule(body, (across, weights / (2 * across)), gauss(-half, half, nodes), degree + 1)


def gauss(first: float, last: float, count: int) -> tuple[Array, Array]:
    """Places and weights (`count`,) of Gauss's rule from `first` to `last`."""
    t, weights = solid.gauss_legendre(count)
    return (first + last) / 2 + (last - first) / 2 * t, (last - first) / 2 * weights


def box_rule(box: Box, rules: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ in a box of `rules` (places, weights; m) along each of its axes."""
    (x, wide), (y, deep), (z, tall) = rules
    grid = np.empty((len(x), len(y), len(z), 3))
    grid[..., 0], grid[..., 1], grid[..., 2] = x[:, None, None], y[:, None], z
    return box.center + grid.reshape(-1, 3) @ box.rotation.T, np.einsum("i,j,k->ijk", wide, deep, tall).ravel()


def round_rule(
    body: Cylinder | Sphere, radial: tuple[Array, Array], other: tuple[Array, Array], count: int
) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ in a body of revolution, `count` places around the axis of `body`.

    Of rules (places and weights) `radial`, of the distance (m) from the axis or from a sphere's centre, and `other`, of
    the height (m) or of the cosine of a sphere's polar angle.
    """
    (r, wide), (t, tall) = radial, other
    if isinstance(body, Sphere):
        sine = np.sqrt(1 - t**2)
        across, height = np.outer(r, sine).ravel(), np.outer(r, t).ravel()
        areas = np.outer(wide * r, tall / sine).ravel()
    else:
        across, height, areas = np.repeat(r, len(t)), np.tile(t, len(r)), np.outer(wide, tall).ravel()
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    circle = across[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    upright = np.broadcast_to(height[:, None, None], (len(height), count, 1))
    points = np.concatenate([circle, upright], axis=-1).reshape(-1, 3)
    return body.center + points @ body.rotation.T, np.repeat(areas * across * (2 * np.pi / count), count)


TURNED = 1e-14  # of the largest term: what turning there and back leaves at most


@dataclass(frozen=True, eq=False)
class MultipoleExpansion:
    """B = -∇̃ Σ c_lm Θ_lm(r̃), with r̃ = (r - center)/radius and ∇̃ its derivative."""

    center: Array = field(metadata={"units": "m"})  # (3,), rotor's frame
    radius: float = field(metadata={"units": "m"})  # of a sphere that holds all sources: the series converges outside
    coefficients: Coefficients = field(metadata={"units": "T"})  # (L+1, L+1), m ≥ 0, along the rotor's axes
    # (3, 3) along whose columns its expressions are written, because fewer terms are left there
    axes: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        freeze(self, center=(3,), axes=(3, 3))

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
        return moment(self.coefficients, Ball(self.center, self.radius)) if self.degree else np.zeros(3)

    @cached_property
    def own_coefficients(self) -> Coefficients:
        """c_lm (T) along its own axes."""
        turned = solid.rotated_harmonics(self.coefficients, self.axes.T)
        return turned if turned is self.coefficients else without_noise(turned, TURNED)

    def expressions(self, position: Vector) -> FieldExpressions:
        """B (T) and ∂B_i/∂x_j (T/m) at a position (three expressions, m, rotor's frame)."""
        place = [position[i] - float(self.center[i]) for i in range(3)]
        if not np.array_equal(self.axes, np.eye(3)):
            own = MultipoleExpansion(np.zeros(3), self.radius, self.own_coefficients)
            return turned_field(self.axes, own.expressions(turned_expressions(self.axes.T, place)))
        scaled = [component * (1.0 / self.radius) for component in place]
        parts = _slopes(self.coefficients, self.radius, 2)
        sums = harmonic_sums(scaled, [solid.real_terms(part) for part in parts])
        return sums[:3], whole_gradient(sums[3:])

    def derivatives(self, points: Array, order: int) -> Array:
        """B and its derivatives up to `order` - 1, by their `entries` (n, k), at `points` (n, 3) m anywhere."""
        return summed_derivatives([self], points, order)

    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m."""
        field, gradient = solid.tensors(self.derivatives(points, 2))
        return field, gradient

    def root_mean_square(self, points: Array) -> tuple[Array, Array]:
        """Sizes (n,) of B (T) and of its gradient (T/m): means over the spheres on which the points lie.

        Of degree l they fall as (radius/r)^(l+2), and the gradient is √((l+2)(2l+3)) / r times as large.
        """
        degree = np.arange(self.degree + 1)
        distance = np.linalg.norm(points - self.center, axis=1)[:, None]
        parts = solid.field_spectrum(self.coefficients) * (self.radius / distance) ** (degree + 2)
        slopes = parts * np.sqrt((degree + 2) * (2 * degree + 3)) / distance
        return np.linalg.norm(parts, axis=1), np.linalg.norm(slopes, axis=1)


def summed_derivatives(expansions: Sequence[MultipoleExpansion], points: Array, order: int) -> Array:
    """`derivatives` (n, k) of all `expansions` together at points (n, 3) m, or each at its own (expansions, n, 3)."""
    total = np.zeros((points.shape[-2], order * (order + 2)))
    for sums, centers, radii, numbers in _joined(tuple(expansions), order):
        places = points if points.ndim == 2 else points[numbers]
        total += sums.totals((places - centers[:, None]) / radii[:, None, None])
    return total


@lru_cache(maxsize=128)  # a table and each of its magnets are asked for by thousands of calls, of one point often
def _joined(
    expansions: tuple[MultipoleExpansion, ...], order: int
) -> list[tuple[solid.OuterSums, Array, Array, NDArray[np.intp]]]:
    """The sums of expansions of so many steps of degrees together, their centres (k, 3) m, radii (k,) m and numbers."""
    steps = np.array([-(-(one.degree + order) // solid.STEP) for one in expansions])
    found = []
    for count in np.unique(steps):
        numbers = np.flatnonzero(steps == count)
        some = [expansions[k] for k in numbers]
        size = max(one.degree for one in some) + 1
        whole = np.zeros((len(some), size, size), complex)
        for one, coefficients in zip(some, whole, strict=True):
            coefficients[: one.degree + 1, : one.degree + 1] = one.coefficients
        centers, radii = np.array([one.center for one in some]), np.array([one.radius for one in some])
        slopes = _slopes(whole, radii[:, None, None], order)
        found.append((solid.OuterSums.of(np.stack(slopes, axis=1)), centers, radii, numbers))
    return found


def _slopes(coefficients: Coefficients, radius: Array | float, order: int) -> list[Coefficients]:
    """Of c_lm (T) [..., l, m] and radii m, the coefficients of what `derivatives` gives, up to `order` degrees more."""
    found: dict[solid.Entry, Coefficients] = {(i,): -solid.derivative(coefficients, i) for i in range(3)}
    for degree in range(2, order + 1):
        for each in solid.entries(degree):
            found[each] = solid.derivative(found[each[:-1]], each[-1]) / radius
    size = coefficients.shape[-1] + order
    nothing = [(0, 0)] * (coefficients.ndim - 2)
    return [np.pad(part, [*nothing, *[(0, size - part.shape[-1])] * 2]) for part in found.values()]


def turned_field(axes: Array, field: FieldExpressions) -> FieldExpressions:
    """A `field` and its gradient along the columns of `axes`, along the outer ones."""
    b, slope = field
    rows = [turned_expressions(axes, row) for row in slope]
    columns = [turned_expressions(axes, [row[j] for row in rows]) for j in range(3)]
    return turned_expressions(axes, b), [[columns[j][i] for j in range(3)] for i in range(3)]


def moments_of_magnetization(
    points: Array, weights: Array, magnetization: Array, center: Array, radius: float, degree: int
) -> Coefficients:
    """Coefficients (T) ∫ M · ∇ conj Υ_lm dV up to a `degree`: exact functionals of the quadrature.

    At `points` (n, 3) m with `weights` (n,) m³, of `magnetization` μ0 M (n, 3) T; about a `center` with a `radius`, m.
    """
    weighted = (weights / (FOUR_PI * radius**3))[:, None] * magnetization
    potentials = solid.weighted_sums(degree, (points - center) / radius, weighted)
    return np.asarray(sum(np.conj(solid.regular_derivative(p, axis)) for axis, p in enumerate(potentials)))


def curvature_moments(
    points: Array, weights: Array, matrix: Array, center: Array, radius: float, degree: int
) -> Coefficients:
    """Coefficients (T) ∫ w Σ A_ij ∂_ij conj Υ_lm: what a potential in an anisotropic body adds to its faces'.

    At `points` (n, 3) m, `weights` w (n,) T m⁴ and `matrix` A (3, 3) symmetric; else as `moments_of_magnetization`,
    with `center`, `radius` and `degree`.
    """
    (sums,) = solid.weighted_sums(degree, (points - center) / radius, weights[:, None] / (FOUR_PI * radius**4))
    second = [[solid.regular_derivative(solid.regular_derivative(sums, i), j) for j in range(3)] for i in range(3)]
    return np.asarray(sum(np.conj(matrix[i, j] * second[i][j]) for i in range(3) for j in range(3)))


def uniform_moments(magnet: Magnet, degree: int) -> MultipoleExpansion:
    """Moments up to `degree` of a magnet with its remanent polarisation (μr = 1), to round-off; 1 is the dipole's."""
    body = magnet.body
    degree = min(degree, 1) if isinstance(body, Sphere) else degree
    center, radius = body.center, body.circumradius
    points, volume = polynomial_rule(body, degree)
    (sums,) = solid.weighted_sums(degree, (points - center) / radius, volume[:, None] / (FOUR_PI * radius**3))
    parts = [along * solid.regular_derivative(sums, axis) for axis, along in enumerate(magnet.polarization_in_rotor)]
    return MultipoleExpansion(center, radius, without_noise(np.conj(np.sum(parts, axis=0)), 1e-15))


def without_noise(coefficients: Coefficients, level: float) -> Coefficients:
    """Coefficients but those whose field at the sphere is below `level` of the largest one's: what symmetry forbids."""
    field = np.abs(coefficients) * solid.field_sizes(len(coefficients) - 1)
    return np.where(field > level * field.max(initial=0.0), coefficients, 0.0)


def merged(parts: Iterable[tuple[MultipoleExpansion, float]]) -> tuple[MultipoleExpansion, ...]:
    """The sum of expansions times factors; those about one centre are one."""
    found = dict[tuple[float, ...], MultipoleExpansion]()
    for part, factor in parts:
        key = (*part.center.tolist(), part.radius)
        sums = factor * part.coefficients
        if key in found:
            one, other = sorted((sums, found[key].coefficients), key=len)
            sums = np.array(other)
            sums[: len(one), : len(one)] += one
        found[key] = replace(part, coefficients=sums)
    return tuple(found.values())


# One of many expansions by its number, l, m, and the real or imaginary part of the coefficient
PART = np.dtype([("owner", int), ("l", int), ("m", int), ("value", complex)])
Parts = NDArray[np.void]
MOST = 300  # coefficients up to which a fit is worth its time
ROUNDS = 6  # of reweighting in a fit
MANY_PARTS = 2000  # of which each is looked at wherever the field is


def trimmed_expansions(
    expansions: Sequence[MultipoleExpansion], points: Array, allowed: Array, most: int = MOST
) -> tuple[list[MultipoleExpansion], list[MultipoleExpansion]]:
    """The coefficients that matter, and what they leave out.

    The fields of `expansions` add up, of which `allowed` (n,) T may be left out at `points` (n, 3) m. The smallest
    coefficients, along each expansion's own axes, are left out first; up to `most` that stay are fitted to the whole
    field (weighted least squares): little more than half as many do then. Dipole moments stay as they are.
    """
    parts = np.array(
        [
            (k, l, m, part)
            for k, expansion in enumerate(expansions)
            for own in (expansion.own_coefficients,)
            for l, m in zip(*np.nonzero(own), strict=True)
            for part in (own[l, m].real, 1j * own[l, m].imag)
            if part
        ],
        PART,
    )
    if not len(parts):
        return list(expansions), [_with(e, parts, 0) for e in expansions]

    def added(some: Parts) -> Array:
        """Their field (n, 3), by what is allowed."""
        chosen = [one for k, e in enumerate(expansions) if (one := _with(e, some, k)).degree]
        return summed_derivatives(chosen, points, 1) / allowed[:, None] if chosen else np.zeros_like(points)

    total, sizes = added(parts), np.empty(len(parts))
    every = slice(None, None, 1 + len(parts) // MANY_PARTS)  # of more some places tell which ones are small
    for k, expansion in enumerate(expansions):
        mine = parts["owner"] == k
        fields = _fields(expansion, parts[mine], points[every])
        sizes[mine] = (np.linalg.norm(fields, axis=2) / allowed[every]).max(axis=1, initial=0.0)
    fixed = (parts["l"] == 1) & (_largest(total) > 1)
    total -= added(parts[fixed])
    order = np.argsort(-sizes)
    ordered = parts[order[~fixed[order]]]
    # the fewest of the largest that will do: enough without a fit, and by halving with one
    too_few, enough, below = 0, len(ordered), np.zeros_like(points)
    if _largest(total) <= 1:
        enough = 0
    while enough - too_few > 1:
        count = (enough + too_few) // 2
        field = below + added(ordered[too_few:count])
        if _largest(total - field) <= 1:
            enough = count
        else:
            too_few, below = count, field
    kept = ordered[:enough]
    if 0 < enough <= most:
        factors = _fewest(expansions, kept, points, allowed, total)
        kept = kept[: len(factors)]
        kept["value"] *= factors
    kept = np.concatenate([kept, parts[fixed]])
    parts = np.concatenate([kept, parts])
    parts["value"][: len(kept)] *= -1
    first, second = ([_with(e, some, k) for k, e in enumerate(expansions)] for some in (kept, parts))
    return first, second


def _fewest(
    expansions: Sequence[MultipoleExpansion], parts: Parts, points: Array, allowed: Array, total: Array
) -> Array:
    """Factors of the first few of the parts, with which they make the total (n, 3) to 1 at every point."""
    fields = np.empty((len(parts), len(points), 3))
    for k, expansion in enumerate(expansions):
        here = parts["owner"] == k
        fields[here] = _fields(expansion, parts[here], points) / allowed[:, None]
    too_few, enough, factors = 0, len(parts), np.ones(len(parts))
    while enough - too_few > 1:
        count = (enough + too_few) // 2
        if (found := _fitted(fields[:count], total)) is None:
            too_few = count
        else:
            factors, enough = found, count
    return factors


def _fitted(fields: Array, total: Array) -> Array | None:
    """Factors (k,) with which the fields make the total to 1 at every point; None if none were found."""
    columns, weights = fields.reshape(len(fields), -1), np.ones(len(total))
    scale = 1 / np.sqrt(np.einsum("kn,kn->k", columns, columns))
    for _ in range(ROUNDS):
        rows, right = columns * np.repeat(weights, 3) * scale[:, None], total.ravel() * np.repeat(weights, 3)
        # normal equations suffice for columns of like size: the error is looked at
        factors = scale * np.linalg.lstsq(rows @ rows.T, rows @ right, rcond=None)[0]
        error = np.linalg.norm(total - (factors @ columns).reshape(total.shape), axis=1)
        if error.max() <= 1:
            return np.asarray(factors)
        weights *= np.sqrt(0.3 + error / error.max())  # towards equal largest errors
        weights /= weights.mean()
    return None


def _largest(field: Array) -> float:
    return float(np.sqrt(np.einsum("ni,ni->n", field, field).max(initial=0.0)))


def _fields(expansion: MultipoleExpansion, parts: Parts, points: Array) -> Array:
    """B (parts, n, 3) of every single part, which is along the expansion's own axes."""
    if not len(parts):
        return np.zeros((0, len(points), 3))
    places = (points - expansion.center) @ expansion.axes / expansion.radius
    harmonics = solid.irregular_values(expansion.degree + 1, places)
    fields = []
    for _, l, m, value in parts.tolist():
        gradient = solid.irregular_gradient(harmonics, l, m)
        fields.append([-(1 if m == 0 else 2) * np.real(value * component) for component in gradient])
    return np.moveaxis(np.array(fields), 1, 2) @ expansion.axes.T


def _with(expansion: MultipoleExpansion, parts: Parts, number: int) -> MultipoleExpansion:
    """The expansion with only the given parts among those of its number, along its own axes; as long as they need."""
    mine = parts[parts["owner"] == number]
    degree = int(mine["l"].max(initial=0))
    coefficients = np.zeros((degree + 1, degree + 1), complex)
    np.add.at(coefficients, (mine["l"], mine["m"]), mine["value"])
    return replace(expansion, coefficients=solid.rotated_harmonics(coefficients, expansion.axes))


HELD = 1e-11  # what a squared weight of a fit costs, so that those of pieces beside each other do not run wild


class FittedExpansions:
    """Expansions about several places with the field of sources between them, fitted to it all around these.

    `centers` (k, 3) m, `radii` (k,) m and `degree`, 2 at least, are theirs; errors count by `allowed` (n,) T at
    `points`.
    """

    def __init__(self, centers: Array, radii: Array, degree: int, points: Array, allowed: Array) -> None:
        nothing, self.points, self._allowed = np.zeros((degree + 1, degree + 1), complex), points, allowed
        self._empty = [MultipoleExpansion(*one, nothing) for one in zip(centers, radii.tolist(), strict=True)]
        parts = [(l, m, 1j if part else 1.0) for l, m, part in solid.members(degree, 1)]
        degrees = np.tile([part[0] for part in parts], len(centers))
        # the highest degree last, so that the factor without it is a corner of the whole
        order, self._fewer = np.argsort(degrees, kind="stable"), int(np.sum(degrees < degree))
        self._parts = [(i // len(parts), *parts[i % len(parts)]) for i in order.tolist()]
        self._columns = np.empty((len(order), 3 * len(points)))  # hundreds of megabytes
        for one, rows in zip(self._empty, np.argsort(order).reshape(-1, len(parts)), strict=True):
            fields = _fields(one, np.array([(0, *part) for part in parts], PART), points) / allowed[:, None]
            self._columns[rows] = fields.reshape(len(parts), -1)
        self._size = np.sqrt(np.einsum("ij,ij->i", self._columns, self._columns))  # `norm` makes a copy
        self._columns /= self._size[:, None]
        square = self._columns @ self._columns.T
        square[np.diag_indices_from(square)] += HELD * len(square)
        self._factor = scipy.linalg.cholesky(square, lower=True, overwrite_a=True)

    def of(self, field: Array) -> tuple[list[MultipoleExpansion], list[MultipoleExpansion]]:
        """Expansions of a field (n, 3) T, and what the highest degree does: 3 or 4 times their own error."""
        right = self._columns @ (field / self._allowed[:, None]).ravel()
        ends = slice(len(right)), slice(self._fewer)
        whole, fewer = (scipy.linalg.cho_solve((self._factor[e, e], True), right[e]) / self._size[e] for e in ends)
        step = np.concatenate([whole[: self._fewer] - fewer, whole[self._fewer :]])
        return self._made(whole), self._made(step)

    def _made(self, factors: Array) -> list[MultipoleExpansion]:
        number, l, m, value = (np.array(column) for column in zip(*self._parts, strict=True))
        whole = np.zeros((len(self._empty), *self._empty[0].coefficients.shape), complex)
        np.add.at(whole, (number, l, m), factors * value)
        return [replace(one, coefficients=mine) for one, mine in zip(self._empty, whole, strict=True)]
