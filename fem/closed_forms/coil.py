"""Field of a round coil with a rectangular cross-section, by complete elliptic integrals, for 1 A in each turn.

A cylindrical sheet of radius a with the current K along z has, from its ends at the heights ζ over the point,

    A_φ = (4μ0 K a² ρ/π) [ζ/((a+ρ)² r) ∫ s²c²/((1 - h²s²) √(1 - k²s²)) dθ],    r² = (a+ρ)² + ζ²,
    h² = 4aρ/(a+ρ)²,  k² = 4aρ/r²,  s = sin θ,  c = cos θ,  0 < θ < π/2

(the usual integral of cos φ asinh(ζ/distance), by parts: without cancellation on the axis), in Carlson's functions
[R_D(0, 1-k², 1) - (1-h²) R_J(0, 1-k², 1, 1-h²)]/3h².  A winding is the sum of its sheets by Gauss's rule, on either
side of the point's own radius, with nodes that crowd there.

Off its winding a coil is as well a few filaments, with which the equations of motion are written.  One of radius a and
current I has, by the arithmetic-geometric mean, with q = A_φ/ρ, s = a² + ρ² + ζ² and p = √(s² - 4a²ρ²),

    q = μ0 I/(4M) Σ 2ⁿ⁻¹ (c_n/ρ)²,   c_1² = 2a²ρ²/(s + p),   c_n+1 = c_n²/(4a_n+1),   B = (-x q_ζ, -y q_ζ, 2q + ρ q_ρ),

where a_1 = √((s + p)/2), b_1 = √p, and a_n is the mean of a_n-1 and b_n-1, M the last: smooth on the axis.

N. Derby, S. Olbert, Am. J. Phys. 78, 229 (2010) (B_z of a sheet); B. C. Carlson, Numer. Algorithms 10, 13 (1995);
M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, section 17.6.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, elliprf, elliprj

from ...geometry.common import MU_0, Array
from ...geometry.scene.contents import Coil
from ..compiled_code import compiled
from ..harmonics.expressions import UPPER, FieldExpressions, Vector, differentiated, whole_gradient
from ..harmonics.solid import entries, gauss_legendre, tensors

NODES, CROWD = 24, 3  # Gauss points on either side of a point's radius, and the power by which they crowd there
NEAR_AXIS = 0.05  # h² below which the integral of the sheet is a sum over equidistant angles: 1/h² would cancel
ANGLES = np.pi / 2 * (np.arange(16) + 0.5) / 16
LEAST = 1e-30  # Parameter of R_J in place of zero, where its factor is zero
BLOCK = 20_000  # Points at a time
STEP = 1e-4  # m, of the differences for slopes near a winding, of fourth order
MEANS = 4  # of the arithmetic-geometric mean: 1e-12 of a filament's field from a fifth of its radius on
FILAMENT_ERROR = 1e-4  # By which the filaments' number is chosen where a floater touches the winding; it is 1e-5


def _wave(h: Array, k: Array) -> Array:
    """∫ s²c²/((1 - h s²) √(1 - k s²)) dθ over a quarter turn."""
    p = np.maximum(1 - h, LEAST)
    near = h < NEAR_AXIS
    safe = np.where(near, 0.5, h)
    closed = (elliprd(0, 1 - k, 1) - p * elliprj(0, 1 - k, 1, p)) / (3 * safe)
    if not near.any():
        return np.asarray(closed)
    square = np.sin(ANGLES) ** 2
    factors = square * (1 - square) * (np.pi / 2 / len(ANGLES))
    closed[near] = (factors / (1 - h[near, None] * square) / np.sqrt(1 - k[near, None] * square)).sum(axis=1)
    return np.asarray(closed)


def _sheet_potential(a: Array, rho: Array, zeta: Array) -> Array:
    """A_φ over μ0 K of the end at ζ of a sheet."""
    square = (a + rho) ** 2
    far = square + zeta**2
    wave = _wave(4 * a * rho / square, 4 * a * rho / far)
    return np.asarray(4 / np.pi * a**2 * rho * zeta / (square * np.sqrt(far)) * wave)


def _sheet_radial(a: Array, rho: Array, zeta: Array) -> Array:
    """B_ρ over μ0 K of the end at ζ: A_φ of a ring there."""
    far = (a + rho) ** 2 + zeta**2
    k = 4 * a * rho / far
    return np.asarray(4 / np.pi * a**2 * rho / far**1.5 * _wave(k, k))


def _sheet_axial(a: Array, rho: Array, zeta: Array) -> Array:
    """B_z over μ0 K of the end at ζ (Derby and Olbert, equation 4)."""
    far, gamma = (a + rho) ** 2 + zeta**2, (a - rho) / (a + rho)
    other = (zeta**2 + (a - rho) ** 2) / far
    turn = gamma * (1 - gamma) * elliprj(0, other, 1, np.maximum(gamma**2, LEAST)) / 3
    return np.asarray(a * zeta / (np.pi * (a + rho) * np.sqrt(far)) * (elliprf(0, other, 1) + turn))


def _summed(coil: Coil, end: Callable[[Array, Array, Array], Array], rho: Array, z: Array) -> Array:
    """A sheet's function `end`, at both ends, summed over a winding of 1 A a turn, at (n,) m from its middle."""
    inner, outer = coil.radius - coil.width / 2, coil.radius + coil.width / 2
    nodes, weights = gauss_legendre(NODES)
    along, weights = ((nodes + 1) / 2) ** CROWD, weights / 2 * CROWD * ((nodes + 1) / 2) ** (CROWD - 1)
    middle = np.clip(rho, inner, outer)
    total = np.zeros(len(rho))
    for edge in (inner, outer):
        way = edge - middle
        radii = middle[:, None] + way[:, None] * along
        for height, sign in ((coil.height / 2, 1.0), (-coil.height / 2, -1.0)):
            ends = end(radii.ravel(), np.repeat(rho, NODES), np.repeat(height - z, NODES)).reshape(radii.shape)
            total += sign * np.abs(way) * (ends @ weights)
    return MU_0 * coil.turns / (coil.width * coil.height) * total


