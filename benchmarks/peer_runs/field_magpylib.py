"""magpylib with its material response: every cube in n³ cells that magnetise each other, then the field of all.

Or a cylinder in about 8 n³."""

import sys
from importlib.metadata import version

import magpylib
from loguru import logger
from magpylib_material_response.demag import apply_demag
from magpylib_material_response.meshing import mesh_Cuboid, mesh_Cylinder
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
        common = {"position": center, "orientation": Rotation.from_rotvec(turn)}
        common["polarization"] = [REMANENCE * a for a in axis]
        if case == "cylinder":
            body = magpylib.magnet.Cylinder(dimension=[EDGE] * 2, **common)
            mesh, parts = mesh_Cylinder, (4 * n, n, 2 * n)
        else:
            body, mesh, parts = magpylib.magnet.Cuboid(dimension=[EDGE] * 3, **common), mesh_Cuboid, (n, n, n)
        body.susceptibility = RECOIL - 1
        cubes.append(mesh(body, parts))
    cells = magpylib.Collection(cubes)
    apply_demag(cells, inplace=True, interaction=interaction, solver_tol=1e-8)
    return cells.getB(points)


values, seconds = measure(field)
packages = ("magpylib", "magpylib-material-response")
cells = (8 if case == "cylinder" else len(CUBES[case])) * n**3
say(values, seconds, cells, {p: version(p) for p in packages}, h=1 / n)
