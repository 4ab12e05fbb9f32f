"""A straight round cylinder in any pose: the shape of a shaft, a spacer or a disc."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array
from .pose import Posed


@dataclass(frozen=True, eq=False)
class Cylinder(Posed):
    """A straight round cylinder.

    Parameters
    ----------
    radius, height : m
    center : (3,) position of the centre, m
    rotation : (3, 3) matrix whose columns are the body axes; the third is that of the cylinder (default: none turned)
    """

    radius: float
    height: float
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    @property
    def size(self) -> Array:
        """(3,) edges of the box about it, along the body axes, m."""
        return np.array([2 * self.radius, 2 * self.radius, self.height])

    @property
    def circumradius(self) -> float:
        """Radius of the smallest sphere about the centre that holds the cylinder, m."""
        return float(np.hypot(self.radius, self.height / 2))

    @property
    def volume(self) -> float:
        """Volume, m³."""
        return float(np.pi * self.radius**2 * self.height)

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (...,) of `points` (..., 3) from the surface, m; negative inside."""
        radial, height = self._off_axis(points)
        excess = np.stack([radial - self.radius, np.abs(height) - self.height / 2], axis=-1)
        outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
        return np.asarray(outside + np.minimum(excess.max(axis=-1), 0.0))

    def reach(self, directions: Array) -> Array:
        """How far (n,) it reaches from its centre along unit vectors (n, 3), m."""
        along = np.abs(directions @ self.rotation[:, 2])
        across = np.sqrt(np.maximum(1 - along**2, 0.0))
        return np.asarray(self.radius * across + self.height / 2 * along)

    @property
    def shape_numbers(self) -> Array:
        """(2,) m: radius and height."""
        return np.array([self.radius, self.height])

    @property
    def described_size(self) -> str:
        """Its size as a person writes it, mm."""
        return f"Ø {self.radius * 2e3:.4g} × {self.height * 1e3:.4g} mm"

    def edge_distance(self, points: ArrayLike) -> Array:
        """Distances (n,) m of points (n, 3) m from the nearest edge."""
        return self._off_circles(points, [self.radius])

    def within(self, points: Array) -> Array:
        """Points (n, 3) m of its elements, those just outside of its surface put just inside it."""
        return self._between(points, 0.0, self.radius)
