"""Mesh of one connected piece of metal, without the air around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np

from ..basics import Array, Solid, frozen_array
from .solids import occ_solid

CURVED = 5
"""Polynomial degree of the elements at a mantle; they leave 1e-4 of its volume and place."""
ROUND = 1.0
"""Elements in a radius of curvature."""


@dataclass(frozen=True, eq=False)
class MetalMesh:
    """Mesh of a piece of metal.

    Parameters
    ----------
    mesh : the `ngsolve.Mesh`
    center : (3,) origin of the mesh's coordinates, m
    unit : length of one unit of the mesh, m
    """

    mesh: Any
    center: Array
    unit: float

    def to_meter(self, points: Array) -> Array:
        """Positions (n, 3) in m of `points` (n, 3) in the mesh's coordinates."""
        return np.asarray(points * self.unit + self.center)


def mesh_metal(bodies: Sequence[Solid], largest: float = 0.7) -> MetalMesh:
    """Mesh of bodies that touch; `largest` element in cube roots of the smallest body's volume."""
    center = np.mean([body.center for body in bodies], axis=0)
    unit = min(body.volume for body in bodies) ** (1 / 3)
    shape = occ_solid(bodies[0], center, unit)
    for body in bodies[1:]:
        shape = shape + occ_solid(body, center, unit)
    sizes = {"maxh": largest, "curvaturesafety": ROUND}
    mesh = ng.Mesh(occ.OCCGeometry(shape).GenerateMesh(**sizes, parallel_meshing=False))
    mesh.Curve(CURVED)
    return MetalMesh(mesh, frozen_array(center, (3,)), unit)
