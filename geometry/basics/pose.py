"""Where a body other than a box is, and what it has in common with one: the box about it."""

from abc import abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, frozen_array
from .box import Box


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
