"""Where equilibria are looked for: the range, and the starts of the search."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ...geometry.scenes import Scene


@dataclass(frozen=True, eq=False)
class SearchRange:
    """Positions below the rotor, from contact with it to `farthest`, in floater radii.

    Parameters
    ----------
    scene : its rotor and floater
    farthest : largest depth, and distance from the axis, m
    """

    scene: Scene
    farthest: float

    @property
    def bound(self) -> float:
        """Largest depth, and distance from the axis, in floater radii."""
        return self.farthest / self.scene.floater.radius

    def __contains__(self, position: Array) -> bool:
        """Whether a scaled position (3,) belongs to the range."""
        return bool(self.holds(position[None])[0])

    def holds(self, position: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Which of the scaled positions (n, 3) belong to the range, or lie at most a margin (radii) outside: (n,)."""
        radius, inner = self.scene.floater.radius, self.scene.floater.inner_radius
        bound, height = self.bound + margin, position[:, 2]
        inside = (-bound <= height) & (height <= margin) & (np.hypot(position[:, 0], position[:, 1]) <= bound)
        for magnet in self.scene.rotor:
            inside &= magnet.body.distance(position * radius) > inner - margin * radius
        return np.asarray(inside)

    def starts(self) -> tuple[Array, Array]:
        """Scaled positions and moments (n, 3) below the rotor and beside it, in fourteen directions each."""
        corners = [magnet.box.corners / self.scene.floater.radius for magnet in self.scene.rotor]
        nearest = 1.0 + max((-c[:, 2].min() for c in corners), default=0.0)
        beside = 1.0 + np.array([1.0, 1.1, 1.3, 2.0]) * max((np.abs(c[:, :2]).max() for c in corners), default=0.0)
        below = -np.geomspace(nearest, max(self.bound, nearest), 16)
        places = np.concatenate(
            [_rings(below, np.array([0.0, 0.15, 0.7]), 4), _rings(np.array([-0.01, -0.1, -0.4, -0.9]), beside, 12)]
        )
        moment = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, v)) in (1.0, 3.0)])
        moment /= np.linalg.norm(moment, axis=1, keepdims=True)
        return np.repeat(places, len(moment), axis=0), np.tile(moment, (len(places), 1))


def _rings(heights: Array, radii: Array, number: int) -> Array:
    """Points (n, 3) on rings about the axis, `number` on each."""
    angles = np.arange(number) * (2 * np.pi / number)
    rings = product(heights, radii)
    return np.array([(r * np.cos(a), r * np.sin(a), z) for z, r in rings for a in (angles if r else angles[:1])])
