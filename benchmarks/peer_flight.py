"""The motion as one would write it with SciPy and magpylib: the peer of the flights' benchmarks."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

EIGHTH_ORDER = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
STEP = 4e-4
"""Of the central differences of eighth order, m: 24 points a gradient, good to 1e-11."""


def fly(scene, magnets, start, duration, rtol):
    """State (12,) after a flight in the rotor's frame, SI units, by DOP853 at relative and absolute tolerance `rtol`.

    Parameters
    ----------
    magnets : the rotor in magpylib
    start : State at t = 0; no drag, gravity along the axis
    """
    floater, rate = scene.floater, np.array([0.0, 0.0, scene.angular_velocity])
    offsets = np.array([k * s * STEP * axis for axis in np.eye(3) for k in (1, 2, 3, 4) for s in (1, -1)])
    units = np.repeat([floater.radius, floater.radius * scene.angular_velocity, 1.0, scene.angular_velocity], 3)

    def slope(_, scaled):
        position, velocity, direction, spin = (scaled * units).reshape(4, 3)
        moment = floater.moment * direction
        field = magnets.getB(position + np.concatenate([np.zeros((1, 3)), offsets]))
        energy = field[1:].reshape(3, 4, 2, 3) @ moment
        force = (energy[:, :, 0] - energy[:, :, 1]) @ EIGHTH_ORDER / STEP
        return np.concatenate([
            velocity - np.cross(rate, position),
            force / floater.mass + scene.gravity - np.cross(rate, velocity),
            np.cross(spin - rate, direction),
            np.cross(moment, field[0]) / floater.inertia - np.cross(rate, spin),
        ]) / units  # fmt: skip

    first = np.concatenate(start.vectors) / units
    return solve_ivp(slope, (0.0, duration), first, "DOP853", rtol=rtol, atol=rtol).y[:, -1] * units
