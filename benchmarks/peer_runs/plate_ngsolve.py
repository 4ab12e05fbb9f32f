"""NGSolve: reaction of the plate to dipoles by the reduced vector potential on tetrahedra, as its tutorials do it.

Hierarchical edge elements of some order, without gradients in the air, a small regularisation there, one sparse factor
for all places; B by reciprocity.
"""

import sys
from importlib.metadata import version

import ngsolve as ng
import numpy as np
from ngsolve_plate import MILLI, dipole, edge_elements, plate_in_air
from problems import CONDUCTIVITY, FREQUENCIES, MOMENTS, MU_0, PLACES
from said import measure, say

frequency, size, order = FREQUENCIES[sys.argv[1]], float(sys.argv[2]), int(sys.argv[3])


def reaction():
    """B (place, 3) that the plate answers to each dipole at its place, and the unknowns."""
    mesh = plate_in_air(size)
    space = edge_elements(mesh, order, complex=True)
    trial, test = space.TnT()
    rate = 2j * np.pi * frequency * MU_0 * CONDUCTIVITY * MILLI**2
    metal = mesh.Materials("plate")
    form = ng.BilinearForm(ng.curl(trial) * ng.curl(test) * ng.dx + 1e-12 * trial * test * ng.dx("air")
                           + rate * trial * test * ng.dx(definedon=metal)).Assemble()  # fmt: skip
    inverse = form.mat.Inverse(space.FreeDofs(), inverse="umfpack")
    found, solution = [], ng.GridFunction(space)
    for place, moment in ((ng.CF(tuple(p)), ng.CF(tuple(m))) for p, m in zip(PLACES, MOMENTS, strict=True)):
        source = dipole(place, moment)
        load = ng.LinearForm(-rate * source * test * ng.dx(definedon=metal, bonus_intorder=4)).Assemble()
        solution.vec.data = inverse * load.vec
        current = -2j * np.pi * frequency * CONDUCTIVITY * MILLI**3 * (source + solution)
        rule = ng.dx(definedon=metal, bonus_intorder=4)
        found.append([ng.Integrate(current * dipole(place, ng.CF(tuple(unit))) * rule, mesh) for unit in np.eye(3)])
    return np.array(found), space.ndof


(values, unknowns), seconds = measure(reaction)
say(values, seconds, unknowns, {"ngsolve": version("ngsolve")})
