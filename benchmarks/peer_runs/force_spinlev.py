"""spinlev: force and torque on a magnetised sphere, rigid by closed form, permeable by the two-body solution.

The resolution is the number of nodes along an edge of the charges with which the rotor responds.
"""

import sys
from importlib.metadata import version

import numpy as np
from problems import EDGE, RECOIL, REMANENCE, SPHERE, SPHERE_AXIS, SPHERE_CENTER
from said import measure, say

from spinlev.fem.mutual.response import ChargeResponse, two_body
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry import Box, Floater, Magnet

case = sys.argv[1]
nodes = 1 if case == "rigid" else int(sys.argv[2])
cube = Magnet(Box((EDGE,) * 3, np.zeros(3)), np.array([REMANENCE, 0, 0]), 1.0 if case == "rigid" else RECOIL)
recoil = 1.0 if case == "rigid" else SPHERE["recoil"]
floater = Floater(SPHERE["diameter"] / 2, SPHERE["polarization"], recoil, 7500.0)


def rigid():
    """Force (3,) N and torque (3,) N m on the rigid sphere, by the closed form."""
    field, gradient = (value[0] for value in rotor_table((cube,), "cuboid").evaluate(SPHERE_CENTER[None])[:2])
    moment = floater.moment * SPHERE_AXIS
    return moment @ gradient, np.cross(moment, field)


def permeable():
    """The same of two bodies that magnetise each other, by charges on the magnet."""
    total = two_body(ChargeResponse((cube,), nodes), floater, SPHERE_CENTER, SPHERE_AXIS).total
    return total.force, total.torque


values, seconds = measure(rigid if case == "rigid" else permeable)
say(values, seconds, nodes, {"spinlev": version("spinlev")})
