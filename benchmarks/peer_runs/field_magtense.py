"""MagTense: every cube in n³ prisms that magnetise each other, then the field of all at the points.

Or a cylinder in n rings and 2 n layers of 4 n pieces each."""

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
    if case == "cylinder":
        return of_cylinder()
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


def of_cylinder():
    """The same of the cylinder."""
    rings, around, layers = (np.arange(k) + 0.5 for k in (n, 4 * n, 2 * n))
    sizes = np.array([EDGE / 2 / n, np.pi / 2 / n, EDGE / 2 / n])
    grid = np.stack(np.meshgrid(rings, around, layers, indexing="ij"), axis=-1).reshape(-1, 3) * sizes
    tiles = Tiles(n=len(grid), tile_type=1, center_pos=grid - [0, 0, EDGE / 2], dev_center=sizes, offset=[0, 0, 0],
                  rot=[0, 0, 0], M_rem=REMANENCE / MU_0, easy_axis=axes[0], mu_r_ea=RECOIL, mu_r_oa=RECOIL)  # fmt: skip
    tiles.u_oa1[:], tiles.u_oa2[:] = np.eye(3)[1], np.eye(3)[2]
    iterate_magnetization(tiles, max_error=1e-8)
    return MU_0 * get_H_field(tiles, points)


values, seconds = measure(field)
tiles = (8 if case == "cylinder" else len(centres)) * n**3
say(values, seconds, tiles, {"magtense": version("magtense")}, h=1 / n)
