"""Any body's shape and pose, and places off it."""

from dataclasses import replace

import numpy as np

from .arrays import Array
from .box import Box
from .cylinder import Cylinder
from .part import Part
from .ring import Ring
from .sphere import Sphere

Solid = Box | Cylinder | Part | Ring | Sphere
"""A body's shape and pose."""
HALVINGS, ENOUGH = 50, 1e-13
"""Steps to a place at most, and how exactly by its distance it is found."""


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


def moved(body: Solid, center: Array, rotation: Array | None = None) -> Solid:
    """The body with its centre (3,) m elsewhere, and with other body axes (3, 3) if they are given."""
    return replace(body, center=center, rotation=body.rotation if rotation is None else rotation)


def solid_of(numbers: Array, center: Array, rotation: Array) -> Solid:
    """The body of its `shape_numbers` in its place; of a part they do not tell it."""
    if len(numbers) == 3:
        return Box(numbers, center, rotation)
    if len(numbers) == 1:
        return Sphere(float(numbers[0]), center, rotation)
    if len(numbers) == 2:
        return Cylinder(float(numbers[0]), float(numbers[1]), center, rotation)
    return Ring(float(numbers[0]), float(numbers[1]), float(numbers[2]), center, rotation)
