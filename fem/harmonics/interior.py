"""A field without sources in a sphere: its expansion about the centre, and what it does to the sphere's sources.

With the harmonics of `solid`, lengths in radii of the sphere, r̃ = (r - center)/radius, and B = -∇̃ u, the incident
potential is u = Σ conj a_lm Υ_lm(r̃) and that of the sphere's own sources u = Σ c_lm Θ_lm(r̃). Their energy is

    U = (4π radius³/μ0) Σ_lm a_lm c_lm,        F = -∇U with the sources carried along.

In a ball a field is also written in the real harmonics R_k of `regular_harmonics`, in the order of `members`. With
lengths in a unit a, u = Σ A_k R_k(r/a), and a rigid body of dipoles p and charges q at places s has the multipoles

    M_k = Σ p·∇R_k(s/a) + Σ q R_k(s/a),        U = Σ A_k M_k.

A small turn δ makes δM = δ·G M, a change of place δA = δ·Dᵀ A; a field about another place is A_k = Σ P_kn R_n(ξ) of
its distance ξ.  All matrices are known from polynomials at a few places.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import ClassVar

import heyoka as hy
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ...geometry.common import MU_0, Array, even_directions
from . import solid
from .expressions import UPPER, FieldExpressions, Vector, regular_harmonics, whole_gradient
from .solid import FOUR_PI, Coefficients, factorials, members, regular_values

# Nodes of the rule for balls beyond their degree. What it cannot tell apart is 1e-3 of the error: a ball's radius is a
# seventh of the distance from the sources, so that four degrees beyond those that are left out little is left.
MORE = 2


@dataclass(frozen=True, eq=False)
class Ball:
    """The sphere about which fields are expanded: centre (3,) m and radius m."""

    center: Array
    radius: float


@cache
def sphere(degree: int, more: int = 6) -> tuple[Array, Array]:
    """Points (n, 3) on the unit sphere and their areas (n,), exact for harmonics up to 2 (`degree` + `more`) - 1."""
    nodes = degree + more
    height, weights = solid.gauss_legendre(nodes)
    angle = np.pi * np.arange(2 * nodes) / nodes
    across = np.sqrt(1 - height**2)[:, None]
    grid = np.broadcast_arrays(across * np.cos(angle), across * np.sin(angle), height[:, None])
    return np.stack(grid, axis=-1).reshape(-1, 3), np.repeat(weights * np.pi / nodes, 2 * nodes)


def interior_coefficients(field: Callable[[Array], Array], ball: Ball, degree: int) -> Coefficients:
    """Coefficients a_lm (T) of a `field`, of points (n, 3) m, without sources in a `ball`, up to a `degree`.

    By its normal component. Aliasing is ρ^(degree + 10) of it, ρ the radius over the nearest singularity's distance.
    """
    normals, _ = sphere(degree)
    return _by_normal_field(np.sum(field(ball.center + ball.radius * normals) * normals, axis=1), degree)


def _by_normal_field(normal: Array, degree: int, more: int = 6) -> Coefficients:
    """Coefficients a_lm (T) by the normal component of B (n,) T at the points of `sphere`."""
    around = (sphere(degree, more)[1] * normal).reshape(degree + more, -1)
    # a Fourier transform on each circle of latitude, then a sum over heights
    orders = np.conj(np.fft.rfft(around))[:, : degree + 1]
    return np.asarray(np.einsum("lmk,km->lm", _by_height(degree, more), orders), complex)


@cache
def _by_height(degree: int, more: int) -> Array:
    """[l, m, k]: weights of the normal field at the heights of `sphere`; around them Υ_lm is that at y = 0 by e^imφ."""
    first = sphere(degree, more)[0].reshape(degree + more, -1, 3)[:, 0]
    result = np.zeros((degree + 1, degree + 1, degree + more))
    for (l, m), values in regular_values(degree, *first.T).items():
        if l:
            result[l, m] = -(2 * l + 1) / (FOUR_PI * l) * values.real
    return factorials(degree)[:, :, None] * result


class Surroundings:
    """Points around a ball: the field there of sources in it, and in it that of dipoles and charges there."""

    def __init__(self, points: Array, ball: Ball, degree: int) -> None:
        """Of `points` (n, 3) m outside of a `ball`, for coefficients up to a `degree` about its centre."""
        self._radius, self._values = ball.radius, solid.OuterValues(degree + 1, (points - ball.center) / ball.radius)

    def field(self, sources: Coefficients) -> Array:
        """B (..., n, 3) T at the points, of sources c_lm (T) in the ball, [..., l, m]."""
        potentials = np.stack([-solid.derivative(sources, axis) for axis in range(3)], axis=-3)
        return np.moveaxis(self._values.sums(potentials), -2, -1)

    def of_magnetization(self, moments: Array) -> Coefficients:
        """Coefficients a_lm (T) [..., l, m], (4π radius³)⁻¹ Σ μ0 M dV · ∇̃Θ_lm, of dipoles (..., n, 3) T m³."""
        sums = self._values.weighted(np.moveaxis(moments, -1, -2))[..., 1:, :]
        # M·∇Θ_lm by (∂_x ± i ∂_y) Θ_lm = ±Θ_(l+1)(m±1), ∂_z Θ_lm = -Θ_(l+1)m
        minus = np.concatenate([-np.conj(sums[..., 1:2]), sums[..., :-2]], axis=-1)
        plus, upright = sums[..., 1:], sums[..., 2, :, :-1]
        x, y = (plus - minus)[..., 0, :, :] / 2, (plus + minus)[..., 1, :, :] / 2j
        total = np.tril(x + y - upright)
        total[..., 0, :] = 0.0  # a constant potential
        return np.asarray(total / (FOUR_PI * self._radius**3))

    def of_charges(self, charges: Array) -> Coefficients:
        """Coefficients a_lm (T), (4π radius²)⁻¹ Σ q Θ_lm, of magnetic charges q (n,) T m² at the points."""
        sums = self._values.weighted(charges)[:-1, :-1] / (FOUR_PI * self._radius**2)
        sums[0] = 0.0  # a constant potential
        return np.asarray(sums)


def from_magnetization(points: Array, moments: Array, ball: Ball, degree: int) -> Coefficients:
    """`Surroundings.of_magnetization` of points of any number, (n, 3) m, and their `moments` (..., n, 3) T m³."""
    parts = [slice(start, start + solid.CHUNK) for start in range(0, max(len(points), 1), solid.CHUNK)]
    return np.asarray(sum(Surroundings(points[p], ball, degree).of_magnetization(moments[..., p, :]) for p in parts))


def from_outer(sums: Sequence[Coefficients], radii: Array, centers: Array, ball: Ball, degree: int) -> Coefficients:
    """Coefficients a_lm (T), up to a `degree`, of outer expansions whose sources lie outside the ball.

    (ρ/R)^(1-l) (-1)^l Σ c_l'm' Θ_(l+l')(m+m')(d/ρ), d from their centre to the ball's: Θ_l'm' are derivatives of 1/r.
    `sums` c_lm (T), `radii` ρ and `centers` (k, 3) m are theirs; R is that of `ball`.
    """
    away, own = (ball.center - centers) / radii[:, None], max(len(each) for each in sums) - 1
    square = np.sum(away**2, axis=1)
    # all at once, because recurrences cost by the call; a point each
    values = solid.weighted_sums(own + degree, away / square[:, None], np.diag(1 / np.sqrt(square)))
    values *= factorials(own + degree)
    l, total = np.arange(degree + 1), np.zeros((degree + 1, degree + 1), complex)
    for each, sizes, ratio in zip(sums, values, radii / ball.radius, strict=True):
        last = len(each) - 1
        known, zero = solid.both_signs(sizes[: last + degree + 1, : last + degree + 1])
        given, middle = solid.both_signs(each)
        shifts = sliding_window_view(known[:, zero - last : zero + last + degree + 1], (degree + 1, degree + 1))
        part = np.einsum("ab,abij->ij", given[:, middle - last : middle + last + 1], shifts)
        total += ((-1.0) ** l * ratio ** (1.0 - l))[:, None] * part
    total[0] = 0.0  # a constant potential
    return np.asarray(np.tril(total))


def field_at_center(incident: Coefficients) -> Array:
    """B (..., 3) T at the centre, of a_lm (T) [..., l, m]."""
    upright, turned = incident[..., 1, 0], incident[..., 1, 1]
    return np.stack([turned.real, turned.imag, -upright.real], axis=-1)


def gradient_coefficients(incident: Coefficients) -> Coefficients:
    """a_lm of ∂u/∂x̃, ∂u/∂ỹ, ∂u/∂z̃ of u = Σ conj a_lm Υ_lm, [..., 3, l, m]: one degree less."""
    above = incident[..., 1:, :]
    lower = np.concatenate([-np.conj(above[..., 1:2]), above[..., :-2]], axis=-1)  # m - 1
    upper = above[..., 1:]  # m + 1
    return np.stack([(lower - upper) / 2, 0.5j * (lower + upper), above[..., :-1]], axis=-3)


def gradient_at_center(incident: Coefficients, radius: float) -> Array:
    """∂B_i/∂x_j (3, 3) T/m at the centre of a ball of a radius (m)."""
    return field_at_center(gradient_coefficients(incident)).T / radius


def multipole_force(incident: Coefficients, sources: Coefficients, ball: Ball) -> Array:
    """Force (..., 3) N of the `incident` field a_lm (T) on `sources` c_lm (T) in a `ball`, [..., l, m]; exact."""
    slopes = gradient_coefficients(incident)
    size = min(slopes.shape[-1], sources.shape[-1])
    twice = np.where(np.arange(size), 2.0, 1.0)  # over positive and negative m
    force = np.einsum("...klm,...lm->...k", slopes[..., :size, :size], sources[..., :size, :size] * twice).real
    return np.asarray(-FOUR_PI * ball.radius**2 / MU_0 * force)


def multipole_torque(incident: Coefficients, sources: Coefficients, ball: Ball) -> Array:
    """Torque m × B (3,) N m about the centre of a `ball` on `sources` c_lm (T) in an `incident` field a_lm (T).

    Degrees above 1 must be induced by that field alone: a multipole -t_l conj a_lm of a sphere feels no torque from it.
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


