"""Where the floater may be, relative to the plate: a box along the plate's axes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array, frozen_array

SYMMETRIC = 1e-9
"""Relative difference of two bounds that still counts as a mirror symmetry."""


@dataclass(frozen=True, eq=False)
class Region:
    """A box in the frame of the plate, whose centre is the origin.

    Parameters
    ----------
    lower, upper : (3,) bounds, m

    Raises
    ------
    ValueError : an upper bound is not above the lower one
    """

    lower: Array = field(metadata={"units": "m"})
    upper: Array = field(metadata={"units": "m"})

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), (3,)))
        if not np.all(self.upper > self.lower):
            bounds = f"{self.lower.tolist()} and {self.upper.tolist()}"
            raise ValueError(f"Input region upper bounds must exceed the lower ones; instead received {bounds}.")

    @classmethod
    def over_face(cls, size: ArrayLike, heights: tuple[float, float], lateral: ArrayLike) -> Region:
        """Heights (m) over the face +z of a plate with edges `size`, and ± `lateral` (m) about its axis."""
        face = float(np.asarray(size, float)[2]) / 2
        reach = np.broadcast_to(np.asarray(lateral, float), (2,))
        return cls(np.array([*-reach, face + heights[0]]), np.array([*reach, face + heights[1]]))

    @property
    def center(self) -> Array:
        """(3,) m."""
        return np.asarray((self.lower + self.upper) / 2)

    @property
    def mirrors(self) -> tuple[int, ...]:
        """Axes whose plane through the plate's centre mirrors the region."""
        extent = self.upper - self.lower
        return tuple(int(a) for a in np.flatnonzero(np.abs(self.lower + self.upper) <= SYMMETRIC * extent))

    def nearest(self, half_edges: Array) -> tuple[Array, Array]:
        """Nearest points (3,) of the region and of a plate with these half edges, m; equal if they touch."""
        of_plate = np.clip(self.center, -half_edges, half_edges)
        for _ in range(100):  # alternating projections onto two convex boxes converge to a nearest pair
            of_region = np.clip(of_plate, self.lower, self.upper)
            of_plate = np.clip(of_region, -half_edges, half_edges)
        return of_region, of_plate

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of `points` (n, 3) lie in the region, bounds included: (n,)."""
        points = np.asarray(points, float).reshape(-1, 3)
        slack = SYMMETRIC * (self.upper - self.lower)
        return np.asarray(np.all((points >= self.lower - slack) & (points <= self.upper + slack), axis=1))

    def grid(self, counts: tuple[int, int, int], fold: bool = False) -> Array:
        """Chebyshev-Lobatto grid (n, 3), m, bounds included; folded, only the non-negative half of mirrored axes."""
        axes = []
        for axis, count in enumerate(counts):
            nodes = -np.cos(np.pi * np.arange(count) / (count - 1)) if count > 1 else np.zeros(1)
            line = self.center[axis] + (self.upper - self.lower)[axis] / 2 * nodes
            keep = line >= -SYMMETRIC * self.upper[axis] if fold and axis in self.mirrors else np.full(count, True)
            axes.append(line[keep])
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)

    def surface(self, counts: tuple[int, int, int], fold: bool = False) -> Array:
        """The points of `grid` that lie on the region's surface."""
        points = self.grid(counts, fold)
        on_face = (points <= self.lower + 1e-12) | (points >= self.upper - 1e-12)
        return points[on_face.any(axis=1)]


STEPS = 5.0
"""The raster is the largest power of two, in metres, of which so many fit between box and plate."""
FREQUENCY_STEP = 125.0
"""Highest frequencies are multiples of this, Hz."""
ROUND_OFF = 1e-6


def outer_box(box: Region, half_edges: Array) -> Region:
    """The box with its bounds moved outwards to the raster; at least 0.65 of its distance is left.

    Parameters
    ----------
    half_edges : (3,) m, of the plate
    """
    of_region, of_plate = box.nearest(half_edges)
    gap = float(np.linalg.norm(of_region - of_plate))
    if gap <= 0:
        return box
    step = 2.0 ** np.floor(np.log2(gap / STEPS))
    lower, upper = np.floor(box.lower / step + ROUND_OFF), np.ceil(box.upper / step - ROUND_OFF)
    return Region(lower * step, upper * step)


def outer_frequencies(frequencies: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest, Hz, with the highest rounded up."""
    low, high = frequencies
    return low, float(np.ceil(high / FREQUENCY_STEP - ROUND_OFF)) * FREQUENCY_STEP
