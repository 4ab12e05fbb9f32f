"""Any body's shape and pose, and places around it."""

import numpy as np

from .arrays import Array
from .box import Box
from .cylinder import Cylinder

Solid = Box | Cylinder
"""A body's shape and pose."""
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
