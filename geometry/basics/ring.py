"""A ring: a straight round cylinder with a round hole along its axis."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array
from .cylinder import Cylinder
from .pose import Posed


@dataclass(frozen=True, eq=False)
class Ring(Posed):
    """A ring of rectangular section, or tube.

    Parameters
    ----------
    radius, inner_radius, height : m
    center : (3,) position of the centre, m
    rotation : (3, 3) matrix whose columns are the body axes; the third is that of the ring (default: none turned)

    Raises
    ------
    ValueError : the inner radius is not smaller than the outer one
    """

    radius: float
    inner_radius: float
    height: float
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.inner_radius < self.radius:
            raise ValueError(
                f"Input inner_radius must be positive and less than radius {self.radius}; instead received "
                f"{self.inner_radius}."
            )

    @property
    def filled(self) -> Cylinder:
        """The ring without its hole."""
        return Cylinder(self.radius, self.height, self.center, self.rotation)

    @property
    def hole(self) -> Cylinder:
        """The hole."""
        return Cylinder(self.inner_radius, self.height, self.center, self.rotation)

    @property
    def size(self) -> Array:
        """(3,) edges of the box about it, along the body axes, m."""
        return self.filled.size

    @property
    def circumradius(self) -> float:
        """Radius of the smallest sphere about the centre that holds the ring, m."""
        return self.filled.circumradius

    @property
    def volume(self) -> float:
        """Volume, m³."""
        return self.filled.volume - self.hole.volume

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (...,) of `points` (..., 3) from the surface, m; negative inside, positive in the hole."""
        radial, height = self._off_axis(points)
        middle, width = (self.radius + self.inner_radius) / 2, self.radius - self.inner_radius
        excess = np.stack([np.abs(radial - middle) - width / 2, np.abs(height) - self.height / 2], axis=-1)
        outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
        return np.asarray(outside + np.minimum(excess.max(axis=-1), 0.0))

    def reach(self, directions: Array) -> Array:
        """How far (n,) it reaches from its centre along unit vectors (n, 3), m."""
        return self.filled.reach(directions)

    @property
    def shape_numbers(self) -> Array:
        """(4,) m: both radii, height, and zero."""
        return np.array([self.radius, self.inner_radius, self.height, 0.0])

    @property
    def described_size(self) -> str:
        """Shape and size as a person writes them, mm."""
        return f"ring Ø {self.radius * 2e3:.4g} / {self.inner_radius * 2e3:.4g} × {self.height * 1e3:.4g} mm"

    def edge_distance(self, points: ArrayLike) -> Array:
        """Distances (n,) m of points (n, 3) m from the nearest edge."""
        return self._off_circles(points, [self.radius, self.inner_radius])

    def within(self, points: Array) -> Array:
        """Points (n, 3) m of its elements, those just outside of its surface put just inside it."""
        return self._between(points, self.inner_radius, self.radius)
