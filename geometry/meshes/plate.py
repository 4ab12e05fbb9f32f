"""Graded hexahedral mesh of a box-shaped plate in air, made for given places of dipoles and a given frequency.

The plate is centred at the origin with its edges along the axes; all three mirror planes are used, so that
only an eighth is meshed.  Cells in the plate are small against the distance to the nearest dipole and, at the
faces, against the skin depth δ = (π f μ0 σ)^(-1/2); in air they grow in proportion to the distance from the plate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ..basics import MU_0, Array
from .conductors import MILLIMETRE, ConductorMesh
from .hexahedra import Block, graded_partition, hex_mesh


@dataclass(frozen=True)
class MeshRule:
    """How fine the mesh is; the defaults suit orders 3 to 5, for which few large cells cost least.

    Parameters
    ----------
    distance_share : cell size in the plate, in units of the distance to the nearest dipole
    skin_share : cell size at the faces, in units of the skin depth
    growth : by how much a cell grows per length away from a face
    reach : half edge of the air box in units of the plate's largest edge; the error of the truncation goes as its
        inverse cube
    """

    distance_share: float = 1.2
    skin_share: float = 2.0
    growth: float = 1.6
    reach: float = 12.0

    def finer(self) -> MeshRule:
        """The next finer mesh: cells 0.6 times as large, and a slower growth."""
        return MeshRule(0.6 * self.distance_share, 0.6 * self.skin_share, 0.8 * self.growth, self.reach)


def skin_depth(conductivity: float, frequency: float) -> float:
    """δ = (π f μ0 σ)^(-1/2), m; infinite at 0 Hz."""
    return float(1 / np.sqrt(np.pi * frequency * MU_0 * conductivity)) if frequency > 0 else np.inf


def plate_mesh(
    size: ArrayLike,
    conductivity: float,
    positions: ArrayLike,
    frequency: float,
    rule: MeshRule | None = None,
    endless: bool = False,
) -> ConductorMesh:
    """Mesh for a plate with edges `size` (3,) m and dipoles at `positions` (n, 3) m in the plate's own frame.

    Parameters
    ----------
    endless : on the same cells, the plate reaches to the end of the air along its two longer edges

    Raises
    ------
    ValueError : a size is not positive, or a position is not outside the plate
    """
    rule = rule or MeshRule()
    half = np.asarray(size, float) / 2
    if not np.all(half > 0):
        raise ValueError(f"Input size_m must be positive; instead received {np.asarray(size).tolist()}.")
    places = np.abs(np.asarray(positions, float).reshape(-1, 3))
    inside = np.all(places <= half, axis=1)
    if inside.any():
        raise ValueError(
            f"Input positions_m must lie outside the plate; instead received {places[inside][0].tolist()} in its frame."
        )
    depth = skin_depth(conductivity, frequency)
    far = rule.reach * 2 * half.max()
    lines = []
    for axis in range(3):
        size_along = partial(_cell_size, axis=axis, half=half, places=places, depth=depth, rule=rule)
        lines.append(graded_partition([0.0, half[axis], far], size_along) / MILLIMETRE)
    ends = np.where(np.arange(3) == np.argmin(half), half, far) if endless else half
    mesh = hex_mesh(lines, [Block("plate", np.full(3, -1.0), ends / MILLIMETRE)], mirrors=(0, 1, 2))
    return ConductorMesh(mesh, {"plate": conductivity}, mirrors=(0, 1, 2))


def _cell_size(coordinate: Array, axis: int, half: Array, places: Array, depth: float, rule: MeshRule) -> Array:
    """Cell size wanted at coordinates of one axis, m."""
    edge = half[axis]
    clamped = np.minimum(coordinate, edge)[:, None]
    beside = np.maximum(np.delete(places - half, axis, axis=1), 0.0)
    distance = np.sqrt((clamped - places[:, axis]) ** 2 + np.sum(beside**2, axis=1)).min(axis=1)
    below_face = np.maximum(edge - coordinate, 0.0)
    above_face = np.maximum(coordinate - edge, 0.0)
    inner = np.minimum(rule.distance_share * distance, edge)
    skin = rule.skin_share * depth + rule.growth * below_face
    return np.asarray(np.where(coordinate <= edge, np.minimum(inner, skin), inner + rule.growth * above_face))
