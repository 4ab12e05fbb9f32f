"""scikit-fem: the scalar potential on quadratic tetrahedra; the field from the magnetisation of all elements.

Mesh by Netgen: cubes in a ball of 60 mm, fine in the cubes; outside the potential is that of a dipole on the ball.
"""

import sys
from importlib.metadata import version

import netgen.occ
import numpy as np
import skfem
from problems import CUBES, EDGE, MU_0, RECOIL, REMANENCE, points_below, turned
from said import measure, say
from skfem.helpers import dot, grad

case, size = sys.argv[1], float(sys.argv[2])  # mm
points, angle = points_below(), turned(case)
body = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
BALL, MILLIMETRE = 60.0, 1e-3


def mesh():
    """Tetrahedra (mm) and for each the number of its cube, or -1."""
    half, cubes = 500 * EDGE, []
    for center, _ in CUBES[case]:
        z = 1e3 * center[2]
        cube = netgen.occ.Box((-half, -half, z - half), (half, half, z + half))
        cube = cube.Rotate(netgen.occ.Axis((0, 0, 0), netgen.occ.Y), -np.rad2deg(angle)).mat("cube")
        cube.maxh = size
        cubes.append(cube)
    ball = netgen.occ.Sphere((0, 0, 0), BALL).mat("air")
    whole = netgen.occ.Glue([ball - cubes[0] if len(cubes) == 1 else ball - cubes[0] - cubes[1], *cubes])
    made = netgen.occ.OCCGeometry(whole).GenerateMesh(maxh=20, grading=0.3)
    elements = made.Elements3D().NumPy()
    corners = elements["nodes"][:, :4].astype(int) - 1
    tetrahedra = skfem.MeshTet(made.Coordinates().T, corners.T)
    middle = tetrahedra.p[:, tetrahedra.t].mean(axis=1).T @ body / 1e3
    owner = np.full(len(middle), -1)
    for k, (center, _) in enumerate(CUBES[case]):
        owner[np.abs(middle - center).max(axis=1) < EDGE / 2] = k
    return tetrahedra, owner


def field():
    """B at the points."""
    tetrahedra, owner = mesh()
    everywhere = skfem.Basis(tetrahedra, skfem.ElementTetP2(), intorder=4)
    permeability = np.where(owner >= 0, RECOIL, 1.0)[:, None]
    stiffness = skfem.BilinearForm(lambda u, v, w: w["mu"] * dot(grad(u), grad(v)))
    matrix = stiffness.assemble(everywhere, mu=permeability * np.ones_like(everywhere.dx))
    outer = skfem.FacetBasis(tetrahedra, skfem.ElementTetP2(), intorder=4)
    matrix += skfem.BilinearForm(lambda u, v, w: 2 / BALL * u * v).assemble(outer)
    load, insides = np.zeros(everywhere.N), []
    for k, (_, axis) in enumerate(CUBES[case]):
        inside = skfem.Basis(tetrahedra, skfem.ElementTetP2(), elements=np.nonzero(owner == k)[0], intorder=6)
        remanence = REMANENCE * body @ axis
        load += skfem.LinearForm(lambda v, w, r=remanence: np.einsum("i,i...", r, grad(v))).assemble(inside)
        insides.append((inside, remanence))
    potential = skfem.solve(matrix, load)
    total = np.zeros_like(points)
    for inside, remanence in insides:
        slope = np.asarray(inside.interpolate(potential).grad)
        moment = (remanence[:, None, None] - (RECOIL - 1) * slope) * inside.dx * MILLIMETRE**3 / MU_0
        total += dipoles(np.asarray(inside.global_coordinates()).reshape(3, -1).T * MILLIMETRE, moment.reshape(3, -1).T)
    return total, everywhere.N


def dipoles(places, moments):
    """B (n, 3), T, of many dipoles at the points."""
    found = []
    for point in points:
        apart = point - places
        distance = np.linalg.norm(apart, axis=1)
        along = np.einsum("ij,ij->i", apart, moments)
        found.append(np.sum(3 * apart * (along / distance**5)[:, None] - moments / distance[:, None] ** 3, axis=0))
    return MU_0 / (4 * np.pi) * np.array(found)


(values, unknowns), seconds = measure(field)
say(values, seconds, unknowns, {"scikit-fem": version("scikit-fem")})
