"""Where a body other than a box is, and what it has in common with one: the box about it."""

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, frozen_array
from .box import Box

INSIDE = 1 - 1e-9
"""Just inside of a surface, in radii."""


class Posed:
    """A body with a centre, body axes, and edges of the box about it along those axes."""

    center: Array
    rotation: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen_array(self.center, (3,)))
        object.__setattr__(self, "rotation", frozen_array(self.rotation, (3, 3)))

    @property
    @abstractmethod
    def size(self) -> Array:
        """(3,) edges of the box about it, along the body axes, m."""

    @property
    @abstractmethod
    def shape_numbers(self) -> Array:
        """Numbers (n,) m that tell it from another of its shape, but for its pose; how many they are tells the shape.

        A cuboid has three, its edges; a sphere one; a cylinder two; a ring four; a part eight, of its file's digest.
        """

    @property
    @abstractmethod
    def described_size(self) -> str:
        """Shape and size as a person writes them, mm."""

    @abstractmethod
    def edge_distance(self, points: ArrayLike) -> Array:
        """Distances (n,) m of points (n, 3) m from the nearest edge; infinite where it has none."""

    @abstractmethod
    def within(self, points: Array) -> Array:
        """Points (n, 3) m of its elements, those just outside of a round surface put just inside it."""

    @property
    def half_edges(self) -> Array:
        """(3,) half of each edge of the box about it, m."""
        return self.size / 2

    @property
    def box(self) -> Box:
        """The box about it, along the body axes."""
        return Box(self.size, self.center, self.rotation)

    @property
    def corners(self) -> Array:
        """(8, 3) corners of the box about it, m."""
        return self.box.corners

    def to_body(self, points: ArrayLike) -> Array:
        """Coordinates of `points` (..., 3) along the body axes, from the centre, m."""
        return (np.asarray(points, float) - self.center) @ self.rotation

    def _off_axis(self, points: ArrayLike) -> tuple[Array, Array]:
        """Distance from the body's z axis and height along it (...,) of `points` (..., 3), m."""
        body = self.to_body(points)
        return np.hypot(body[..., 0], body[..., 1]), body[..., 2]

    def _between(self, points: Array, inner: float, outer: float) -> Array:
        """Points (n, 3) m put just inside of two radii about the body's z axis, and of its faces across it."""
        local = self.to_body(points)
        across = np.hypot(local[:, 0], local[:, 1])
        wanted = np.clip(across, inner / INSIDE, outer * INSIDE)
        local[:, :2] *= (wanted / np.maximum(across, np.finfo(float).tiny))[:, None]
        limit = INSIDE * self.half_edges[2]
        local[:, 2] = np.clip(local[:, 2], -limit, limit)
        return np.asarray(self.center + local @ self.rotation.T)

    def _off_circles(self, points: ArrayLike, radii: Sequence[float]) -> Array:
        """Distances (n,) m of points (n, 3) m from circles of these radii about both faces across the axis."""
        across, height = self._off_axis(points)
        apart = np.abs(height) - self.half_edges[2]
        return np.asarray(np.min([np.hypot(across - radius, apart) for radius in radii], axis=0))
