"""Solids in any pose: boxes, cylinders, rings and spheres, and what is common to all bodies."""

from abc import abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .common import Array, freeze, millimetres

ROUND_OFF = 4e-16  # Of the entries of a rotation
INSIDE = 1 - 1e-9  # Just inside of a surface, in radii


def rotation_matrix(degrees_xyz: ArrayLike) -> Array:
    """Matrix that turns about the fixed x, then y, then z axis, by angles in degrees.

    Entries within round-off of 0 or ±1 are just that: rotors of one kind are alike in which entries are plain.
    """
    angles = np.radians(np.asarray(degrees_xyz, float))
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    matrix = about_z @ about_y @ about_x
    plain = np.round(matrix) + 0.0  # no -0
    return np.asarray(np.where(np.abs(matrix - plain) < ROUND_OFF, plain, matrix))


def rotation_angles(matrix: Array) -> Array:
    """Degrees (3,) about fixed x, y and z of a `rotation_matrix`; where y is ±90°, x is 0."""
    across = np.hypot(matrix[0, 0], matrix[1, 0])
    x = np.arctan2(matrix[2, 1], matrix[2, 2]) if across > ROUND_OFF else 0.0
    second = matrix[:, 1] * np.cos(x) - matrix[:, 2] * np.sin(x)  # column of the matrix without the turn about x
    return np.degrees([x, np.arctan2(-matrix[2, 0], across), np.arctan2(-second[0], second[1])])


METRES = {"units": "m"}  # of a field of a dataclass


def at_origin() -> Array:
    return np.zeros(3)


def unturned() -> Array:
    return np.eye(3)


