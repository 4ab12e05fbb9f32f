"""magpylib with its material response: every cube in n³ cells that magnetise each other, then the field of all."""

import sys
from importlib.metadata import version

import magpylib
from loguru import logger
from magpylib_material_response.demag import apply_demag
from magpylib_material_response.meshing import mesh_Cuboid
from problems import CUBES, EDGE, RECOIL, REMANENCE, points_below, turns
from said import measure, say
from scipy.spatial.transform import Rotation

logger.remove()
case, n, interaction = sys.argv[1], int(sys.argv[2]), sys.argv[3]
points = points_below()


def field():
    """B at the points."""
    cubes = []
    for (center, axis), turn in zip(CUBES[case], turns(case), strict=True):
        cube = magpylib.magnet.Cuboid(
            polarization=[REMANENCE * a for a in axis],
            dimension=[EDGE] * 3,
            position=center,
            orientation=Rotation.from_rotvec(turn),
        )
        cube.susceptibility = RECOIL - 1
        cubes.append(mesh_Cuboid(cube, (n, n, n)))
    cells = magpylib.Collection(cubes)
    apply_demag(cells, inplace=True, interaction=interaction, solver_tol=1e-8)
    return cells.getB(points)


values, seconds = measure(field)
packages = ("magpylib", "magpylib-material-response")
say(values, seconds, len(CUBES[case]) * n**3, {p: version(p) for p in packages}, h=1 / n)
