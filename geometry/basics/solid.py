"""Any body's shape and pose, and places around it."""

from dataclasses import replace

import numpy as np

from .arrays import Array
from .box import Box
from .cylinder import Cylinder
from .ring import Ring
from .sphere import Sphere
from .text import millimetres

Solid = Box | Cylinder | Ring | Sphere
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
    if isinstance(body, Box):
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

    A cuboid has three, its edges; a sphere one; a cylinder two; a ring four.
    """
    if isinstance(body, Box):
        return np.array(body.size)
    if isinstance(body, Sphere):
        return np.array([body.radius])
    if isinstance(body, Ring):
        return np.array([body.radius, body.inner_radius, body.height, 0.0])
    return np.array([body.radius, body.height])


def solid_of(numbers: Array, center: Array, rotation: Array) -> Solid:
    """The body of the numbers of `shape_numbers` in its place."""
    if len(numbers) == 3:
        return Box(numbers, center, rotation)
    if len(numbers) == 1:
        return Sphere(float(numbers[0]), center, rotation)
    if len(numbers) == 2:
        return Cylinder(float(numbers[0]), float(numbers[1]), center, rotation)
    return Ring(float(numbers[0]), float(numbers[1]), float(numbers[2]), center, rotation)


def described_size(body: Solid) -> str:
    """Shape and size as a person writes them, in mm."""
    if isinstance(body, Box):
        return millimetres(body.size)
    if isinstance(body, Sphere):
        return f"sphere Ø {body.radius * 2e3:.4g} mm"
    across = f"Ø {body.radius * 2e3:.4g}"
    if isinstance(body, Ring):
        across = f"ring {across} / {body.inner_radius * 2e3:.4g}"
    return f"{across} × {body.height * 1e3:.4g} mm"
