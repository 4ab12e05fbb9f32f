"""A solid of any shape, as a STEP file has it: known here by its surface in triangles; and what all solids have."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import permutations
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .common import Array, freeze, millimetres
from .shapes import METRES, Body, Box, Cylinder, Sphere, at_origin, ring, unturned

CHUNK = 100_000  # Points times triangles at once
# Cosine between the normals of triangles from which on their common side is no edge.
SMOOTH = float(np.cos(np.radians(30.0)))
SAME, EDGES = 1e-7, 64  # Of the size: distance of corners that are one; edges at once
FACES = 100  # Normals of so many faces are enough to find the one along which another body touches it
HALVINGS, ENOUGH = 50, 1e-13  # Steps to a place off a body at most, and how exactly by its distance it is found
# Distance of corners from the surface in sizes of the part, and relative difference of volumes and areas.
SAME_SHAPE = 1e-9
# Sine of an angle between directions that are one; entries of axes that are round-off of a file; flat faces that may be
# the end of a cylinder.
ALONG, STRAIGHT, KNOWN_FACES = 1e-6, 1e-9, 40


@dataclass(frozen=True, eq=False)
class Part(Body):
    """A solid read from a file, its middle that of the box about it."""

    file: Path = field(compare=False)  # where it was read; keys count its text
    step: str  # the file's text
    brep: str  # the solid as OpenCASCADE writes it for itself, mm
    # (n, 3, 3) corners of triangles on the surface, outwards; extent: (3,) edges of the box about it; origin, centroid:
    # (3,) of the file and of the volume. All from the middle along the body axes
    triangles: Array = field(metadata=METRES)
    extent: Array = field(metadata=METRES)
    origin: Array = field(metadata=METRES)
    volume: float = field(metadata={"units": "m3"})
    area: float = field(metadata={"units": "m2"})  # of the surface
    centroid: Array = field(metadata=METRES)
    center: Array = field(default_factory=at_origin, metadata=METRES)
    rotation: Array = field(default_factory=unturned)
    kind: ClassVar[str] = "file"

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, extent=(3,), origin=(3,), centroid=(3,), triangles=(len(self.triangles), 3, 3))

    @property
    def size(self) -> Array:
        return self.extent

    @cached_property
    def mirrors(self) -> tuple[int, ...]:
        corners, allowed = self.triangles.reshape(-1, 3), SAME_SHAPE * float(self.extent.max())
        images = [corners * np.where(np.arange(3) == axis, -1.0, 1.0) for axis in range(3)]
        home = moved(self, np.zeros(3), np.eye(3))
        return tuple(axis for axis, image in enumerate(images) if np.abs(home.distance(image)).max() < allowed)

    @property
    def circumradius(self) -> float:
        return float(1.001 * np.linalg.norm(self.triangles, axis=2).max())

    def reach(self, directions: Array) -> Array:
        return np.asarray(np.abs((directions @ self.rotation) @ self.triangles.reshape(-1, 3).T).max(axis=1))

    def support(self, directions: Array) -> Array:
        return np.asarray(((directions @ self.rotation) @ self.triangles.reshape(-1, 3).T).max(axis=1))

    @cached_property
    def face_normals(self) -> Array:
        """(n, 3) outward unit normals of its largest flat faces along the body axes, each once; `FACES` at most."""
        normals, areas = self._normals
        normals, areas = normals[areas > 0], areas[areas > 0]
        alike, first, number = np.unique(np.round(normals, 7), axis=0, return_index=True, return_inverse=True)
        return np.asarray(normals[first[np.argsort(-np.bincount(number.ravel(), areas, len(alike)))[:FACES]]])

    @property
    def _normals(self) -> tuple[Array, Array]:
        """Unit normals (n, 3) of the triangles and twice their areas (n,), m²."""
        a, b, c = (self.triangles[:, k] for k in range(3))
        normals = np.cross(b - a, c - a)
        areas = np.linalg.norm(normals, axis=1)
        return normals / np.maximum(areas, 1e-300)[:, None], areas

    def distance(self, points: ArrayLike) -> Array:
        local = self.to_body(points)
        flat = local.reshape(-1, 3)
        chunks = np.array_split(flat, max(1, len(flat) * len(self.triangles) // CHUNK))
        return np.concatenate([self._distance(part) for part in chunks]).reshape(local.shape[:-1])

    @property
    def shape_numbers(self) -> Array:
        return np.frombuffer(hashlib.sha256(self.step.encode()).digest(), dtype="<u4").astype(float)

    @property
    def described_size(self) -> str:
        return f"{self.file.name} {millimetres(self.size)}"

    @property
    def keys(self) -> dict[str, Any]:
        return {"file": str(self.file)}

    @cached_property
    def edges(self) -> Array:
        """(m, 2, 3) m, sides of triangles that meet at an angle of more than 30°, along the body axes."""
        normals, _ = self._normals
        unit = SAME * float(np.linalg.norm(self.extent))
        sides: dict[tuple[tuple[int, ...], ...], list[tuple[int, int]]] = {}
        for t, corners in enumerate(np.round(self.triangles / unit).astype(int)):
            for k in range(3):
                ends = sorted(map(tuple, (corners[k].tolist(), corners[(k + 1) % 3].tolist())))
                sides.setdefault(tuple(ends), []).append((t, k))
        sharp = [met[0] for met in sides.values() if len(met) == 2 and normals[met[0][0]] @ normals[met[1][0]] < SMOOTH]
        return np.array([self.triangles[t][[k, (k + 1) % 3]] for t, k in sharp]).reshape(-1, 2, 3)

    def edge_distance(self, points: ArrayLike) -> Array:
        local = self.to_body(points).reshape(-1, 3)
        nearest = np.full(len(local), np.inf)
        for start in range(0, len(self.edges), EDGES):
            a, b = (self.edges[None, start : start + EDGES, k] - local[:, None] for k in range(2))
            nearest = np.minimum(nearest, _segment(a, b).min(axis=1))
        return nearest

    @cached_property
    def _balls(self) -> tuple[Array, Array]:
        """Centroids (n, 3) of the triangles and how far each reaches from its own (n,), m."""
        middles = self.triangles.mean(axis=1)
        return middles, np.linalg.norm(self.triangles - middles[:, None], axis=2).max(axis=1)

    def _distance(self, points: Array) -> Array:
        middles, radii = self._balls
        apart = np.linalg.norm(points[:, None] - middles, axis=2)
        # a triangle all of which lies beyond the nearest centroid is not the nearest: most are left out
        who, which = np.nonzero(apart - radii <= apart.min(axis=1)[:, None])
        a, b, c = (self.triangles[which, k] - points[who] for k in range(3))
        each = np.min([_segment(a, b), _segment(b, c), _segment(c, a), _plane(a, b, c)], axis=0)
        nearest = np.minimum.reduceat(each, np.flatnonzero(np.diff(who, prepend=-1)))
        inside = np.all(np.abs(points) <= self.extent / 2, axis=1)
        inside[inside] = self._around(points[inside]) > np.pi  # half of the solid angle
        return np.asarray(np.where(inside, -nearest, nearest))

    def _around(self, points: Array) -> Array:
        """Half of the solid angle (n,) that the triangles take as seen from points."""
        a, b, c = (self.triangles[None, :, k] - points[:, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
        volume = np.einsum("nti,nti->nt", a, np.cross(b, c))
        base = la * lb * lc + np.einsum("nti,nti->nt", a, b) * lc
        base += np.einsum("nti,nti->nt", b, c) * la + np.einsum("nti,nti->nt", c, a) * lb
        return np.asarray(np.arctan2(volume, base).sum(axis=1))


def _segment(a: Array, b: Array) -> Array:
    """Distance (...,) of the origin from segments."""
    way = b - a
    share = np.clip(-np.sum(a * way, axis=-1) / np.maximum(np.sum(way * way, axis=-1), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(a + share[..., None] * way, axis=-1))


def _plane(a: Array, b: Array, c: Array) -> Array:
    """Distance (...,) of the origin from the planes of triangles over which it lies; else infinite."""
    normal = np.cross(b - a, c - a)
    size = np.maximum(np.linalg.norm(normal, axis=-1), 1e-300)
    height = np.sum(a * normal, axis=-1) / size
    foot = height[..., None] * normal / size[..., None]
    over = np.ones(height.shape, bool)
    for first, second in ((a, b), (b, c), (c, a)):
        over &= np.sum(np.cross(second - first, foot - first) * normal, axis=-1) >= 0
    return np.where(over, np.abs(height), np.inf)


@dataclass(frozen=True, eq=False)
class Compound(Body):
    """Solids apart from each other, in the first's frame: `box` is that one's, `blocks` and `size` of all."""

    bodies: tuple["Solid", ...]  # along the body axes, from the centre
    center: Array = field(default_factory=at_origin, metadata=METRES)
    rotation: Array = field(default_factory=unturned)
    kind: ClassVar[str] = "several"

    @classmethod
    def of(cls, bodies: Sequence["Solid"]) -> "Compound":
        first = bodies[0]
        local = (moved(body, first.to_body(body.center), first.rotation.T @ body.rotation) for body in bodies)
        return cls(tuple(local), first.center, first.rotation)

    @property
    def placed(self) -> "tuple[Solid, ...]":
        return tuple(with_frame(body, self.rotation, self.center) for body in self.bodies)

    @cached_property
    def size(self) -> Array:
        return 2 * self.reach(self.rotation.T)

    @cached_property
    def box(self) -> Box:
        return Box(self.bodies[0].size, self.center, self.rotation)

    @cached_property
    def blocks(self) -> list[tuple[Array, Array]]:
        return [(body.center, body.reach(np.eye(3))) for body in self.bodies]

    @property
    def volume(self) -> float:
        return sum(body.volume for body in self.bodies)

    @property
    def area(self) -> float:
        return sum(body.area for body in self.bodies)

    @property
    def mirrors(self) -> tuple[int, ...]:
        def mirrored(body: "Solid", axis: int) -> bool:
            along = np.flatnonzero(np.abs(body.rotation[axis]) > 1 - STRAIGHT)
            return bool(body.center[axis] == 0 and len(along) and along[0] in body.mirrors)

        return tuple(axis for axis in range(3) if all(mirrored(body, axis) for body in self.bodies))

    @property
    def circumradius(self) -> float:
        return max(body.farthest(np.zeros(3)) for body in self.bodies)

    @property
    def shape_numbers(self) -> Array:
        each = [(body.shape_numbers, body.center, body.rotation.ravel()) for body in self.bodies]
        return np.concatenate([numbers for three in each for numbers in three])

    @property
    def described_size(self) -> str:
        return " and ".join(body.described_size for body in self.bodies)

    @property
    def keys(self) -> dict[str, Any]:
        return {}  # each has its own

    def reach(self, directions: Array) -> Array:
        return np.maximum(self.support(directions), self.support(-directions))

    def support(self, directions: Array) -> Array:
        local = directions @ self.rotation
        return np.asarray(np.max([local @ body.center + body.support(local) for body in self.bodies], axis=0))

    def distance(self, points: ArrayLike) -> Array:
        local = self.to_body(points)
        return np.asarray(np.min([body.distance(local) for body in self.bodies], axis=0))

    def edge_distance(self, points: ArrayLike) -> Array:
        local = self.to_body(points)
        return np.asarray(np.min([body.edge_distance(local) for body in self.bodies], axis=0))


Solid = Box | Cylinder | Part | Sphere  # A body's shape and pose
Solids = Solid | Compound  # One or several
Some = TypeVar("Some", bound=Body)


def places_off(body: Solid, directions: Array, distance: float) -> Array:
    """Points (n, 3) m at a distance (m) from a body's surface, seen in unit directions (n, 3) from its centre."""
    low, high = np.zeros(len(directions)), np.full(len(directions), distance + body.circumradius)
    before, after = (body.distance(body.center + way[:, None] * directions) - distance for way in (low, high))
    last = np.zeros(len(directions), bool)
    for _ in range(HALVINGS):
        within = (before < 0) & (after > 0)
        slope = np.divide(high - low, after - before, out=np.zeros(len(low)), where=within)
        middle = np.where(within, high - slope * after, (low + high) / 2)
        off = body.distance(body.center + middle[:, None] * directions) - distance
        near = off < 0
        before = np.where(near, off, np.where(last, before, before / 2))  # halved where one end stays (Illinois)
        after = np.where(near, np.where(last, after / 2, after), off)
        low, high, last = np.where(near, middle, low), np.where(near, high, middle), near
        if np.all((np.abs(off) < ENOUGH * distance) | (high - low < ENOUGH * distance)):
            break
    return np.asarray(body.center + middle[:, None] * directions)