@cache
def real_basis(degree: int) -> tuple[Array, Array]:
    """`members` (K, 3), and [l, m] of Υ_lm by S_m Q_lm, (-1)^m (2l-1)!!/((l-m)! (l+m)!)."""
    l, m = np.indices((degree + 1, degree + 1))
    doubled = np.cumprod([1.0, *(2.0 * k - 1 for k in range(1, degree + 1))])
    return np.array(members(degree)), np.where(m <= l, (-1.0) ** m * doubled[l] / factorials(degree), 0.0)


@cache
def odd_harmonics(degree: int) -> NDArray[np.bool_]:
    """(K,) whether each of `members` is odd in y, or else even."""
    return np.array([bool(part) for _, _, part in members(degree)])


def real_weights(coefficients: Coefficients) -> Array:
    """Weights (K,), in the order of `members`, of Σ conj a_lm Υ_lm over positive and negative m."""
    (l, m, part), sizes = real_basis(len(coefficients) - 1)[0].T, real_basis(len(coefficients) - 1)[1]
    chosen = (coefficients * sizes)[l, m] * np.where(m, 2.0, 1.0)
    return np.asarray(np.where(part, chosen.imag, chosen.real))


@cache
def _real_values(degree: int) -> Array:
    """(K, n): R_k up to one degree less at the points of `sphere`."""
    return harmonics(degree - 1, sphere(degree, MORE)[0])[0].T


