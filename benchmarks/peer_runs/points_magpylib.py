"""magpylib: B of one rigid cube at many points; its gradient from central differences."""

import sys
from importlib.metadata import version

import magpylib
from differences import gradient
from problems import COMPARED, EDGE, REMANENCE, points_around
from said import measure, say

points = points_around()
cube = magpylib.magnet.Cuboid(polarization=(REMANENCE, 0, 0), dimension=[EDGE] * 3)
if sys.argv[1] == "field":
    values, seconds = measure(lambda: cube.getB(points))
else:
    values, seconds = measure(lambda: gradient(cube.getB, points, int(sys.argv[2])).reshape(-1, 9))
say(values[COMPARED], seconds, len(points), {"magpylib": version("magpylib")})
