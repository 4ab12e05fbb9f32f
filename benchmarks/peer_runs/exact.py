"""Forty-digit values of B and its gradient of one rigid cube, from the antiderivatives of the charges on its faces."""

import mpmath as mp
from problems import EDGE, REMANENCE

mp.mp.dps = 40
HALF = mp.mpf(EDGE) / 2


def corners(point):
    """Sign and place relative to each of the eight corners."""
    for i in (-1, 1):
        for j in (-1, 1):
            for k in (-1, 1):
                yield i * j * k, [mp.mpf(c) - s * HALF for c, s in zip(point, (i, j, k), strict=True)]


def field(point):
    """B (3,) T of a cube that is magnetised along x."""
    total = [mp.mpf(0)] * 3
    for sign, (x, y, z) in corners(point):
        r = mp.sqrt(x * x + y * y + z * z)
        parts = (mp.atan(y * z / (x * r)), -mp.log(r + z), -mp.log(r + y))
        total = [t - sign * p for t, p in zip(total, parts, strict=True)]
    return [mp.mpf(REMANENCE) / (4 * mp.pi) * -t for t in total]


def slope(point):
    """dB_i/dx_j, row by row, T/m."""
    step = mp.mpf(10) ** -12
    rows = [[] for _ in range(3)]
    for j in range(3):
        up, down = ([mp.mpf(c) + s * step * (i == j) for i, c in enumerate(point)] for s in (1, -1))
        for row, a, b in zip(rows, field(up), field(down), strict=True):
            row.append((a - b) / (2 * step))
    return [value for row in rows for value in row]
