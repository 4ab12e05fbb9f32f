"""MagTense: every cube in n³ prisms that magnetise each other, then the field of all at the points."""

import sys
from importlib.metadata import version

import numpy as np
from magtense.magstatics import Tiles, get_H_field, iterate_magnetization
from problems import CUBES, EDGE, MU_0, RECOIL, REMANENCE, matrices, points_below, turns
from said import measure, say

case, n = sys.argv[1], int(sys.argv[2])
points = np.asfortranarray(points_below())
centres, axes = (np.array(one) for one in zip(*CUBES[case], strict=True))
axes = np.einsum("nij,nj->ni", matrices(case), axes)


def field():
    """B at the points."""
    cubes = len(centres)
    tiles = Tiles(n=cubes, tile_type=2, size=[EDGE] * 3, offset=centres, rot=turns(case).tolist(),
                  M_rem=REMANENCE / MU_0, easy_axis=axes, mu_r_ea=RECOIL, mu_r_oa=RECOIL)  # fmt: skip
    # of its own the transverse axes are not of length one where the easy axis is oblique, and none where it is y
    first = np.cross(axes, np.eye(3)[np.argmin(np.abs(axes), axis=1)])
    tiles.u_oa1[:] = first / np.linalg.norm(first, axis=1)[:, None]
    tiles.u_oa2[:] = np.cross(axes, tiles.u_oa1)
    tiles.refine_prism(list(range(cubes)), [n, n, n])
    tiles.M_rem = REMANENCE / MU_0  # refining leaves the remanence of new tiles at zero
    iterate_magnetization(tiles, max_error=1e-8)
    return MU_0 * get_H_field(tiles, points)


values, seconds = measure(field)
say(values, seconds, len(centres) * n**3, {"magtense": version("magtense")}, h=1 / n)