def moved(body: Some, center: Array, rotation: Array | None = None) -> Some:
    """The `body` with its `center` (3,) m elsewhere, and with other body axes, a `rotation` (3, 3), if it is given."""
    return replace(body, center=center, rotation=body.rotation if rotation is None else rotation)  # type: ignore[type-var]


def of_one_shape(bodies: Sequence[Solid]) -> list[list[int]]:
    """Numbers of the bodies, those of one shape together."""
    found = dict[tuple[str | float, ...], list[int]]()
    for number, body in enumerate(bodies):
        found.setdefault((body.kind, *body.shape_numbers.tolist()), []).append(number)
    return list(found.values())


def with_frame(body: Some, axes: Array, place: Array | float = 0.0) -> Some:
    """The `body` of a frame that comes to be at a `place` (3,) m with `axes`, columns of (3, 3)."""
    return moved(body, place + axes @ body.center, axes @ body.rotation)


def known_shape(part: Part) -> Solid | None:
    """The shape that the part has, in the same place, its axes as near to the part's as can be; None for any other."""
    for local in _candidates(part):
        distances = np.abs(local.distance(part.triangles.reshape(-1, 3)))
        alike = np.allclose([local.volume, local.area], [part.volume, part.area], rtol=SAME_SHAPE, atol=0.0)
        if alike and distances.max() < SAME_SHAPE * part.circumradius:
            return with_frame(local, part.rotation, part.center)
    return None