@dataclass(frozen=True, eq=False)
class CoilField:
    """Coils about axes along z, each with 1 A in its turns, or a share of that."""

    coils: Sequence[Coil]
    shares: Sequence[float] | None = None  # one a coil

    def _total(self, points: ArrayLike, part: Callable[[Coil, Array, Array, Array], Array]) -> Array:
        points = np.asarray(points, float).reshape(-1, 3)
        found = np.zeros(points.shape)
        for coil, share in zip(self.coils, self.shares or [1.0] * len(self.coils), strict=True):
            for start in range(0, len(points), BLOCK):
                local = points[start : start + BLOCK] - coil.center
                rho = np.hypot(local[:, 0], local[:, 1])
                found[start : start + BLOCK] += share * part(coil, local, rho, local[:, 2])
        return found

    def vector_potential(self, points: ArrayLike) -> Array:
        """A (n, 3), T m, at points (n, 3), m; to 1e-10 of the coil's largest."""

        def part(coil: Coil, local: Array, rho: Array, z: Array) -> Array:
            along = _summed(coil, _sheet_potential, rho, z) / np.maximum(rho, 1e-300)
            return np.stack([-local[:, 1] * along, local[:, 0] * along, 0 * along], axis=1)

        return self._total(points, part)

    def flux_density(self, points: ArrayLike) -> Array:
        """B (n, 3), T, at points (n, 3), m."""

        def part(coil: Coil, local: Array, rho: Array, z: Array) -> Array:
            outwards = _summed(coil, _sheet_radial, rho, z) / np.maximum(rho, 1e-300)
            axial = _summed(coil, _sheet_axial, rho, z)
            return np.stack([local[:, 0] * outwards, local[:, 1] * outwards, axial], axis=1)

        return self._total(points, part)


