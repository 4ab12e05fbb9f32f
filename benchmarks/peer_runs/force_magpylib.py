"""magpylib: force and torque on a magnetised sphere by getFT, the permeable bodies by its material response.

The cube is n³ cells. The sphere is one cell, exact for what a uniform magnetisation can answer, or about m cubic cells
whose polarisation is scaled to the sphere's volume.
"""

import sys
from importlib.metadata import version

import magpylib
import numpy as np
from loguru import logger
from magpylib_material_response.demag import apply_demag
from magpylib_material_response.meshing import mesh_Cuboid, voxelize
from problems import EDGE, RECOIL, REMANENCE, SPHERE, SPHERE_AXIS, SPHERE_CENTER
from said import measure, say

logger.remove()
case, n, cells = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])


def bodies():
    """The cube and the sphere."""
    cube = magpylib.magnet.Cuboid(polarization=(REMANENCE, 0, 0), dimension=[EDGE] * 3)
    polarization = SPHERE["polarization"] * SPHERE_AXIS
    sphere = magpylib.magnet.Sphere(polarization=polarization, diameter=SPHERE["diameter"], position=SPHERE_CENTER)
    return cube, sphere


def rigid():
    """The step of the differences is 10^-n m."""
    cube, sphere = bodies()
    return magpylib.getFT(cube, sphere, eps=10.0**-n)


def permeable():
    """Force and torque on the sphere's cells, the cube in n³ cells."""
    cube, sphere = bodies()
    cube.susceptibility, sphere.susceptibility = RECOIL - 1, SPHERE["recoil"] - 1
    cube = mesh_Cuboid(cube, (n, n, n))
    if cells == 1:
        target = magpylib.Collection(sphere)
    else:
        target = voxelize(sphere, cells)
        volume = sum(np.prod(cell.dimension) for cell in target)
        for cell in target:
            cell.polarization = np.pi / 6 * SPHERE["diameter"] ** 3 / volume * sphere.polarization
    apply_demag(magpylib.Collection(cube, target), inplace=True, solver_tol=1e-8)
    if cells == 1:
        return magpylib.getFT(cube, sphere)
    return magpylib.getFT(cube, target, meshing=1, pivot=SPHERE_CENTER)


values, seconds = measure(rigid if case == "rigid" else permeable)
values = np.reshape(values, (2, -1, 3)).sum(axis=1)
packages = ("magpylib", "magpylib-material-response")
say(values, seconds, n**3 + cells, {p: version(p) for p in packages}, h=1 / n)
