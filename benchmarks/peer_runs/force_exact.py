"""Forty digits of (m·∇)B and m × B: what a rigid sphere feels is exactly what a dipole at its centre feels."""

from importlib.metadata import version

import numpy as np
from exact import field, slope
from problems import MU_0, SPHERE, SPHERE_AXIS, SPHERE_CENTER
from said import measure, say

moment = np.pi / 6 * SPHERE["diameter"] ** 3 * SPHERE["polarization"] / MU_0 * SPHERE_AXIS


def wrench():
    """Force (3,) N and torque (3,) N m on the sphere, to 40 digits."""
    gradient = np.array([float(v) for v in slope(SPHERE_CENTER)]).reshape(3, 3)
    return moment @ gradient, np.cross(moment, [float(v) for v in field(SPHERE_CENTER)])


values, seconds = measure(wrench)
say(values, seconds, 1, {"mpmath": version("mpmath")})