@dataclass(frozen=True)
class LocalField:
    """The field about a place, both given by runtime parameters: B and its first three derivatives are right there."""

    first: int  # number of the first of these parameters: the place (m), then `entries` of the derivatives

    ORDER: ClassVar[int] = 4  # of the potential: eddy currents in a floater ask for a slope of ∂²B
    count: ClassVar[int] = 3 + ORDER * (ORDER + 2)

    def expressions(self, position: Vector) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m).

        The gradient has what its own second derivatives at the place need, B what its first one needs.
        """
        way = [p - hy.par[self.first + i] for i, p in enumerate(position)]
        names = [each for degree in range(1, self.ORDER + 1) for each in solid.entries(degree)]
        known = {each: hy.par[self.first + 3 + k] for k, each in enumerate(names)}
        field = [hy.sum([known[i,], *(solid.entry(known, (i, j)) * s for j, s in enumerate(way))]) for i in range(3)]
        slopes = []
        for i, j in UPPER:
            terms = [known[i, j]]
            for k, s in enumerate(way):
                steep = [solid.entry(known, (i, j, k, l)) * t for l, t in enumerate(way)]
                terms.append(s * hy.sum([solid.entry(known, (i, j, k)), 0.5 * hy.sum(steep)]))
            slopes.append(hy.sum(terms))
        return field, whole_gradient(slopes)


@dataclass(frozen=True)
class BallField:
    """The field in a ball that runtime parameters describe: centre (m), 1/radius (1/m; 0: no ball), weights."""

    first: int  # number of the first of these parameters
    degree: int  # of the potential: 7, 8 and 9 ask for 613, 780 and 966 operations where the table of a cube has 1824
    # whether the potential is even in y about the centre, as in a rotor's mirror plane: half of the weights are zero
    mirrored: bool = False

    @property
    def number(self) -> int:
        """What names its kind: the degree, negative where it is mirrored."""
        return -self.degree if self.mirrored else self.degree

    @property
    def count(self) -> int:
        """Of the runtime parameters."""
        return 4 + 3 * self.degree**2 + 5 * (self.degree - 1) ** 2

    def offset(self, position: Vector) -> list[hy.expression]:
        """(r - center)/radius at a position (three expressions, m)."""
        return [(p - hy.par[self.first + i]) * hy.par[self.first + 3] for i, p in enumerate(position)]

    def expressions(self, position: Vector) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m)."""
        size, less = self.degree**2, (self.degree - 1) ** 2
        _, *harmonics = regular_harmonics(self.degree - 1, self.offset(position))  # the first is 1

        def weighted(first: int, kept: NDArray[np.bool_]) -> hy.expression:
            terms = [hy.par[first + 1 + k] * h for k, h in enumerate(harmonics[: len(kept) - 1]) if kept[k + 1]]
            return hy.sum([hy.par[first], *terms] if kept[0] else terms)

        start, (of_field, of_slopes) = self.first + 4, self._kept
        field = [weighted(start + i * size, kept) for i, kept in enumerate(of_field)]
        slopes = [weighted(start + 3 * size + k * less, kept) for k, kept in enumerate(of_slopes)]
        return field, whole_gradient(slopes)

    @property
    def _kept(self) -> list[NDArray[np.bool_]]:
        """Which weights of B (3, degree²) and of the gradient's entries (5, (degree - 1)²) are not zero."""
        odd = [[i == 1 for i in range(3)], [(i == 1) != (j == 1) for i, j in UPPER]]
        of_harmonics = (odd_harmonics(self.degree - less) for less in (1, 2))
        return [(np.array(o)[:, None] == h) | (not self.mirrored) for o, h in zip(odd, of_harmonics, strict=True)]

    def fit(self, evaluate: Callable[[Array], tuple[Array, Array]], ball: Ball) -> tuple[Array, float]:
        """Values (count,) of the parameters for a field, points (n, 3) m -> B, ∇B; and the error of the expansion.

        The error is the largest on the surface, of B or of its gradient, by the root mean square there.
        """
        normals, _ = sphere(self.degree, MORE)
        field, gradient = evaluate(ball.center + ball.radius * normals)
        known = [field.T, np.array([gradient[:, i, j] for i, j in UPPER])]
        incident = _by_normal_field(np.sum(field * normals, axis=1), self.degree, MORE)
        parts = -gradient_coefficients(incident)
        slopes = gradient_coefficients(parts)[tuple(np.transpose(UPPER))] / ball.radius
        groups = zip((parts, slopes), self._kept, strict=True)
        weights = [np.array([real_weights(one) for one in group]) * kept for group, kept in groups]
        basis = _real_values(self.degree)
        misses = []
        for weight, values in zip(weights, known, strict=True):
            missed = np.sum((weight @ basis[: weight.shape[1]] - values) ** 2, axis=0).max()
            misses.append(float(np.sqrt(missed / (np.mean(np.sum(values**2, axis=0)) or 1.0))))
        return np.concatenate([ball.center, [1 / ball.radius], *(w.ravel() for w in weights)]), max(misses)