@dataclass(frozen=True, eq=False)
class Filaments:
    """Filaments about axes along z for coils, to 1e-5 of their largest field, three times as far off to 1e-8."""

    centers: Array  # (n, 3) m
    radii: Array  # (n,) m
    turns: Array  # (n,), the currents (A) for 1 A in each turn
    owners: Array  # (n,) numbers of their coils

    @classmethod
    def of(cls, coils: Sequence[Coil], nearest: float) -> "Filaments":
        """Those of coils for points at a distance (m) from their windings and more."""

        def rule(size: float) -> list[tuple[float, float]]:
            ratio = 2 * nearest / size  # Gauss's rule converges by the ellipse through the nearest singularity
            count = np.log(1 / FILAMENT_ERROR) / (2 * np.arcsinh(ratio))
            nodes, weights = gauss_legendre(int(np.clip(np.ceil(count), 1, NODES)))
            return list(zip(size / 2 * nodes, weights / 2, strict=True))

        rows = [
            [*coil.center[:2], coil.center[2] + up, coil.radius + out, coil.turns * one * other, k]
            for k, coil in enumerate(coils)
            for (out, one), (up, other) in product(rule(coil.width), rule(coil.height))
        ]
        x, y, z, radii, turns, owners = np.array(rows).T
        return cls(np.stack([x, y, z], axis=1), radii, turns, owners.astype(int))

    def expressions(self, position: Vector, currents: Sequence[Any]) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m), for currents (coils,) A in each turn."""
        axes: dict[tuple[float, float], list[hy.expression]] = {}
        (x, y, z), (square, height) = position, hy.make_vars("square", "height")
        numbers = (part.tolist() for part in (self.centers, self.radii, self.turns, self.owners))
        for (a, b, c), radius, turns, owner in zip(*numbers, strict=True):
            axes.setdefault((a, b), []).append(_filament(square, height - c, radius, turns * currents[owner]))
        parts = [_field_of(hy.sum(sources), [x - a, y - b, z], square, height) for (a, b), sources in axes.items()]
        field = [hy.sum([b[i] for b, _ in parts]) for i in range(3)]
        return field, [[hy.sum([slope[i][j] for _, slope in parts]) for j in range(3)] for i in range(3)]

    def derivatives(self, points: Array, order: int, currents: Array) -> Array:
        """B and its derivatives up to `order` - 1 by `entries` (n, k) at `points`, for `currents` (coils,) A a turn."""
        function, found = _compiled_filament(order), np.zeros((len(points), order * (order + 2)))
        for center, radius, turns, owner in zip(self.centers, self.radii, self.turns, self.owners, strict=True):
            given = np.repeat([[radius], [turns * currents[owner]]], len(points), axis=1)
            found += function(np.ascontiguousarray((points - center).T), pars=given).T
        return found


def coils_field(coils: Sequence[Coil], currents: Array, points: Array) -> tuple[Array, Array]:
    """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at `points` (n, 3) m anywhere, `currents` (coils,) A in `coils`' turns.

    By closed forms nearer to a winding than it is wide or high, slopes by differences, to 1e-6 from a few mm on; by
    filaments farther off, to 1e-8.
    """
    found, slopes = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
    if not coils:
        return found, slopes
    size = max(max(coil.width, coil.height) for coil in coils)
    near = np.any([coil.body.distance(points) < size for coil in coils], axis=0)
    filaments = Filaments.of(coils, size / 3)  # 1e-8 from three times as far on
    found[~near], slopes[~near] = tensors(filaments.derivatives(points[~near], 2, currents))
    field, here = CoilField(coils, currents.tolist()), points[near]
    ends = [field.flux_density(here + s * STEP * axis) for axis in np.eye(3) for s in (2, 1, -1, -2)]
    steep = np.tensordot([-1, 8, -8, 1], np.reshape(ends, (3, 4, len(here), 3)), (0, 1)) / (12 * STEP)
    found[near], slopes[near] = field.flux_density(here), np.moveaxis(steep, 0, -1)
    return found, slopes


def _filament(square: hy.expression, height: hy.expression, radius: Any, current: Any) -> hy.expression:
    """A_φ/ρ of a filament (T) at ρ² and ζ (m)."""
    size = radius * radius
    sum_ = size + square + height * height
    root = hy.sqrt(sum_ * sum_ - 4.0 * size * square)
    mean, other, part = hy.sqrt(0.5 * (sum_ + root)), hy.sqrt(root), 2.0 * size / (sum_ + root)
    total, whole = part, part * square  # c_n²/ρ², and c_n²
    for n in range(1, MEANS):
        mean, other = 0.5 * (mean + other), hy.sqrt(mean * other)
        factor = whole / (16.0 * mean * mean)
        part, whole = part * factor, whole * factor
        total = total + 2.0**n * part
    return MU_0 / 4 * current * total / mean


def _field_of(
    source: hy.expression, position: Vector, square: hy.expression, height: hy.expression
) -> FieldExpressions:
    """B and its gradient of A_φ/ρ, a function of the variables `square` and `height`, at a position from its axis."""
    series = hy.diff_tensors([source], diff_args=[square, height], diff_order=2)
    x, y, z = position
    here = {square: x * x + y * y, height: z}
    a, s, z_, ss, sz = hy.subs([series[0, *k] for k in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1))], here)
    rho = here[square]
    field = [-x * z_, -y * z_, 2.0 * (a + rho * s)]
    up = 4.0 * (2.0 * s + rho * ss)
    known = {(0, 0): -z_ - 2.0 * x * x * sz, (0, 1): -2.0 * x * y * sz, (0, 2): x * up,
             (1, 1): -z_ - 2.0 * y * y * sz, (1, 2): y * up}  # fmt: skip
    return field, whole_gradient([known[each] for each in UPPER])


@cache
def _compiled_filament(order: int) -> Any:
    """B and its derivatives of a filament about z at the origin, by their `entries`, for a radius and a current."""
    variables = hy.make_vars("x", "y", "z")
    square, height = hy.make_vars("square", "height")
    field, gradient = _field_of(_filament(square, height, hy.par[0], hy.par[1]), variables, square, height)
    known = {each: gradient[each[0]][each[1]] for each in entries(2)}
    rest = differentiated(known, variables, order)
    return compiled(hy.cfunc, [*field, *known.values(), *rest], variables, opt_level=0)
