"""MagTense: every cube in n³ prisms that magnetise each other, then the field of all at the points."""

import sys
from importlib.metadata import version

import numpy as np
from magtense.magstatics import Tiles, get_H_field, iterate_magnetization
from problems import CUBES, EDGE, MU_0, RECOIL, REMANENCE, points_below, turned
from said import measure, say

case, n = sys.argv[1], int(sys.argv[2])
points, angle = np.asfortranarray(points_below()), turned(case)
centres, axes = (np.array(one) for one in zip(*CUBES[case], strict=True))
axes = axes @ np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])


def field():
    """B at the points."""
    cubes = len(centres)
    tiles = Tiles(n=cubes, tile_type=2, size=[EDGE] * 3, offset=centres, rot=[[0.0, -angle, 0.0]] * cubes,
                  M_rem=REMANENCE / MU_0, easy_axis=axes, mu_r_ea=RECOIL, mu_r_oa=RECOIL)  # fmt: skip
    for across in (tiles.u_oa1, tiles.u_oa2):  # they are not of length one where the easy axis is oblique
        across /= np.linalg.norm(across, axis=1)[:, None]
    tiles.refine_prism(list(range(cubes)), [n, n, n])
    tiles.M_rem = REMANENCE / MU_0  # refining leaves the remanence of new tiles at zero
    iterate_magnetization(tiles, max_error=1e-8)
    return MU_0 * get_H_field(tiles, points)


values, seconds = measure(field)
say(values, seconds, len(centres) * n**3, {"magtense": version("magtense")}, h=1 / n)
