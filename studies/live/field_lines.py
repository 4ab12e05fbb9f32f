"""Field lines around the rotor, in the plane y = 0 of its frame, where the page's picture shows them."""

from collections.abc import Callable

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene

LINES = 20
"""Field lines, of which each is followed both ways."""
STEP, STEPS = 1.2e-3, 60
"""Length of a step, m, and how many are made at most."""
FAR = 45e-3
"""How far from the rotor's origin a line is followed, m."""


def field_lines(scene: Scene, field: Callable[[Array], Array]) -> list[Array]:
    """Lines (n, 3) m of a field B (n, 3) at points (n, 3) m, outside the magnets; between neighbours is equal flux.

    Runge and Kutta's fourth order in steps of equal length: a line is off by less than it is thick.
    """
    seeds = _seeds(scene, field)
    ways = [_followed(scene, field, seeds, sign) for sign in (-1.0, 1.0)]
    lines = [np.concatenate([back[::-1], ahead[1:]]) for back, ahead in zip(*ways, strict=True)]
    return [line for line in lines if len(line) > 2]


def _seeds(scene: Scene, field: Callable[[Array], Array]) -> Array:
    """Places (LINES, 3) m on a circle around the magnets."""
    corners = np.concatenate([magnet.box.corners for magnet in scene.rotor])
    middle = corners.mean(axis=0) * (1, 0, 1)
    radius = 1.03 * np.linalg.norm((corners - middle)[:, [0, 2]], axis=1).max()
    angles = np.linspace(-np.pi, np.pi, 361)
    outwards = np.column_stack([np.cos(angles), np.zeros(361), np.sin(angles)])
    through = np.abs(np.einsum("nk,nk->n", field(middle + radius * outwards), outwards))
    flux = np.cumsum(through)
    if not flux[-1] > 0:
        return np.zeros((0, 3))
    return np.asarray(middle + radius * outwards[np.searchsorted(flux, (np.arange(LINES) + 0.5) / LINES * flux[-1])])


def _followed(scene: Scene, field: Callable[[Array], Array], start: Array, sign: float) -> list[Array]:
    """From each start (n, 3) along the field or against it, to a magnet or out of sight."""

    def slope(places: Array) -> Array:
        b = field(places)
        return np.asarray(sign * b / np.maximum(np.linalg.norm(b, axis=1, keepdims=True), 1e-30))

    lines, active = [[place] for place in start], np.arange(len(start))
    for _ in range(STEPS):
        places = np.array([lines[k][-1] for k in active])
        active = active[_outside(scene, places)]
        if not len(active):
            break
        places = np.array([lines[k][-1] for k in active])
        one = slope(places)
        two = slope(places + STEP / 2 * one)
        three = slope(places + STEP / 2 * two)
        four = slope(places + STEP * three)
        for k, place in zip(active, places + STEP / 6 * (one + 2 * two + 2 * three + four), strict=True):
            lines[k].append(place)
    return [np.array(line) for line in lines]


def _outside(scene: Scene, places: Array) -> Array:
    """Which of the places (n, 3) m are in sight and farther from every magnet than two steps."""
    free = np.linalg.norm(places, axis=1) < FAR
    for magnet in scene.rotor:
        free &= magnet.box.distance(places) > 0.1 * STEP
    return np.asarray(free)
