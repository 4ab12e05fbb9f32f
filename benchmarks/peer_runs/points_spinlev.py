"""spinlev: B and its gradient of one rigid cube at many points, by closed form."""

import sys
from importlib.metadata import version

import numpy as np
from problems import COMPARED, EDGE, REMANENCE, points_around
from said import measure, say

from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry import Box, Magnet

points = points_around()
table = rotor_table((Magnet(Box((EDGE,) * 3, np.zeros(3)), np.array([REMANENCE, 0, 0])),), "cuboid")
(field, gradient), seconds = measure(lambda: table.evaluate(points)[:2], rounds=7)
values = field if sys.argv[1] == "field" else gradient.reshape(-1, 9)
say(values[COMPARED], seconds, len(points), {"spinlev": version("spinlev")})
