"""A ball in any pose: turned, it only turns its polarisation."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array
from .pose import INSIDE, Posed


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

    @property
    def shape_numbers(self) -> Array:
        """(1,) m: the radius."""
        return np.array([self.radius])

    @property
    def described_size(self) -> str:
        """Shape and size as a person writes them, mm."""
        return f"sphere Ø {self.radius * 2e3:.4g} mm"

    def edge_distance(self, points: ArrayLike) -> Array:
        """Infinite (n,): it has no edge."""
        return np.full(len(np.asarray(points)), np.inf)

    def within(self, points: Array) -> Array:
        """Points (n, 3) m of its elements, those just outside of its surface put just inside it."""
        local, limit = self.to_body(points), self.radius * INSIDE
        size = np.linalg.norm(local, axis=1)
        return np.asarray(self.center + (local * (limit / np.maximum(size, limit))[:, None]) @ self.rotation.T)