DENOMINATOR = 1000  # Largest of the entries of `matrices`


def harmonics(degree: int, points: Array) -> tuple[Array, Array]:
    """R_k (n, K) and their gradients (n, K, 3) at points (n, 3), up to a degree."""
    known = regular_values(degree, *np.ascontiguousarray(points.T))
    known |= {(l, -m): (-1.0) ** m * np.conj(value) for (l, m), value in known.items()}
    zero, sizes = np.zeros(len(points), complex), real_basis(degree)[1]
    values, slopes = [], []
    for l, m, imaginary in members(degree):
        upper, lower, below = (known.get((l - 1, m + k), zero) for k in (1, -1, 0))
        parts = known[l, m], (upper - lower) / 2, (upper + lower) / 2j, below
        value, *slope = ((part.imag if imaginary else part.real) / sizes[l, m] for part in parts)
        values.append(value)
        slopes.append(np.stack(slope, axis=1))
    return np.stack(values, axis=1), np.stack(slopes, axis=1)


@cache
def shells(degree: int) -> NDArray[np.intp]:
    """(K,) degree l of each member."""
    return np.array([l for l, _, _ in members(degree)])


@cache
def sizes(degree: int) -> Array:
    """(K,) root mean square of each R_k on the unit sphere: of R_k over these a turn is a rotation."""
    l, m, _ = np.array(members(degree)).T
    doubled = np.cumprod([1.0, *range(1, 2 * degree, 2)])[l]  # (2l-1)!!: R_k is (l-m)!/(2l-1)!! P_lm(cos θ) cos mφ
    ratio = factorials(degree)[l, m] / (2 * l + 1) * np.where(m, 0.5, 1.0)  # (l-m)! (l+m)!
    return np.asarray(np.sqrt(ratio) / doubled)


