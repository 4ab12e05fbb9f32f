"""A solid of any shape, as a STEP file has it: known here by its surface in triangles."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, frozen_array
from .pose import Posed

CHUNK = 2_000_000
"""Points times triangles at once."""


@dataclass(frozen=True, eq=False)
class Part(Posed):
    """A solid read from a file, its middle that of the box about it.

    Parameters
    ----------
    file : where it was read
    step : the file's text
    triangles : (n, 3, 3) m, corners of triangles on the surface, outwards, from the middle along the body axes
    extent : (3,) m, edges of the box about it
    origin : (3,) m, the file's origin, from the middle along the body axes
    volume : m³
    center : (3,) position of the middle, m
    rotation : (3, 3) matrix whose columns are the body axes (default: none turned)
    """

    file: Path
    step: str
    triangles: Array
    extent: Array
    origin: Array
    volume: float
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("extent", "origin"):
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

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance (...,) of `points` (..., 3) from the triangles, m; negative inside."""
        local = self.to_body(points)
        flat, found = local.reshape(-1, 3), []
        for part in np.array_split(flat, max(1, len(flat) * len(self.triangles) // CHUNK)):
            found.append(self._distance(part))
        return np.asarray(np.concatenate(found).reshape(local.shape[:-1]))

    def _distance(self, points: Array) -> Array:
        a, b, c = (self.triangles[None, :, k] - points[:, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
        volume = np.einsum("nti,nti->nt", a, np.cross(b, c))
        base = la * lb * lc + np.einsum("nti,nti->nt", a, b) * lc
        base += np.einsum("nti,nti->nt", b, c) * la + np.einsum("nti,nti->nt", c, a) * lb
        inside = np.arctan2(volume, base).sum(axis=1) > np.pi  # half of the solid angle
        nearest = np.min([_segment(a, b), _segment(b, c), _segment(c, a), _plane(a, b, c)], axis=0).min(axis=1)
        return np.asarray(np.where(inside, -nearest, nearest))


def _segment(a: Array, b: Array) -> Array:
    """Distance (n, t) of the origin from segments."""
    way = b - a
    share = np.clip(-np.sum(a * way, axis=2) / np.maximum(np.sum(way * way, axis=2), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(a + share[..., None] * way, axis=2))


def _plane(a: Array, b: Array, c: Array) -> Array:
    """Distance (n, t) of the origin from the planes of triangles over which it lies; else infinite."""
    normal = np.cross(b - a, c - a)
    size = np.maximum(np.linalg.norm(normal, axis=2), 1e-300)
    height = np.sum(a * normal, axis=2) / size
    foot = height[..., None] * normal / size[..., None]
    over = np.ones(height.shape, bool)
    for first, second in ((a, b), (b, c), (c, a)):
        over &= np.sum(np.cross(second - first, foot - first) * normal, axis=2) >= 0
    return np.where(over, np.abs(height), np.inf)
