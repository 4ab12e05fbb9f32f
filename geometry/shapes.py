"""A rectangular box in any pose: the shape of every magnet and of the plate."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .common import Array, frozen_array, millimetres

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

    size: Array = field(metadata={"units": "m"})
    center: Array = field(default_factory=lambda: np.zeros(3), metadata={"units": "m"})
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


@dataclass(frozen=True, eq=False)
class Cylinder(Posed):
    """A straight round cylinder.

    Parameters
    ----------
    radius, height : m
    center : (3,) position of the centre, m
    rotation : (3, 3) matrix whose columns are the body axes; the third is that of the cylinder (default: none turned)
    """

    radius: float = field(metadata={"units": "m"})
    height: float = field(metadata={"units": "m"})
    center: Array = field(default_factory=lambda: np.zeros(3), metadata={"units": "m"})
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

    radius: float = field(metadata={"units": "m"})
    inner_radius: float = field(metadata={"units": "m"})
    height: float = field(metadata={"units": "m"})
    center: Array = field(default_factory=lambda: np.zeros(3), metadata={"units": "m"})
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


@dataclass(frozen=True, eq=False)
class Sphere(Posed):
    """A ball.

    Parameters
    ----------
    radius : m
    center : (3,) position of the centre, m
    rotation : (3, 3) matrix whose columns are the body axes (default: none turned)
    """

    radius: float = field(metadata={"units": "m"})
    center: Array = field(default_factory=lambda: np.zeros(3), metadata={"units": "m"})
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
