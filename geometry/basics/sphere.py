"""A ball in any pose: turned, it only turns its polarisation."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array
from .pose import Posed


@dataclass(frozen=True, eq=False)
class Sphere(Posed):
    """A ball.

    Parameters
    ----------
    radius : m
    center : (3,) position of the centre, m
    rotation : (3, 3) matrix whose columns are the body axes (default: none turned)
    """

    radius: float
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    @property
    def size(self) -> Array:
        """(3,) edges of the box about it, along the body axes, m."""
        return np.full(3, 2 * self.radius)

    @property
    def circumradius(self) -> float:
        """Its radius, m."""
        return self.radius

    @property
    def volume(self) -> float:
        """Volume, m³."""
        return float(4 / 3 * np.pi * self.radius**3)

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (...,) of `points` (..., 3) from the surface, m; negative inside."""
        return np.asarray(np.linalg.norm(np.asarray(points, float) - self.center, axis=-1) - self.radius)

    def reach(self, directions: Array) -> Array:
        """How far (n,) it reaches from its centre along unit vectors (n, 3), m."""
        return np.full(len(directions), self.radius)