def _candidates(part: Part) -> Iterator[Solid]:
    """Shapes of about the part's sizes about its centroid, along its body axes."""
    corners, normals = part.triangles.reshape(-1, 3) - part.centroid, list[Array]()
    yield Sphere(float(np.cbrt(part.volume * 0.75 / np.pi)), part.centroid)
    for normal in part.face_normals:  # opposite ones are the same direction
        if all(np.linalg.norm(np.cross(normal, other)) > ALONG for other in normals):
            normals.append(normal)
    for axis in normals[:KNOWN_FACES]:
        along = corners @ axis
        height = float(np.ptp(along))
        radius = float(np.linalg.norm(corners - np.outer(along, axis), axis=1).max())
        frame = _tidy(frame_about(axis * np.sign(axis[np.argmax(np.abs(axis))])))
        yield Cylinder(radius, height, part.centroid, frame)
        hole = radius**2 - part.volume / (np.pi * height)
        if hole > 0:
            yield ring(radius, float(np.sqrt(hole)), height, part.centroid, frame)
    if len(normals) == 3:
        first, second, _ = nearest_axes(np.stack(normals, axis=1)).T
        second = second - (second @ first) * first
        second /= np.linalg.norm(second)
        frame = _tidy(np.stack([first, second, np.cross(first, second)], axis=1))
        yield Box(np.ptp(corners @ frame, axis=0), part.centroid, frame)


def _tidy(frame: Array) -> Array:
    """Axes without the round-off of the file where they are those of the file."""
    straight = np.round(frame) + 0.0
    return straight if np.abs(frame - straight).max() < STRAIGHT else frame


def nearest_axes(columns: Array) -> Array:
    """Directions, columns of (3, 3), in the order and with the signs in which they are nearest to the frame's axes."""
    # those in a tie, as at 45°, are in their own order
    columns = columns[:, max(permutations(range(3)), key=lambda order: round(sum(np.abs(columns[range(3), order])), 9))]
    columns = columns * np.where(np.diag(columns) < 0, -1.0, 1.0)
    return np.asarray(columns if np.linalg.det(columns) > 0 else columns * [1.0, 1.0, -1.0])


def frame_about(axis: Array) -> Array:
    """(3, 3) right-handed axes as columns, the third along a unit vector (3,), turned about it as little as can be."""
    across = np.eye(3)[int(np.argmin(np.abs(axis)))] if abs(axis[0]) > 0.99 else np.eye(3)[0]
    first = across - (across @ axis) * axis / (axis @ axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis], axis=1)
