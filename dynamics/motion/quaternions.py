"""Unit quaternions, w first, of rotations: for arrays and for expressions."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...geometry.common import Array


def rotation_of(quaternion: Sequence[Any]) -> list[list[Any]]:
    """(3, 3) rotation by a unit quaternion (4,), w first."""
    w, x, y, z = (2.0 * part for part in quaternion)
    _, b, c, d = quaternion
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * b, y * c, z * d, x * c, x * d, y * d, w * b, w * c, w * d
    return [
        [1.0 - (yy + zz), xy - wz, xz + wy],
        [xy + wz, 1.0 - (xx + zz), yz - wx],
        [xz - wy, yz + wx, 1.0 - (xx + yy)],
    ]


def matrices_of(quaternions: Array) -> Array:
    """(..., 3, 3) rotations by unit quaternions (..., 4), w first."""
    rows = rotation_of(list(np.moveaxis(quaternions, -1, 0)))
    return np.moveaxis(np.array([[entry + 0 * quaternions[..., 0] for entry in row] for row in rows]), (0, 1), (-2, -1))


def quaternions_of(matrices: Array) -> Array:
    """(..., 4) unit quaternions of rotations (..., 3, 3), w first and not negative.

    By the largest eigenvector of a symmetric matrix (I. Y. Bar-Itzhack, J. Guid. Control Dyn. 23 (2000) 1085).
    """
    m = np.asarray(matrices, float)
    squares = np.empty((*m.shape[:-2], 4, 4))
    squares[..., 0, 0] = np.trace(m, axis1=-2, axis2=-1)
    squares[..., 1:, 1:] = m + m.swapaxes(-1, -2) - squares[..., 0, 0, None, None] * np.eye(3)
    screw = np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1)
    squares[..., 0, 1:] = squares[..., 1:, 0] = screw
    found = np.linalg.eigh(squares)[1][..., -1]
    return np.asarray(found * np.where(found[..., :1] < 0, -1.0, 1.0))


def left_product(vector: Sequence[Any], quaternion: Sequence[Any]) -> list[Any]:
    """A vector (3) as a pure quaternion times a quaternion (4): twice its rate by that spin along the outer axes."""
    (a, b, c), (w, x, y, z) = vector, quaternion
    return [-a * x - b * y - c * z, a * w + b * z - c * y, b * w + c * x - a * z, c * w + a * y - b * x]
