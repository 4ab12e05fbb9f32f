"""Mesh of one connected piece of metal, without the air around it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np

from ..basics import Array, Box, Cylinder, Solid, frozen_array

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
    shape = _solid(bodies[0], center, unit)
    for body in bodies[1:]:
        shape = shape + _solid(body, center, unit)
    sizes = {"maxh": largest, "curvaturesafety": ROUND}
    mesh = ng.Mesh(occ.OCCGeometry(shape).GenerateMesh(**sizes, parallel_meshing=False))
    mesh.Curve(CURVED)
    return MetalMesh(mesh, frozen_array(center, (3,)), unit)


def _solid(body: Solid, center: Array, unit: float) -> Any:
    """The body as a solid in the mesh's coordinates."""
    x, _, z = body.rotation.T
    foot = (body.center - center - body.size[2] / 2 * z) / unit
    if isinstance(body, Cylinder):
        axes = occ.Axes(tuple(map(float, foot)), n=_direction(z), h=_direction(x))
        return occ.Cylinder(axes, body.radius / unit, body.height / unit)
    assert isinstance(body, Box)
    half = body.half_edges / unit
    corner = foot - body.rotation[:, :2] @ half[:2]
    axes = occ.Axes(tuple(map(float, corner)), n=_direction(z), h=_direction(x))
    return occ.WorkPlane(axes).Rectangle(2 * half[0], 2 * half[1]).Face().Extrude(float(2 * half[2]))


def _direction(vector: Array) -> Any:
    return occ.gp_Vec(*map(float, vector))
