"""spinlev: the rotor's table by finite elements to a relative accuracy, from nothing, then the field at the points.

The tilted cube may also be computed as one that lies straight, and turned: a reference without a tilted mesh."""

import sys
from importlib.metadata import version

import numpy as np
from problems import CUBES, EDGE, RECOIL, REMANENCE, points_below, turned
from said import measure, say

from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry import Box, Magnet, tilt

case, rtol = sys.argv[1], float(sys.argv[2])
points = points_below()
rotor = tuple(
    Magnet(Box((EDGE,) * 3, np.array(center)), REMANENCE * np.array(axis), RECOIL) for center, axis in CUBES[case]
)
way = np.eye(3)
if case == "tilted" and "turned" in sys.argv:
    angle = turned(case)
    way = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
elif case == "tilted":
    rotor = tilt(turned(case), EDGE, REMANENCE, RECOIL)


def field():
    """The table, and B at the points."""
    table = rotor_table(rotor, "fem", rtol, nearest=0.007)
    return table, table.evaluate(points @ way)[0] @ way.T


(table, values), seconds = measure(field)
say(values, seconds, 0, {"spinlev": version("spinlev")})
