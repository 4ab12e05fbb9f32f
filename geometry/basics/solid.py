"""Any body's shape and pose, and places around it."""

import hashlib
from dataclasses import replace

import numpy as np

from .arrays import Array
from .box import Box
from .cylinder import Cylinder
from .part import Part
from .ring import Ring
from .sphere import Sphere
from .text import millimetres

Solid = Box | Cylinder | Part | Ring | Sphere
"""A body's shape and pose."""
INSIDE = 1 - 1e-9
"""Just inside of a surface, in radii."""
HALVINGS = 50
"""Of the way on which a place lies; more would not change its last digit."""


def places_off(body: Solid, directions: Array, distance: float) -> Array:
    """Points (n, 3) m at a distance (m) from a body's surface, seen in unit directions (n, 3) from its centre."""
    low, high = np.zeros(len(directions)), np.full(len(directions), distance + body.circumradius)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        near = body.distance(body.center + middle[:, None] * directions) < distance
        low, high = np.where(near, middle, low), np.where(near, high, middle)
    return np.asarray(body.center + high[:, None] * directions)


def within(body: Solid, points: Array) -> Array:
    """Points (n, 3) m of the elements of a round body, those just outside of its surface put just inside it."""
    if isinstance(body, Box | Part):
        return points
    local = body.to_body(points)
    if isinstance(body, Sphere):
        size = np.linalg.norm(local, axis=1)
        return np.asarray(body.center + (local * _least(body.radius * INSIDE, size)[:, None]) @ body.rotation.T)
    across = np.hypot(local[:, 0], local[:, 1])
    wanted = np.minimum(across, body.radius * INSIDE)
    if isinstance(body, Ring):
        wanted = np.maximum(wanted, body.inner_radius / INSIDE)
    local[:, :2] *= (wanted / np.maximum(across, np.finfo(float).tiny))[:, None]
    local[:, 2] = np.clip(local[:, 2], -INSIDE * body.height / 2, INSIDE * body.height / 2)
    return np.asarray(body.center + local @ body.rotation.T)


def _least(limit: float, size: Array) -> Array:
    return np.minimum(1.0, limit / np.maximum(size, limit))


def moved(body: Solid, center: Array, rotation: Array | None = None) -> Solid:
    """The body with its centre (3,) m elsewhere, and with other body axes (3, 3) if they are given."""
    return replace(body, center=center, rotation=body.rotation if rotation is None else rotation)


def shape_numbers(body: Solid) -> Array:
    """Numbers (n,) m that tell a body from another of its shape, but for its pose; how many of them tells the shape.

    A cuboid has three, its edges; a sphere one; a cylinder two; a ring four; a part eight, of its file's digest.
    """
    if isinstance(body, Box):
        return np.array(body.size)
    if isinstance(body, Sphere):
        return np.array([body.radius])
    if isinstance(body, Part):
        digest = hashlib.sha256(body.step.encode()).digest()
        return np.frombuffer(digest, dtype="<u4").astype(float)
    if isinstance(body, Ring):
        return np.array([body.radius, body.inner_radius, body.height, 0.0])
    return np.array([body.radius, body.height])


def solid_of(numbers: Array, center: Array, rotation: Array) -> Solid:
    """The body of the numbers of `shape_numbers` in its place; of a part they do not tell it."""
    if len(numbers) == 3:
        return Box(numbers, center, rotation)
    if len(numbers) == 1:
        return Sphere(float(numbers[0]), center, rotation)
    if len(numbers) == 2:
        return Cylinder(float(numbers[0]), float(numbers[1]), center, rotation)
    return Ring(float(numbers[0]), float(numbers[1]), float(numbers[2]), center, rotation)


def edge_distance(body: Solid, points: Array) -> Array:
    """Distances (n,) m of points (n, 3) m from the nearest edge of a body; infinite where it has none."""
    if isinstance(body, Part | Sphere):
        return np.full(len(points), np.inf)
    local = body.to_body(points)
    if isinstance(body, Box):
        to_faces = np.abs(local) - body.half_edges
        along = np.maximum(to_faces, 0.0)
        squares = [to_faces[:, (a + 1) % 3] ** 2 + to_faces[:, (a + 2) % 3] ** 2 + along[:, a] ** 2 for a in range(3)]
        return np.asarray(np.sqrt(np.min(squares, axis=0)))
    across, height = np.hypot(local[:, 0], local[:, 1]), np.abs(local[:, 2]) - body.half_edges[2]
    radii = [body.radius, body.inner_radius] if isinstance(body, Ring) else [body.radius]
    return np.asarray(np.min([np.hypot(across - radius, height) for radius in radii], axis=0))


def described_size(body: Solid) -> str:
    """Shape and size as a person writes them, in mm."""
    if isinstance(body, Box):
        return millimetres(body.size)
    if isinstance(body, Sphere):
        return f"sphere Ø {body.radius * 2e3:.4g} mm"
    if isinstance(body, Part):
        return f"{body.file.name} {millimetres(body.size)}"
    across = f"Ø {body.radius * 2e3:.4g}"
    if isinstance(body, Ring):
        across = f"ring {across} / {body.inner_radius * 2e3:.4g}"
    return f"{across} × {body.height * 1e3:.4g} mm"
