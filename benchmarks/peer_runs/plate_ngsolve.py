"""NGSolve: reaction of the plate to dipoles by the reduced vector potential on tetrahedra, as its tutorials do it.

Hierarchical edge elements of some order, without gradients in the air, a small regularisation there, one sparse factor
for all places; B by reciprocity.
"""

import sys
from importlib.metadata import version

import ngsolve as ng
import numpy as np
from netgen.occ import Box, Glue, OCCGeometry
from problems import CONDUCTIVITY, FREQUENCIES, MOMENTS, MU_0, PLACES, PLATE_SIZE
from said import measure, say

frequency, size, order = FREQUENCIES[sys.argv[1]], float(sys.argv[2]), int(sys.argv[3])
MILLI = 1e-3  # the mesh is in millimetres


def dipole(place, moment):
    """Vector potential of a dipole, T m."""
    apart = ng.CF((ng.x, ng.y, ng.z)) * MILLI - ng.CF(tuple(place))
    return MU_0 / (4 * np.pi) * ng.Cross(ng.CF(tuple(moment)), apart) / (apart * apart) ** 1.5


def reaction():
    half = [500 * s for s in PLATE_SIZE]
    plate = Box(tuple(-h for h in half), tuple(half)).mat("plate")
    plate.maxh = size
    air = Box((-300, -300, -300), (300, 300, 300)).mat("air")
    air.faces.name = "far"
    mesh = ng.Mesh(OCCGeometry(Glue([plate, air - plate])).GenerateMesh(maxh=100, grading=0.4))
    space = ng.HCurl(
        mesh, order=order, complex=True, dirichlet="far", gradientdomains=[m == "plate" for m in mesh.GetMaterials()]
    )
    trial, test = space.TnT()
    rate = 2j * np.pi * frequency * MU_0 * CONDUCTIVITY * MILLI**2
    metal = mesh.Materials("plate")
    form = ng.BilinearForm(ng.curl(trial) * ng.curl(test) * ng.dx + 1e-12 * trial * test * ng.dx("air")
                           + rate * trial * test * ng.dx(definedon=metal)).Assemble()  # fmt: skip
    inverse = form.mat.Inverse(space.FreeDofs(), inverse="umfpack")
    found, solution = [], ng.GridFunction(space)
    units = np.eye(3)
    for place, moment in zip(PLACES, MOMENTS, strict=True):
        source = dipole(place, moment)
        load = ng.LinearForm(-rate * source * test * ng.dx(definedon=metal, bonus_intorder=4)).Assemble()
        solution.vec.data = inverse * load.vec
        current = -2j * np.pi * frequency * CONDUCTIVITY * MILLI**3 * (source + solution)
        rule = ng.dx(definedon=metal, bonus_intorder=4)
        found.append([ng.Integrate(current * dipole(place, unit) * rule, mesh) for unit in units])
    return np.array(found), space.ndof


(values, unknowns), seconds = measure(reaction)
say(values, seconds, unknowns, {"ngsolve": version("ngsolve")})
