"""Field of uniformly polarised cylinders, rings and spheres, outside and inside, to round-off.

A cylinder polarised across its axis carries the charge J cos φ on its mantle, one polarised along it the current J/μ0:
sums over φ of straight segments from z = -L to L.  With d from the segment across it, D = |d|, and distances a, b from
its ends,

    ∫ dz'/r³ = P = 2ℓ (a + b) / (a b [(a + b)² - ℓ²]),      ∫ (z - z')/r³ dz' = Q = 1/a - 1/b,

the charge gives (1/4π) Σ R J cos φ (d P, Q), the current (1/4π) Σ R J (e Q, -e·d P), e the direction of φ.  Near the
mantle the sum has a peak of the width δ of the distance, which Gauss's rule meets with φ - φ0 = δ sinh u (P. R.
Johnston and D. Elliott, Int. J. Numer. Meth. Eng. 62 (2005) 564).  A ring is a cylinder less its hole, a sphere a
dipole with H = -J/3 inside (J. D. Jackson, Classical Electrodynamics (1999), § 5.9).
"""

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import permutations
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from ...geometry.shapes import Cylinder, Sphere
from ..compiled_code import compiled
from ..harmonics.expressions import differentiated, whole_gradient
from ..harmonics.solid import FOUR_PI, entries, gauss_legendre

# Nodes of the rule for distances from the mantle of at least so many radii: round-off
RULES = ((0.8, 16), (0.1, 24), (1e-2, 32), (1e-5, 64), (0.0, 160))
WIDEST, NARROWEST = 3.0, 1e-14
TOGETHER = 500  # points at once, beside all segments of each
# The same for both halves of a mantle at once, where field and slope outside are asked to 1e-9 from BESIDE radii off
AROUND = ((0.8, 24), (0.3, 32), (0.05, 48), (0.0, 64))
BESIDE = 1e-2


def round_tensor(body: Cylinder | Sphere, points: Array) -> Array:
    """T (n, 3, 3) with H = T J in T at points (n, 3) m of a polarisation J, both in the frame of the points.

    On the surface it is the mean of both sides, on an edge it is infinite.  Accuracy: 1e-13.
    """
    local, turn = body.to_body(points), body.rotation
    if isinstance(body, Sphere):
        tensor = _sphere(body.radius, local)[0]
    else:
        tensor = _of_mantles(body, local, slopes=False)
        tensor[:, 2, 2] -= np.where(body.distance(points) < 0, 1.0, 0.0)
    return np.asarray(turn @ tensor @ turn.T)


def round_slope(body: Cylinder | Sphere, points: Array) -> Array:
    """G (n, 3, 3, 3), ∂H_i/∂x_j = Σ_k G_ijk J_k, 1/m; as `round_tensor`, worse by radius over surface's distance."""
    local, turn = body.to_body(points), body.rotation
    slope = _sphere(body.radius, local)[1] if isinstance(body, Sphere) else _of_mantles(body, local, slopes=True)
    return np.asarray(np.einsum("ia,jb,kc,nabc->nijk", turn, turn, turn, slope, optimize=True))


def _of_mantles(body: Cylinder, local: Array, slopes: bool) -> Array:
    each = [(sign, _mantle(radius, body.height / 2, local, slopes)[slopes]) for radius, sign in mantles(body)]
    return np.asarray(np.sum([sign * _turned(part, local) for sign, part in each], axis=0))


def mantles(body: Cylinder) -> list[tuple[float, float]]:
    """Radii of the mantles, and the sign of what they carry."""
    return [(body.radius, 1.0), (body.inner_radius, -1.0)] if body.inner_radius else [(body.radius, 1.0)]


