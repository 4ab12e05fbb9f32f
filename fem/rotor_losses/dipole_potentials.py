"""Vector potentials of the floater's dipole at given points, and how they change as it moves and turns."""

import numpy as np

from ...geometry.basics import MU_0, Array
from .metal_currents import Potentials


def of_places(positions: Array) -> Potentials:
    """Those of 1 A m² along x, y and z at each of `positions` (k, 3) m: A (n, 3, 3k) T m."""

    def potentials(points: Array) -> Array:
        offset = [points[:, axis, None] - positions[:, axis] for axis in range(3)]
        square = offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2
        strength = MU_0 / (4 * np.pi) / (square * np.sqrt(square))
        found = np.zeros((len(points), 3, len(positions), 3))  # e_i × pull: points, component, place, i
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            found[:, j, :, i], found[:, k, :, i] = -strength * offset[k], strength * offset[j]
        return found.reshape(len(points), 3, -1)

    return potentials


def of_motion(position: Array, moment: Array) -> Potentials:
    """∂A/∂q (n, 3, 6) for a dipole (3,) A m² at (3,) m: T by its displacement, T m by its turn about x, y and z."""
    turned = np.cross(np.eye(3), moment)
    across = np.cross(moment, np.eye(3))

    def potentials(points: Array) -> Array:
        offset = points - position
        inverse = 1 / np.linalg.norm(offset, axis=1)
        found = np.empty((len(points), 3, 6))
        pull = 3 * (offset @ across) * inverse[:, None] ** 2  # 3 m × r / r²
        for a in range(3):
            found[:, :, a] = (pull * offset[:, [a]] - across[a]) * inverse[:, None] ** 3
            found[:, :, 3 + a] = (offset @ np.cross(turned[a], np.eye(3))) * inverse[:, None] ** 3
        return MU_0 / (4 * np.pi) * found

    return potentials
