"""MagTense: a cube of n³ prisms and a sphere as one tile that magnetise each other; then (m·∇)B and m × B by hand."""

import sys
from importlib.metadata import version

import numpy as np
from differences import gradient
from magtense.magstatics import Tiles, get_H_field, iterate_magnetization
from problems import EDGE, MU_0, RECOIL, REMANENCE, SPHERE, SPHERE_AXIS, SPHERE_CENTER
from said import measure, say

n, radius = int(sys.argv[2]), SPHERE["diameter"] / 2


def wrench():
    """Force (3,) N and torque (3,) N m on the sphere."""
    tiles = Tiles(n=2, tile_type=[6, 2], size=[[radius, 0, 0], [EDGE] * 3], offset=[SPHERE_CENTER, np.zeros(3)],
                  M_rem=REMANENCE / MU_0, easy_axis=[SPHERE_AXIS, np.array([1.0, 0, 0])], mu_r_ea=RECOIL,
                  mu_r_oa=RECOIL)  # fmt: skip
    for across in (tiles.u_oa1, tiles.u_oa2):  # they are not of length one where the easy axis is oblique
        across /= np.linalg.norm(across, axis=1)[:, None]
    tiles.refine_prism(1, [n, n, n])
    tiles.M_rem = REMANENCE / MU_0  # refining leaves the remanence of new tiles at zero
    iterate_magnetization(tiles, max_error=1e-8)
    moment = 4 / 3 * np.pi * radius**3 * tiles.M[0]
    cube = Tiles(n=n**3, tile_type=2, size=tiles.size[1:], offset=tiles.offset[1:], M_rem=0.0)
    cube.M = tiles.M[1:]

    def field(points):
        return MU_0 * get_H_field(cube, np.asfortranarray(points))

    force = moment @ gradient(field, SPHERE_CENTER[None], 4)[0]
    return force, np.cross(moment, field(SPHERE_CENTER[None])[0])


values, seconds = measure(wrench)
say(values, seconds, n**3 + 1, {"magtense": version("magtense")}, h=1 / n)