def _sphere(radius: float, points: Array) -> tuple[Array, Array]:
    distance = np.linalg.norm(points, axis=1)
    r = np.maximum(distance, radius)[:, None, None]
    unit, inside = points / r[:, 0], (distance < radius)[:, None, None]
    one, pair = np.eye(3), unit[:, :, None] * unit[:, None, :]
    tensor = np.where(inside, -one / 3, (radius / r) ** 3 * (pair - one / 3))
    mixed = sum(np.einsum(f"{two},n{third}->nijk", one, unit) for two, third in (("ij", "k"), ("ik", "j"), ("jk", "i")))
    slope = (radius / r[..., None]) ** 3 / r[..., None] * (mixed - 5 * np.einsum("ni,nj,nk->nijk", unit, unit, unit))
    return tensor, np.where(inside[..., None], 0.0, slope)


def _turned(tensor: Array, points: Array) -> Array:
    """A tensor of rank 2 or 3 (n, …) known on the half plane φ = 0, turned to where the points (n, 3) are."""
    rho = np.hypot(points[:, 0], points[:, 1])
    safe = np.where(rho > 0, rho, 1.0)
    cos, sin = np.where(rho > 0, points[:, 0] / safe, 1.0), points[:, 1] / safe
    turn = np.zeros((len(points), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = cos, -sin, sin, cos, 1.0
    if tensor.ndim == 3:
        return np.asarray(turn @ tensor @ np.swapaxes(turn, 1, 2))
    return np.asarray(np.einsum("nia,njb,nkc,nabc->nijk", turn, turn, turn, tensor, optimize=True))


def _mantle(radius: float, half: float, points: Array, slopes: bool) -> tuple[Array, Array]:
    """H of polarisations across the axis, and B of one along it, at points turned to φ = 0; the same of the slopes."""
    rho, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    tensor, slope = np.zeros((len(rho), 3, 3)), np.zeros((len(rho) if slopes else 0, 3, 3, 3))
    beyond = np.maximum((z - half) * (z + half), 0.0)
    for part, width, nodes in _parts(radius, half, rho, z, RULES):
        u, weights = gauss_legendre(nodes)
        end = np.arcsinh(np.pi / width)
        given = np.empty((8, len(part), nodes))
        given[:3], given[3] = np.array([rho[part], z[part], beyond[part]])[:, :, None], width
        given[4], given[5] = (u + 1) / 2 * end, weights * end * radius
        given[6:] = np.array([radius, half])[:, None, None]
        sums = _half_kernel(slopes)(given.reshape(8, -1)).reshape(-1, len(part), nodes).sum(axis=2)
        xx, yy, xz, zz, *bends = sums
        tensor[part, 0, 0], tensor[part, 1, 1], tensor[part, 2, 2] = xx, yy, zz
        tensor[part, 0, 2] = tensor[part, 2, 0] = xz
        if slopes:
            xxx, xyy, xxz, yyz, xzz = bends
            known = {(0, 0, 0): xxx, (0, 1, 1): xyy, (0, 0, 2): xxz, (1, 1, 2): yyz, (0, 2, 2): xzz}
            for key, value in (known | {(2, 2, 2): -xxz - yyz}).items():
                for i, j, k in set(permutations(key)):
                    slope[part, i, j, k] = value
    return tensor, slope


def _parts(
    radius: float, half: float, rho: Array, z: Array, rules: Sequence[tuple[float, int]]
) -> Iterator[tuple[NDArray[np.intp], Array, int]]:
    """Numbers (k,) of points that a rule does for, widths (k, 1) of the angle that does most there, and its nodes."""
    apart = np.hypot(rho - radius, np.maximum(np.abs(z) - half, 0.0))
    width = np.clip(apart / np.sqrt(np.maximum(rho, 0.1 * radius) * radius), NARROWEST, WIDEST)
    upper = np.inf
    for least, nodes in rules:
        chosen, upper = np.flatnonzero((width >= least) & (width < upper)), least
        for start in range(0, len(chosen), TOGETHER):
            part = chosen[start : start + TOGETHER]
            yield part, width[part, None], nodes


@cache
def _half_kernel(slopes: bool) -> Any:
    """Compiled: what a segment adds, by place (3, n), angle and strength (3, n) and body (2, n), where φ = 0.

    Of the tensor xx, yy, xz, zz, and of its slope xxx, xyy, xxz, yyz, xzz: what is odd in φ vanishes.
    """
    variables = hy.make_vars(*(f"v_{k}" for k in range(8)))
    rho, z, beyond, width, u, strength, radius, half = variables
    angle, weight = width * hy.sinh(u), strength / FOUR_PI * width * hy.cosh(u)
    c, s, sine = hy.cos(angle), hy.sin(angle), hy.sin(0.5 * angle)
    chord = 2.0 * radius * sine * sine
    square, above, below = (rho - radius) ** 2 + 2.0 * rho * chord, z - half, z + half
    a, b = hy.sqrt(square + above**2), hy.sqrt(square + below**2)
    sides, ends, reach, length = above * below, a * b, a + b, 2.0 * half
    # ends - |sides|, which cancel, and sides + |sides|, `beyond` twice, which a fused product would not let cancel
    rest = square * (square + above**2 + below**2) / (ends + hy.sqrt(sides * sides))
    gap = 2.0 * (square + rest + 2.0 * beyond)
    p, q = 2.0 * length * reach / (ends * gap), 2.0 * length * z / (ends * reach)  # P, and 1/a - 1/b
    dx, dy = (rho - radius) + chord, -radius * s
    wc, ws = weight * c, weight * s
    outputs = [wc * dx * p, ws * dy * p, wc * q, -weight * (c * dx + s * dy) * p]
    if slopes:  # by (dP/dD)/D, (dQ/dD)/D and dQ/dz
        bend = 2.0 * reach**2 / gap
        steep = -2.0 * length / (ends * gap) * ((b / a + bend) / a + (a / b + bend) / b)
        cubes = 1.0 / a**3, 1.0 / b**3
        u_slope, v_slope = cubes[1] - cubes[0], below * cubes[1] - above * cubes[0]
        outputs += [wc * (p + dx * dx * steep), wc * (p + dy * dy * steep)]
        outputs += [wc * dx * u_slope, ws * dy * u_slope, wc * v_slope]
    return compiled(hy.cfunc, outputs, variables)


Expression = Any  # A heyoka expression
RESOLVED = 0.4  # distance from the surface from which on the segments do, in edges of a cube of the magnet's volume
MOST = 64  # segments of a mantle; at a quarter of its radius they still do to 1e-6
DIGITS = np.log(1e11)


def segments_field(
    position: Sequence[Expression], body: Cylinder, polarization: Array
) -> tuple[list[Expression], list[list[Expression]]]:
    """B (3) T and its gradient (3 × 3) T/m in the body's own axes, to 1e-10 from where the segments do on.

    At a `position` (three expressions, m, from the centre along the axes of `body`) for a `polarization` (3,) T.
    """
    parts = [_straight_segment(position, row) for row in _segments(body, polarization).tolist()]
    sums = [hy.sum([part[k] for part in parts]) for k in range(8)]
    return sums[:3], whole_gradient(sums[3:])


def outside_derivatives(points: Array, body: Cylinder, polarization: Array, order: int) -> Array:
    """B and its derivatives up to `order` - 1, by their `entries` (n, k), in the body's own axes, outside it.

    B and its slope to 1e-9 of the largest from `BESIDE` radii off. At `points` (n, 3) m from the centre along the body
    axes; `body` and `polarization` are as of `segments_field`; the `order` 1 is B alone.
    """
    turn, rho = np.arctan2(points[:, 1], points[:, 0])[:, None], np.hypot(points[:, 0], points[:, 1])
    found = np.zeros((len(points), order * (order + 2)))
    for radius, share in mantles(body):
        for block, wide, nodes in _parts(radius, body.height / 2, rho, points[:, 2], AROUND):
            u, weights = gauss_legendre(nodes)
            end = np.arcsinh(np.pi / wide)
            given = np.empty((12, len(block), nodes))
            given[:3] = points[block].T[:, :, None]
            given[3], given[4], given[5] = turn[block], wide, u * end
            given[6] = share * radius / FOUR_PI * weights * end
            given[7:] = np.array([body.height, radius, *polarization])[:, None, None]
            sums = _outside_kernel(order)(given.reshape(12, -1)).reshape(-1, len(block), nodes).sum(axis=2)
            found[block] += sums.T
    return found


@cache
def _outside_kernel(order: int) -> Any:
    """Compiled field of a segment and derivatives: (k, n), by place, segment on the mantle, and body (3, 4, 5; n)."""
    variables = hy.make_vars(*(f"v_{k}" for k in range(12)))
    turn, width, u, strength, length, radius, x, y, z = variables[3:]
    angle, strength = turn + width * hy.sinh(u), strength * width * hy.cosh(u)
    cos, sin = hy.cos(angle), hy.sin(angle)
    segment = [length, radius, cos, sin, strength * (x * cos + y * sin), strength * z]
    outputs = _straight_segment(variables[:3], segment)
    known = dict(zip(entries(2), outputs[3:], strict=True))
    outputs += differentiated(known, variables[:3], order)
    return compiled(hy.cfunc, outputs[: order * (order + 2)], variables, fast_math=True)


def _segments(body: Cylinder, polarization: Array) -> Array:
    """Length, radius, cos and sin of the angle, charge and current (n, 6) of segments; J R dφ/4π is their strength."""
    found, wanted = [], RESOLVED * body.volume ** (1 / 3)
    for radius, share in mantles(body):
        count = min(int(np.ceil(DIGITS / np.log1p(wanted / radius))), MOST)
        angle = 2 * np.pi * (np.arange(count) + 0.5) / count
        x, y, z = share * radius / (2 * count) * np.asarray(polarization)
        cos, sin = np.cos(angle), np.sin(angle)
        length, radii, current = (np.full(count, number) for number in (body.height, radius, z))
        found.append(np.column_stack([length, radii, cos, sin, x * cos + y * sin, current]))
    return np.concatenate(found)


def _straight_segment(position: Sequence[Expression], segment: Sequence[Any]) -> list[Expression]:
    """B, and its slopes xx, xy, xz, yy, yz, of a segment's charge and current."""
    (x, y, z), (length, radius, cos, sin, charge, current) = position, segment
    dx, dy = x - radius * cos, y - radius * sin
    square, above, below = dx * dx + dy * dy, z - length * 0.5, z + length * 0.5
    a, b = hy.sqrt(square + above * above), hy.sqrt(square + below * below)
    inverse_a, inverse_b, reach = 1.0 / a, 1.0 / b, a + b
    gap = 1.0 / (reach * reach - length * length)
    ends = inverse_a * inverse_b
    p = 2.0 * length * reach * ends * gap
    q = inverse_a - inverse_b
    bend = 2.0 * reach * reach * gap
    steep = -2.0 * length * ends * gap * ((b * inverse_a + bend) * inverse_a + (a * inverse_b + bend) * inverse_b)
    cube_a, cube_b = inverse_a * inverse_a * inverse_a, inverse_b * inverse_b * inverse_b
    u, v = cube_b - cube_a, below * cube_b - above * cube_a
    along = cos * dx + sin * dy
    return [
        charge * dx * p + current * cos * q,
        charge * dy * p + current * sin * q,
        charge * q - current * along * p,
        charge * (p + dx * dx * steep) + current * cos * dx * u,
        charge * dx * dy * steep + 0.5 * current * (cos * dy + sin * dx) * u,
        charge * dx * u + current * cos * v,
        charge * (p + dy * dy * steep) + current * sin * dy * u,
        charge * dy * u + current * sin * v,
    ]
