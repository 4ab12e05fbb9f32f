"""Cylinders and rings as few straight segments, whose field from some distance on is that of the magnet to round-off.

The sums of `round_magnets` over the angle are periodic, so that equal weights at n equal steps err as (1 + d/R)^-n at
the distance d from the mantle.  What is written here as heyoka expressions has no singular
point but the segments themselves.
"""

from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np

from ...geometry.basics import Array, Cylinder, Ring
from .round_magnets import mantles

Expression = Any
"""A heyoka expression."""
RESOLVED = 0.4
"""Distance from the surface from which on the segments do, in edges of a cube of the magnet's volume."""
MOST = 64
"""Segments of a mantle; at a quarter of its radius they still do to 1e-6."""
DIGITS = np.log(1e11)
FOUR_PI = 4 * np.pi


def resolved_distance(body: Cylinder | Ring) -> float:
    """Distance (m) from the surface from which on the segments' field is exact to 1e-10."""
    return float(max(radius * np.expm1(DIGITS / _count(body, radius)) for radius, _ in mantles(body)))


def _count(body: Cylinder | Ring, radius: float) -> int:
    """Number of segments of a mantle."""
    wanted = RESOLVED * body.volume ** (1 / 3)
    return min(int(np.ceil(DIGITS / np.log1p(wanted / radius))), MOST)


def segments_field(
    position: Sequence[Expression], body: Cylinder | Ring, polarization: Array
) -> tuple[list[Expression], list[list[Expression]]]:
    """B and its gradient in the body's own axes from `resolved_distance` on.

    Parameters
    ----------
    position : three expressions, m, from the centre along the body axes
    polarization : (3,) T

    Returns
    -------
    field : three values, T
    gradient : 3 × 3 values, [i][j] = ∂B_i/∂x_j, T/m; symmetric and traceless
    """
    fields, slopes = [], []
    for radius, share in mantles(body):
        count = _count(body, radius)
        for angle in 2 * np.pi * (np.arange(count) + 0.5) / count:
            scale = share * radius / (2 * count)
            field, slope = _segment(position, body.height, radius, float(angle), scale * np.asarray(polarization))
            fields.append(field)
            slopes.append(slope)
    total = [hy.sum([field[i] for field in fields]) for i in range(3)]
    xx, xy, xz, yy, yz = (hy.sum([slope[k] for slope in slopes]) for k in range(5))
    return total, [[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]]


def _segment(
    position: Sequence[Expression], length: float, radius: float, angle: float, strength: Array
) -> tuple[list[Expression], list[Expression]]:
    """B, and its slopes xx, xy, xz, yy, yz, of a segment's charge and current; strength (3,) is J R dφ/4π."""
    x, y, z = position
    cos, sin = float(np.cos(angle)), float(np.sin(angle))
    charge, current = float(strength[0] * cos + strength[1] * sin), float(strength[2])
    dx, dy = x - radius * cos, y - radius * sin
    square, above, below = dx * dx + dy * dy, z - length / 2, z + length / 2
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
    field = [charge * dx * p + current * cos * q, charge * dy * p + current * sin * q, charge * q - current * along * p]
    slopes = [
        charge * (p + dx * dx * steep) + current * cos * dx * u,
        charge * dx * dy * steep + 0.5 * current * (cos * dy + sin * dx) * u,
        charge * dx * u + current * cos * v,
        charge * (p + dy * dy * steep) + current * sin * dy * u,
        charge * dy * u + current * sin * v,
    ]
    return field, slopes