class Body:
    """A solid with a centre (3,) m, a rotation (3, 3), its columns the body axes, and a box of edges `size` (3,) m."""

    kind: ClassVar[str]
    center: Array
    rotation: Array

    if TYPE_CHECKING:  # fields of some bodies; properties here would be the fields' defaults

        @property
        def size(self) -> Array: ...
        @property
        def volume(self) -> float: ...  # m³
        @property
        def area(self) -> float: ...  # of the surface, m²

    def __post_init__(self) -> None:
        freeze(self, center=(3,), rotation=(3, 3))

    @property
    def mirrors(self) -> tuple[int, ...]:
        """Body axes across which a plane through the centre mirrors it onto itself."""
        return 0, 1, 2

    @property
    @abstractmethod
    def circumradius(self) -> float:
        """Radius of the smallest sphere about the centre that holds the body, m."""

    @property
    @abstractmethod
    def shape_numbers(self) -> Array:
        """Numbers (n,) m that distinguish it from others but for its pose; how many they are gives the shape.

        A cuboid has three, its edges; a sphere one; a cylinder two; a ring four; a part eight, of its file's digest.
        """

    @property
    @abstractmethod
    def described_size(self) -> str:
        """Shape and size as a person writes them, mm."""

    @property
    @abstractmethod
    def keys(self) -> dict[str, Any]:
        """What a scene file says of its shape; lengths in mm, lists as arrays."""

    @abstractmethod
    def reach(self, directions: Array) -> Array:
        """Extent (n,) from its centre along unit vectors (n, 3), m, or against them if that is more."""

    @abstractmethod
    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (...,) of `points` (..., 3) from the surface, m; negative inside."""

    @abstractmethod
    def edge_distance(self, points: ArrayLike) -> Array:
        """Distances (n,) m of points (n, 3) m from the nearest edge; infinite where it has none."""

    def support(self, directions: Array) -> Array:
        """Extent (n,) from its centre along unit vectors (n, 3), m."""
        return self.reach(directions)

    def within(self, points: Array) -> Array:
        """Points (n, 3) m of its elements, those just outside of a round surface put just inside it."""
        return points

    @cached_property
    def half_edges(self) -> Array:
        """(3,) half of each edge of the box about it, m."""
        return self.size / 2

    @cached_property
    def box(self) -> "Box":
        """The box about it, along the body axes: itself where it is one."""
        return Box(self.size, self.center, self.rotation)

    @property
    def placed(self) -> "tuple[Any, ...]":
        """The solids that it is made of, where they are: itself."""
        return (self,)

    @property
    def blocks(self) -> list[tuple[Array, Array]]:
        """Centre and half edges (3,) m of the box about each of these, along the body axes from the centre."""
        return [(np.zeros(3), self.half_edges)]

    @property
    def corners(self) -> Array:
        """(8, 3) corners of the box about it, m."""
        signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), -1).reshape(8, 3)
        return self.center + (signs * self.half_edges) @ self.rotation.T

    def farthest(self, point: Array) -> float:
        """Distance from a point (3,) that no point of the body exceeds, m; exact for a cuboid."""
        return float(np.linalg.norm(self.center - point)) + self.circumradius

    def to_body(self, points: ArrayLike) -> Array:
        """Coordinates of `points` (..., 3) along the body axes, from the centre, m."""
        return (np.asarray(points, float) - self.center) @ self.rotation


def _from_excess(excess: Array) -> Array:
    """Signed distance (...,) of points that lie so far beyond faces square to each other (..., n), m."""
    return np.asarray(np.linalg.norm(np.maximum(excess, 0.0), axis=-1) + np.minimum(excess.max(axis=-1), 0.0))


@dataclass(frozen=True, eq=False)
class Box(Body):
    """A rectangular box with edges `size` (3,) m along the body axes."""

    size: Array = field(metadata=METRES)
    center: Array = field(default_factory=at_origin, metadata=METRES)
    rotation: Array = field(default_factory=unturned)
    kind: ClassVar[str] = "cuboid"

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, size=(3,))

    @cached_property
    def box(self) -> "Box":
        return self

    @cached_property
    def circumradius(self) -> float:
        return float(np.linalg.norm(self.half_edges))

    def farthest(self, point: Array) -> float:
        return float(np.linalg.norm(self.corners - point, axis=1).max())

    @property
    def volume(self) -> float:
        return float(np.prod(self.size))

    @property
    def area(self) -> float:
        return 2 * float(self.size @ np.roll(self.size, 1))

    @property
    def shape_numbers(self) -> Array:
        return np.array(self.size)

    @property
    def described_size(self) -> str:
        return millimetres(self.size)

    @property
    def keys(self) -> dict[str, Any]:
        return {"size_mm": 1e3 * self.size}

    def reach(self, directions: Array) -> Array:
        return np.asarray(np.abs(directions @ self.rotation) @ self.half_edges)

    def distance(self, points: ArrayLike) -> Array:
        return _from_excess(np.abs(self.to_body(points)) - self.half_edges)

    def edge_distance(self, points: ArrayLike) -> Array:
        to_faces = np.abs(self.to_body(points)) - self.half_edges
        along = np.maximum(to_faces, 0.0)
        squares = [to_faces[:, (a + 1) % 3] ** 2 + to_faces[:, (a + 2) % 3] ** 2 + along[:, a] ** 2 for a in range(3)]
        return np.asarray(np.sqrt(np.min(squares, axis=0)))


@dataclass(frozen=True, eq=False)
class Cylinder(Body):
    """A cylinder about the body's z, solid or with a hole. Raises ValueError: a hole not within it."""

    radius: float = field(metadata=METRES)
    height: float = field(metadata=METRES)
    center: Array = field(default_factory=at_origin, metadata=METRES)
    rotation: Array = field(default_factory=unturned)
    inner_radius: float = field(default=0.0, metadata=METRES)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.inner_radius < self.radius:
            raise ValueError(
                f"Input inner_radius must be zero or positive and less than radius {self.radius}; instead received "
                f"{self.inner_radius}."
            )

    @property
    def kind(self) -> str:  # type: ignore[override]
        return "ring" if self.inner_radius else "cylinder"

    @property
    def size(self) -> Array:
        return np.array([2 * self.radius, 2 * self.radius, self.height])

    @property
    def circumradius(self) -> float:
        return float(np.hypot(self.radius, self.height / 2))

    @property
    def volume(self) -> float:
        return float(np.pi * (self.radius**2 - self.inner_radius**2) * self.height)

    @property
    def area(self) -> float:
        hole = self.inner_radius
        return float(2 * np.pi * (self.radius + hole) * (self.radius - hole + self.height))

    @property
    def shape_numbers(self) -> Array:
        hole, solid = [self.radius, self.inner_radius, self.height, 0.0], [self.radius, self.height]
        return np.array(hole if self.inner_radius else solid)

    @property
    def described_size(self) -> str:
        name, hole = ("ring ", f" / {self.inner_radius * 2e3:.4g}") if self.inner_radius else ("", "")
        return f"{name}Ø {self.radius * 2e3:.4g}{hole} × {self.height * 1e3:.4g} mm"

    @property
    def keys(self) -> dict[str, Any]:
        solid = {"shape": self.kind, "diameter_mm": 2e3 * self.radius, "height_mm": 1e3 * self.height}
        return solid | ({"inner_diameter_mm": 2e3 * self.inner_radius} if self.inner_radius else {})

    def reach(self, directions: Array) -> Array:
        along = np.abs(directions @ self.rotation[:, 2])
        return np.asarray(self.radius * np.sqrt(np.maximum(1 - along**2, 0.0)) + self.height / 2 * along)

    def distance(self, points: ArrayLike) -> Array:
        across, height = self._off_axis(points)
        beside = across - self.radius
        if self.inner_radius:  # else the axis would be a face
            beside = np.maximum(beside, self.inner_radius - across)
        return _from_excess(np.stack([beside, np.abs(height) - self.height / 2], axis=-1))

    def edge_distance(self, points: ArrayLike) -> Array:
        across, height = self._off_axis(points)
        apart = np.abs(height) - self.height / 2
        radii = [radius for radius in (self.radius, self.inner_radius) if radius]
        return np.asarray(np.min([np.hypot(across - radius, apart) for radius in radii], axis=0))

    def within(self, points: Array) -> Array:
        local = self.to_body(points)
        across = np.hypot(local[:, 0], local[:, 1])
        wanted = np.clip(across, self.inner_radius / INSIDE, self.radius * INSIDE)
        local[:, :2] *= (wanted / np.maximum(across, np.finfo(float).tiny))[:, None]
        limit = INSIDE * self.height / 2
        local[:, 2] = np.clip(local[:, 2], -limit, limit)
        return np.asarray(self.center + local @ self.rotation.T)

    def _off_axis(self, points: ArrayLike) -> tuple[Array, Array]:
        """Distance from the body's z axis and height along it (...,) of `points` (..., 3), m."""
        body = self.to_body(points)
        return np.hypot(body[..., 0], body[..., 1]), body[..., 2]


