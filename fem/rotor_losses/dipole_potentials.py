"""Vector potentials of the floater's dipole at given points, and how they change as it moves and turns."""

import numpy as np

from ...geometry.basics import MU_0, Array
from .metal_currents import Potentials


def of_places(positions: Array) -> Potentials:
    """Those of 1 A m² along x, y and z at each of `positions` (k, 3) m: A (n, 3, 3k) T m."""

    def potentials(points: Array) -> Array:
        offset = points[:, None] - positions
        pull = MU_0 / (4 * np.pi) * offset / np.linalg.norm(offset, axis=2)[..., None] ** 3
        found = np.zeros((len(points), 3, len(positions), 3))  # e_i × pull: points, component, place, i
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            found[:, j, :, i], found[:, k, :, i] = -pull[..., k], pull[..., j]
        return found.reshape(len(points), 3, -1)

    return potentials


def of_motion(position: Array, moment: Array) -> Potentials:
    """∂A/∂q (n, 3, 6) for a dipole (3,) A m² at (3,) m: T by its displacement, T m by its turn about x, y and z."""
    turned = np.cross(np.eye(3), moment)

    def potentials(points: Array) -> Array:
        offset = points - position
        distance = np.linalg.norm(offset, axis=1)[:, None]
        across = np.cross(moment, offset)
        moved = [
            3 * across * offset[:, [a]] / distance**5 - np.cross(moment, np.eye(3)[a]) / distance**3 for a in range(3)
        ]
        rotated = [np.cross(way, offset) / distance**3 for way in turned]
        return np.asarray(MU_0 / (4 * np.pi) * np.stack([*moved, *rotated], axis=2))

    return potentials
