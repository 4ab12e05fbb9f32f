"""MagTense: B of one rigid prism at many points; its gradient from central differences."""

import sys
from importlib.metadata import version

import numpy as np
from differences import gradient
from magtense.magstatics import Tiles, get_H_field
from problems import COMPARED, EDGE, MU_0, REMANENCE, points_around
from said import measure, say

points = points_around()
tile = Tiles(n=1, tile_type=2, size=[EDGE] * 3, offset=[0.0, 0.0, 0.0], M_rem=REMANENCE / MU_0, easy_axis=[1, 0, 0])


def field(places):
    """B (n, 3) T at places (n, 3) m."""
    parts = np.array_split(places, max(1, len(places) // 100_000))  # its Fortran keeps arrays on the stack
    return MU_0 * np.concatenate([get_H_field(tile, np.asfortranarray(part)) for part in parts])


if sys.argv[1] == "field":
    values, seconds = measure(lambda: field(points))
else:
    values, seconds = measure(lambda: gradient(field, points, int(sys.argv[2])).reshape(-1, 9))
say(values[COMPARED], seconds, len(points), {"magtense": version("magtense")})
