"""A solid of any shape, as a STEP file has it: known here by its surface in triangles."""

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, frozen_array
from .pose import Posed
from .text import millimetres

CHUNK = 100_000
"""Points times triangles at once."""
SMOOTH = float(np.cos(np.radians(30.0)))
"""Cosine between the normals of triangles from which on their common side is no edge."""
SAME, EDGES = 1e-7, 64
"""Of the size: distance of corners that are one; edges at once."""
FACES = 100
"""Normals of so many faces are enough to find the one along which another body touches it."""


@dataclass(frozen=True, eq=False)
class Part(Posed):
    """A solid read from a file, its middle that of the box about it.

    Parameters
    ----------
    file : where it was read
    step : the file's text
    brep : the solid as OpenCASCADE writes it for itself, mm
    triangles : (n, 3, 3) m, corners of triangles on the surface, outwards, from the middle along the body axes
    extent : (3,) m, edges of the box about it
    origin : (3,) m, the file's origin, from the middle along the body axes
    volume, area : m³, m², of the solid and its surface
    centroid : (3,) m, from the middle along the body axes
    center : (3,) position of the middle, m
    rotation : (3, 3) matrix whose columns are the body axes (default: none turned)
    """

    file: Path
    step: str
    brep: str
    triangles: Array
    extent: Array
    origin: Array
    volume: float
    area: float
    centroid: Array
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("extent", "origin", "centroid"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), (3,)))
        object.__setattr__(self, "triangles", frozen_array(self.triangles, (len(self.triangles), 3, 3)))

    @property
    def size(self) -> Array:
        """(3,) edges of the box about it, along the body axes, m."""
        return self.extent

    @property
    def circumradius(self) -> float:
        """Radius of a sphere about the middle that holds the solid, m."""
        return float(1.001 * np.linalg.norm(self.triangles, axis=2).max())

    def reach(self, directions: Array) -> Array:
        """How far (n,) it reaches from its middle along unit vectors (n, 3), m, or against them if that is more."""
        along = (directions @ self.rotation) @ self.triangles.reshape(-1, 3).T
        return np.asarray(np.abs(along).max(axis=1))

    def support(self, directions: Array) -> Array:
        """How far (n,) it reaches from its middle along unit vectors (n, 3), m, whatever lies against them."""
        return np.asarray(((directions @ self.rotation) @ self.triangles.reshape(-1, 3).T).max(axis=1))

    @cached_property
    def face_normals(self) -> Array:
        """(n, 3) outward unit normals of its largest flat faces along the body axes, each once; `FACES` at most."""
        normals = np.cross(self.triangles[:, 1] - self.triangles[:, 0], self.triangles[:, 2] - self.triangles[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        normals = normals[areas > 0] / areas[areas > 0, None]
        alike, first, number = np.unique(np.round(normals, 7), axis=0, return_index=True, return_inverse=True)
        order = np.argsort(-np.bincount(number.ravel(), areas[areas > 0], len(alike)))
        return np.asarray(normals[first[order[:FACES]]])

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (...,) of `points` (..., 3) from the triangles, m; negative inside."""
        local = self.to_body(points)
        flat, found = local.reshape(-1, 3), []
        for part in np.array_split(flat, max(1, len(flat) * len(self.triangles) // CHUNK)):
            found.append(self._distance(part))
        return np.asarray(np.concatenate(found).reshape(local.shape[:-1]))

    @property
    def shape_numbers(self) -> Array:
        """(8,) of the digest of its file."""
        digest = hashlib.sha256(self.step.encode()).digest()
        return np.frombuffer(digest, dtype="<u4").astype(float)

    @property
    def described_size(self) -> str:
        """Its file, and the edges of the box about it, mm."""
        return f"{self.file.name} {millimetres(self.size)}"

    @cached_property
    def edges(self) -> Array:
        """(m, 2, 3) m, sides of triangles that meet at an angle of more than 30°, along the body axes."""
        normals = np.cross(self.triangles[:, 1] - self.triangles[:, 0], self.triangles[:, 2] - self.triangles[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        unit = SAME * float(np.linalg.norm(self.extent))
        sides: dict[tuple[tuple[int, ...], ...], list[tuple[int, int]]] = {}
        for t, corners in enumerate(np.round(self.triangles / unit).astype(int)):
            for k in range(3):
                ends = sorted(map(tuple, (corners[k].tolist(), corners[(k + 1) % 3].tolist())))
                sides.setdefault(tuple(ends), []).append((t, k))
        sharp = [met[0] for met in sides.values() if len(met) == 2 and normals[met[0][0]] @ normals[met[1][0]] < SMOOTH]
        found = [self.triangles[t][[k, (k + 1) % 3]] for t, k in sharp]
        return np.array(found).reshape(-1, 2, 3)

    def edge_distance(self, points: ArrayLike) -> Array:
        """Distances (n,) m of points (n, 3) m from the nearest of its `edges`; infinite where it has none."""
        local = self.to_body(points).reshape(-1, 3)
        nearest = np.full(len(local), np.inf)
        for start in range(0, len(self.edges), EDGES):
            a, b = (self.edges[None, start : start + EDGES, k] - local[:, None] for k in range(2))
            nearest = np.minimum(nearest, _segment(a, b).min(axis=1))
        return nearest

    def within(self, points: Array) -> Array:
        """Points (n, 3) m of its elements as they are."""
        return points

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
