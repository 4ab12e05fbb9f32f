"""A field without sources in a sphere: its expansion about the centre, and what it does to the sphere's sources.

With the harmonics of `solid`, lengths in radii of the sphere, r̃ = (r - center)/radius, and B = -∇̃ u, the incident
potential is u = Σ conj a_lm Υ_lm(r̃) and that of the sphere's own sources u = Σ c_lm Θ_lm(r̃). Their energy is

    U = (4π radius³/μ0) Σ_lm a_lm c_lm,        F = -∇U with the sources carried along,

because 1/|r - s| = Σ conj Υ_lm(r) Θ_lm(s) makes a charge's c_lm = conj Υ_lm its weight in U.

In a ball a field is also written in the real harmonics R_k of `regular_harmonics`, in the order of `members`:
B = -∇ Σ c_k R_k, lengths in radii.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import heyoka as hy
import numpy as np

from ...geometry.common import MU_0, Array
from .expressions import UPPER, FieldExpressions, regular_harmonics
from .solid import CHUNK, FOUR_PI, Coefficients, factorials, members, regular_values, weighted_sums


@dataclass(frozen=True, eq=False)
class Ball:
    """The sphere about which fields are expanded: centre (3,) m and radius m."""

    center: Array
    radius: float


def sphere(degree: int) -> tuple[Array, Array]:
    """Points (n, 3) on the unit sphere and their areas (n,), exact for products of two harmonics up to `degree` + 5."""
    nodes = degree + 6
    height, weights = np.polynomial.legendre.leggauss(nodes)
    angle = np.pi * np.arange(2 * nodes) / nodes
    across = np.sqrt(1 - height**2)[:, None]
    grid = np.broadcast_arrays(across * np.cos(angle), across * np.sin(angle), height[:, None])
    return np.stack(grid, axis=-1).reshape(-1, 3), np.repeat(weights * np.pi / nodes, 2 * nodes)


def interior_coefficients(field: Callable[[Array], Array], ball: Ball, degree: int) -> Coefficients:
    """Coefficients a_lm (T) of a field without sources in a ball, by its normal component on the surface.

    Parameters
    ----------
    field : points (n, 3) m -> B (n, 3) T
    ball : about whose centre it is expanded
    degree : highest l

    Aliasing is a part ρ^(degree + 10) of the field, ρ the radius over the
    distance of the centre from the nearest singularity.
    """
    normals, areas = sphere(degree)
    radial = areas * np.sum(field(ball.center + ball.radius * normals) * normals, axis=1)
    along_circles = np.conj(np.fft.rfft(radial.reshape(degree + 6, -1)))[:, : degree + 1]
    return np.asarray(np.einsum("lmk,km->lm", _by_height(degree), along_circles), complex)


@cache
def _by_height(degree: int) -> Array:
    """[l, m, k]: weights of the normal field at the heights of `sphere`; around them Υ_lm is that at y = 0 by e^imφ."""
    first = sphere(degree)[0].reshape(degree + 6, -1, 3)[:, 0]
    result = np.zeros((degree + 1, degree + 1, degree + 6))
    for (l, m), values in regular_values(degree, *first.T).items():
        if l:
            result[l, m] = -(2 * l + 1) / (FOUR_PI * l) * values.real
    return factorials(degree)[:, :, None] * result


def from_magnetization(points: Array, moments: Array, ball: Ball, degree: int) -> Coefficients:
    """Coefficients a_lm (T) of dipoles outside a ball: (4π radius³)⁻¹ Σ μ0 M dV · ∇̃Θ_lm, exact for these dipoles.

    Parameters
    ----------
    points, moments : (n, 3) m and μ0 M dV (n, 3) T m³
    ball : about whose centre the field is expanded
    degree : highest l
    """
    sums = np.zeros((3, degree + 2, degree + 2), complex)
    for start in range(0, len(points), CHUNK):
        away = (points[start : start + CHUNK] - ball.center) / ball.radius
        square = np.sum(away**2, axis=1)[:, None]
        sums += weighted_sums(degree + 1, away / square, moments[start : start + CHUNK] / np.sqrt(square))
    sums *= factorials(degree + 1)  # Θ_lm(r) = (l-m)! (l+m)! Υ_lm(r/r²)/r
    minus = np.concatenate([-np.conj(sums[:, 1:, 1:2]), sums[:, 1:, :-2]], axis=2)
    plus = sums[:, 1:, 1:]
    x, y, z = (plus[0] - minus[0]) / 2, (plus[1] + minus[1]) / 2j, -sums[2, 1:, :-1]
    total = np.tril(x + y + z)
    total[0] = 0.0  # a constant potential
    return np.asarray(total / (FOUR_PI * ball.radius**3))


def field_at_center(incident: Coefficients) -> Array:
    """B (3,) T at the centre."""
    return np.array([incident[1, 1].real, incident[1, 1].imag, -incident[1, 0].real])


def gradient_coefficients(incident: Coefficients, axis: int) -> Coefficients:
    """a_lm of ∂u/∂x̃_axis of u = Σ conj a_lm Υ_lm: one degree less."""
    above = incident[1:]
    size = len(above)
    lower = np.hstack([-np.conj(above[:, 1:2]), above[:, : size - 1]])  # m - 1
    upper = above[:, 1 : size + 1]  # m + 1
    return np.asarray(((lower - upper) / 2, 0.5j * (lower + upper), above[:, :size])[axis])


def gradient_at_center(incident: Coefficients, radius: float) -> Array:
    """∂B_i/∂x_j (3, 3) T/m at the centre of a ball of a radius (m)."""
    return np.stack([field_at_center(gradient_coefficients(incident, axis)) for axis in range(3)], axis=1) / radius


def multipole_force(incident: Coefficients, sources: Coefficients, ball: Ball) -> Array:
    """Force (3,) N of the `incident` field a_lm (T) on `sources` c_lm (T) in a `ball`; exact."""
    force = np.zeros(3)
    for axis in range(3):
        slope = gradient_coefficients(incident, axis)
        size = min(len(slope), len(sources))
        products = np.real(slope[:size, :size] * sources[:size, :size])
        force[axis] = 2 * products.sum() - products[:, 0].sum()  # over positive and negative m
    return -FOUR_PI * ball.radius**2 / MU_0 * force


def multipole_torque(incident: Coefficients, sources: Coefficients, ball: Ball) -> Array:
    """Torque (3,) N m about the centre of a `ball` on `sources` c_lm (T) in an `incident` field a_lm (T): m × B.

    The degrees above 1 must be induced by the incident field alone: a multipole -t_l conj a_lm of a sphere feels no
    torque from the field that induces it.
    """
    return np.cross(moment(sources, ball), field_at_center(incident))


def moment(sources: Coefficients, ball: Ball) -> Array:
    """Dipole moment (3,) A m² of sources c_lm (T)."""
    c = sources[1]
    return FOUR_PI * ball.radius**3 / MU_0 * np.array([-2 * c[1].real, 2 * c[1].imag, c[0].real])


def dipole_sources(moment: Array, ball: Ball, degree: int) -> Coefficients:
    """Coefficients c_lm (T) up to a `degree` of a dipole `moment` (3,) A m² at the centre of a `ball`."""
    result = np.zeros((degree + 1, degree + 1), complex)
    x, y, z = moment * MU_0 / (FOUR_PI * ball.radius**3)
    result[1, :2] = z, (-x + 1j * y) / 2
    return result


def real_weights(coefficients: Coefficients) -> Array:
    """Weights (..., K), in the order of `members`, of Σ conj a_lm Υ_lm (..., l, m) over positive and negative m."""
    degree = coefficients.shape[-1] - 1
    scaled = coefficients * _sizes(degree) * np.where(np.arange(degree + 1), 2.0, 1.0)
    parts = [(scaled[..., l, m].imag if part else scaled[..., l, m].real) for l, m, part in members(degree)]
    return np.stack(parts, axis=-1)


def _sizes(degree: int) -> Array:
    """[l, m]: Υ_lm by S_m Q_lm, (-1)^m (2l-1)!!/((l-m)! (l+m)!)."""
    l, m = np.indices((degree + 1, degree + 1))
    doubled = np.cumprod([1.0, *(2.0 * k - 1 for k in range(1, degree + 1))])
    return np.where(m <= l, (-1.0) ** m * doubled[l] / factorials(degree), 0.0)


@cache
def _fitting(degree: int) -> tuple[Array, Array, Array]:
    """Points (n, 3) on the unit sphere for potentials of a degree; exact for them.

    With (3 degree² + 5 (degree - 1)², n) the weights of B and of its gradient by the normal component of B there, and
    (degree², n) the R_k up to one degree less.
    """
    normals, areas = sphere(degree)
    by_normal = np.zeros((len(normals), degree + 1, degree + 1), complex)
    for (l, m), values in regular_values(degree, *normals.T).items():
        if l:
            by_normal[:, l, m] = -(2 * l + 1) / (4 * np.pi * l) * values * areas
    potential = real_weights(np.asarray(factorials(degree) * by_normal, complex)).T
    first, second = derivatives(degree), derivatives(degree - 1)
    field = [-slope @ potential for slope in first]
    weights = np.concatenate([*field, *(second[j] @ field[i] for i, j in UPPER)])
    known, sizes = regular_values(degree - 1, *normals.T), _sizes(degree - 1)
    basis = [(known[l, m].imag if p else known[l, m].real) / sizes[l, m] for l, m, p in members(degree - 1)]
    return normals, weights, np.array(basis)


@cache
def derivatives(degree: int) -> Array:
    """(3, degree², K): the coefficients of ∂/∂x_a Σ c_k R_k by the c_k, K = (degree + 1)²."""
    columns = []
    for k, (l, m, part) in enumerate(members(degree)):
        single = np.zeros((degree + 1, degree + 1), complex)
        single[l, m] = 1j if part else 1.0
        single /= real_weights(single)[k]
        columns.append([real_weights(gradient_coefficients(single, axis)) for axis in range(3)])
    return np.moveaxis(np.array(columns), 0, -1)


@dataclass(frozen=True)
class BallField:
    """The field in a ball that runtime parameters describe: centre (m), 1/radius (1/m; 0: no ball), weights.

    Parameters
    ----------
    first : number of the first of these parameters
    degree : of the potential: 7, 8 and 9 ask for 613, 780 and 966 operations where the table of a cube has 1824
    """

    first: int
    degree: int

    @property
    def count(self) -> int:
        """Of the runtime parameters."""
        return 4 + 3 * self.degree**2 + 5 * (self.degree - 1) ** 2

    def offset(self, position: Sequence[hy.expression]) -> list[hy.expression]:
        """(r - center)/radius at a position (three expressions, m)."""
        return [(p - hy.par[self.first + i]) * hy.par[self.first + 3] for i, p in enumerate(position)]

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m)."""
        size, less = self.degree**2, (self.degree - 1) ** 2
        _, *harmonics = regular_harmonics(self.degree - 1, self.offset(position))  # the first is 1

        def weighted(first: int, count: int) -> hy.expression:
            return hy.sum([hy.par[first], *(hy.par[first + 1 + k] * h for k, h in enumerate(harmonics[: count - 1]))])

        start = self.first + 4
        field = [weighted(start + i * size, size) for i in range(3)]
        slopes = [weighted(start + 3 * size + k * less, less) for k in range(len(UPPER))]
        upper = dict(zip(UPPER, slopes, strict=True))
        upper[2, 2] = -upper[0, 0] - upper[1, 1]
        return field, [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]

    def fit(self, evaluate: Callable[[Array], tuple[Array, Array]], ball: Ball) -> tuple[Array, float]:
        """Values (count,) of the parameters for a field, points (n, 3) m -> B, ∇B; and the error of the expansion.

        The error is the largest on the surface, of B or of its gradient, by the root mean square there.
        """
        (normals, by_normal, basis), size, less = _fitting(self.degree), self.degree**2, (self.degree - 1) ** 2
        field, gradient = evaluate(ball.center + ball.radius * normals)
        slopes = np.array([gradient[:, i, j] for i, j in UPPER])
        weights = by_normal @ np.einsum("na,na->n", field, normals)
        weights[3 * size :] /= ball.radius
        field_error = _relative_miss(weights[: 3 * size].reshape(3, size) @ basis - field.T, field.T)
        slope_error = _relative_miss(weights[3 * size :].reshape(5, less) @ basis[:less] - slopes, slopes)
        return np.concatenate([ball.center, [1 / ball.radius], weights]), max(field_error, slope_error)


def _relative_miss(missed: Array, values: Array) -> float:
    """Largest norm of what is missed (k, n) by the root mean square of the norm of the values (k, n)."""
    size = float(np.sqrt(np.mean(np.sum(values**2, axis=0))))
    worst = float(np.sqrt(np.max(np.sum(missed**2, axis=0))))
    return worst / size if size else worst
