"""GetDP: reaction of the plate to dipoles, edge elements on Gmsh's tetrahedra, first or second order."""

import sys

import numpy as np
from getdp import lists_file, solve, versions
from problems import FREQUENCIES, MOMENTS, PLACES
from said import measure, say

frequency, size, order = FREQUENCIES[sys.argv[1]], float(sys.argv[2]), int(sys.argv[3])


def reaction():
    """What the plate answers to the dipoles, in files as GetDP writes them, and its unknowns."""
    files = {"points.pro": lists_file(p=PLACES, m=MOMENTS)}
    return solve("plate", "Currents", files, [], frequency=frequency, size=1e-3 * size, second=order - 1)


(texts, unknowns), seconds = measure(reaction)
rows = np.array([texts[f"b{k}.txt"].split()[-6:] for k in range(len(PLACES))], float)
say(rows[:, :3] + 1j * rows[:, 3:], seconds, unknowns, versions(), h=size)