@cache
def turns(degree: int) -> Array:
    """(3, K, K) of `matrices`' G for R_k over their `sizes`: antisymmetric; equal entries are so to the last bit."""
    unit = sizes(degree)
    found = matrices(degree)[1] * unit / unit[:, None]
    return np.asarray(np.sign(found) * np.sqrt(np.round(4 * found**2)) / 2)


@cache
def matrices(degree: int) -> tuple[Array, Array]:
    """D (3, K, K) with ∂R = D R, and G (3, K, K) with (e × r)·∇R = G R for turns about each axis e."""
    points = even_directions(6 * (degree + 1) ** 2) * np.linspace(0.4, 1.0, 6 * (degree + 1) ** 2)[:, None]
    values, slopes = harmonics(degree, points)
    turned = np.stack([np.einsum("ni,nki->nk", np.cross(axis, points), slopes) for axis in np.eye(3)])
    l, found = shells(degree), []
    for wanted, less in ((np.moveaxis(slopes, 2, 0), 1), (turned, 0)):
        one = np.zeros((3, len(l), len(l)))
        for degree_here in range(degree + 1):
            rows, columns = np.flatnonzero(l == degree_here), np.flatnonzero(l == degree_here - less)
            if len(columns):
                solved = np.linalg.lstsq(values[:, columns], np.concatenate(wanted[:, :, rows], axis=1))[0]
                one[:, rows[:, None], columns] = solved.T.reshape(3, len(rows), len(columns))
        # without round-off: the entries are rational numbers with small denominators
        known = {float(v): float(Fraction(v).limit_denominator(DENOMINATOR)) for v in np.unique(one)}
        exact = np.vectorize(known.__getitem__)(one)
        found.append(np.where(np.abs(exact - one) < 1e-11 * np.abs(one).max(), exact, one))
    return found[0], found[1]


def shifted(coefficients: Array, degree: int, way: int) -> Array:
    """`coefficients` (K,) up to a `degree` at places ξ: (K, N), A_k = Σ P_kn R_n(ξ), n up to degree `way`."""
    ways, solving = _ways(way)
    found = np.zeros((len(coefficients), (way + 1) ** 2))
    power = np.broadcast_to(coefficients, (len(ways), len(coefficients)))
    for j, solve in enumerate(solving):
        found[:, shells(way) == j] = (solve @ power).T
        power = sum(ways[:, [a]] * (power @ slope) for a, slope in enumerate(matrices(degree)[0])) / (j + 1)
    return found


@cache
def _ways(way: int) -> tuple[Array, list[Array]]:
    """Places (n, 3) all around, and what makes of values there their weights in the harmonics of each degree."""
    ways = even_directions(2 * (way + 1) ** 2)
    values = harmonics(way, ways)[0]
    return ways, [np.asarray(np.linalg.pinv(values[:, shells(way) == j]), float) for j in range(way + 1)]


def field_coefficients(
    evaluate: Callable[[Array], Array], center: Array, reach: float, degree: int, unit: float
) -> Array:
    """A (K,) T m up to a `degree`, lengths in a `unit`, of B = `evaluate` in a ball of `center` and `reach`, m."""
    found = real_weights(interior_coefficients(evaluate, Ball(center, reach), degree))
    return np.asarray(found * reach * (unit / reach) ** shells(degree))
