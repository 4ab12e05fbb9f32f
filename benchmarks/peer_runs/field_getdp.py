"""GetDP: the scalar potential on quadratic tetrahedra of Gmsh; the field from the magnetisation of all elements."""

import sys

import numpy as np
from getdp import lists_file, solve, versions
from problems import CUBES, points_below, turned
from said import measure, say

case, size = sys.argv[1], float(sys.argv[2])  # mm


def field():
    """B at the points, in files as GetDP writes them, and its unknowns."""
    files = {"points.pro": lists_file(p=points_below())}
    return solve("field", "Static", files, ["Field"], size=1e-3 * size, cubes=len(CUBES[case]), angle=turned(case))


(texts, unknowns), seconds = measure(field)
values = np.array([line.split()[-3:] for line in texts["b.txt"].splitlines() if line.strip()], float)
say(values, seconds, unknowns, versions())