def ring(radius: float, inner_radius: float, height: float, *pose: ArrayLike) -> Cylinder:
    """A cylinder with a hole: `radius`, `inner_radius`, `height` m; `pose` is centre (3,) m and rotation, or less."""
    return Cylinder(radius, height, *pose, inner_radius=inner_radius)  # type: ignore[arg-type, misc]


@dataclass(frozen=True, eq=False)
class Sphere(Body):
    """A ball."""

    radius: float = field(metadata=METRES)
    center: Array = field(default_factory=at_origin, metadata=METRES)
    rotation: Array = field(default_factory=unturned)
    kind: ClassVar[str] = "sphere"

    @property
    def size(self) -> Array:
        return np.full(3, 2 * self.radius)

    @property
    def circumradius(self) -> float:
        return self.radius

    @property
    def volume(self) -> float:
        return float(4 / 3 * np.pi * self.radius**3)

    @property
    def area(self) -> float:
        return float(4 * np.pi * self.radius**2)

    @property
    def shape_numbers(self) -> Array:
        return np.array([self.radius])

    @property
    def described_size(self) -> str:
        return f"sphere Ø {self.radius * 2e3:.4g} mm"

    @property
    def keys(self) -> dict[str, Any]:
        return {"shape": self.kind, "diameter_mm": 2e3 * self.radius}

    def reach(self, directions: Array) -> Array:
        return np.full(len(directions), self.radius)

    def distance(self, points: ArrayLike) -> Array:
        return np.asarray(np.linalg.norm(np.asarray(points, float) - self.center, axis=-1) - self.radius)

    def edge_distance(self, points: ArrayLike) -> Array:
        return np.full(len(np.asarray(points)), np.inf)

    def within(self, points: Array) -> Array:
        local, limit = self.to_body(points), self.radius * INSIDE
        size = np.linalg.norm(local, axis=1)
        return np.asarray(self.center + (local * (limit / np.maximum(size, limit))[:, None]) @ self.rotation.T)
