"""A rectangular box in any pose: the shape of every magnet and of the plate."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, frozen_array
from .text import millimetres

ROUND_OFF = 4e-16
"""Of the entries of a rotation."""


def rotation_matrix(degrees_xyz: ArrayLike) -> Array:
    """Matrix that turns about the fixed x, then y, then z axis, by angles in degrees.

    Entries within round-off of 0 or ±1 are just that: rotors of one kind are alike in which entries are plain.
    """
    angles = np.radians(np.asarray(degrees_xyz, float))
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)  # SciPy's rotations take longer to load than NumPy
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    matrix = about_z @ about_y @ about_x
    plain = np.round(matrix) + 0.0  # no -0
    return np.asarray(np.where(np.abs(matrix - plain) < ROUND_OFF, plain, matrix))


def rotation_angles(matrix: Array) -> Array:
    """Degrees (3,) about the fixed x, then y, then z axis by which `rotation_matrix` makes this matrix.

    Where y is ±90°, x and z are one turn, and x is 0; elsewhere y is between.
    """
    across = np.hypot(matrix[0, 0], matrix[1, 0])
    x = np.arctan2(matrix[2, 1], matrix[2, 2]) if across > ROUND_OFF else 0.0
    second = matrix[:, 1] * np.cos(x) - matrix[:, 2] * np.sin(x)  # column of the matrix without the turn about x
    return np.degrees([x, np.arctan2(-matrix[2, 0], across), np.arctan2(-second[0], second[1])])


@dataclass(frozen=True, eq=False)
class Box:
    """A rectangular box.

    Parameters
    ----------
    size : (3,) edge lengths along the body axes, m
    center : (3,) position of the centre, m
    rotation : (3, 3) matrix whose columns are the body axes (default: none turned)
    """

    size: Array
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", frozen_array(self.size, (3,)))
        object.__setattr__(self, "center", frozen_array(self.center, (3,)))
        object.__setattr__(self, "rotation", frozen_array(self.rotation, (3, 3)))

    @cached_property
    def half_edges(self) -> Array:
        """(3,) half of each edge, m."""
        return self.size / 2

    @cached_property
    def circumradius(self) -> float:
        """Radius of the smallest sphere about the centre that holds the box, m."""
        return float(np.linalg.norm(self.half_edges))

    @property
    def volume(self) -> float:
        """Volume, m³."""
        return float(np.prod(self.size))

    @property
    def corners(self) -> Array:
        """(8, 3) corner positions, m."""
        signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), -1).reshape(8, 3)
        return self.center + (signs * self.half_edges) @ self.rotation.T

    def to_body(self, points: ArrayLike) -> Array:
        """Coordinates of `points` (..., 3) along the body axes, from the centre, m."""
        return (np.asarray(points, float) - self.center) @ self.rotation

    def reach(self, directions: Array) -> Array:
        """How far (n,) it reaches from its centre along unit vectors (n, 3), m."""
        return np.asarray(np.abs(directions @ self.rotation) @ self.half_edges)

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (...,) of `points` (..., 3) from the surface, m; negative inside."""
        excess = np.abs(self.to_body(points)) - self.half_edges
        outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
        return np.asarray(outside + np.minimum(excess.max(axis=-1), 0.0))

    def edge_distance(self, points: ArrayLike) -> Array:
        """Distances (n,) m of points (n, 3) m from the nearest edge."""
        to_faces = np.abs(self.to_body(points)) - self.half_edges
        along = np.maximum(to_faces, 0.0)
        squares = [to_faces[:, (a + 1) % 3] ** 2 + to_faces[:, (a + 2) % 3] ** 2 + along[:, a] ** 2 for a in range(3)]
        return np.asarray(np.sqrt(np.min(squares, axis=0)))

    def within(self, points: Array) -> Array:
        """Points (n, 3) m of its elements, none of which lies outside of flat faces."""
        return points

    @property
    def shape_numbers(self) -> Array:
        """(3,) m that tell it from another box, but for its pose: its edges."""
        return np.array(self.size)

    @property
    def described_size(self) -> str:
        """Its size as a person writes it, mm."""
        return millimetres(self.size)
