"""Equilibria that follow their scene to another one nearby."""

import numpy as np

from ...geometry.basics import Array
from ..steady import EVERY, Balance, solve

JUMP = 0.3
"""An equilibrium that moves farther in one step (radii and rad together) may be another one."""
PARTS = (1, 4, 16)
"""Steps in which the way to a scene is tried."""
APART = 1e-6
"""Equilibria nearer than this are one."""


def carried(start: Balance, end: Balance, position: Array, moment: Array) -> Array | None:
    """Scaled positions and moments (n, 6) at the end of the way; None where they cannot be followed.

    Parameters
    ----------
    start, end : one scene each, with the same equations and other parameters
    position, moment : (n, 3) scaled, the equilibria at the start
    """
    if not len(position):
        return np.zeros((0, 6))
    for parts in PARTS:
        places, turned, good = position, moment, True
        for way in np.arange(1, parts + 1) / parts:
            values = start.values + way * (end.values - start.values)
            balance = Balance(end.rates, values, start.spin + way * (end.spin - start.spin))
            arrived, direction, size = solve(balance, places, turned, EVERY, 12)
            step = np.linalg.norm(np.concatenate([arrived - places, direction - turned], axis=1), axis=1)
            good = bool((size < 1e-8).all() and (step < JUMP).all())
            if not good:
                break
            places, turned = arrived, direction
        points = np.concatenate([places, turned], axis=1)
        if good and _all_apart(points):
            return points
    return None


def _all_apart(points: Array) -> bool:
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points))
    return bool((apart > APART).all())
