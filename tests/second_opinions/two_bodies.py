"""A finite-element mesh of magnets and a floater together in one ball of air."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np

from spinlev.geometry.common import Array, frozen_array
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.meshes.solids import occ_solid
from spinlev.geometry.shapes import Sphere
from spinlev.geometry.solids import Solid


@dataclass(frozen=True, eq=False)
class TwoBodyMesh:
    """A mesh with the regions `magnet0`, …, `floater` and `air`, and the boundary `outer`.

    Parameters
    ----------
    mesh : the `ngsolve.Mesh`
    magnets : the magnets among the bodies
    center : (3,) centre of the ball of air and origin of the mesh's coordinates, m
    unit : length of one unit of the mesh, m
    ball_radius : radius of the ball of air, in units
    """

    mesh: Any
    magnets: tuple[Magnet, ...]
    center: Array
    unit: float
    ball_radius: float

    def to_meter(self, points: Array) -> Array:
        """Positions (n, 3) in m of `points` (n, 3) in the mesh's coordinates."""
        return np.asarray(points * self.unit + self.center)


def mesh_two_bodies(
    magnets: Sequence[Magnet], position: Array, radius: float, size: float = 0.3, ball_radius: float = 1.15
) -> TwoBodyMesh:
    """Mesh magnets and a sphere, which must be apart: `position`, `radius` m, else as `mesh_with`."""
    return mesh_with(magnets, Sphere(radius, tuple(map(float, position))), size, ball_radius)


def mesh_with(magnets: Sequence[Magnet], floater: Solid, size: float = 0.3, ball_radius: float = 1.15) -> TwoBodyMesh:
    """Mesh magnets and a floater, which must be apart.

    Parameters
    ----------
    size : largest element in the bodies, and in the air twice that, in radii of the ball about all bodies
    ball_radius : of the ball of air, in the same unit
    """
    position, radius = floater.center, floater.circumradius
    corners = np.concatenate([magnet.box.corners for magnet in magnets])
    low = np.minimum(corners.min(axis=0), position - radius)
    high = np.maximum(corners.max(axis=0), position + radius)
    center = (low + high) / 2
    unit = max(float(np.linalg.norm(corners - center, axis=1).max()), float(np.linalg.norm(position - center)) + radius)
    bodies = {f"magnet{k}": occ_solid(magnet.body, center, unit) for k, magnet in enumerate(magnets)}
    bodies["floater"] = occ_solid(floater, center, unit)
    air = occ.Sphere(occ.Pnt(0, 0, 0), ball_radius)
    air.faces.name = "outer"
    for name, solid in bodies.items():
        solid.faces.name = "faces"
        solid.maxh = size
        solid.mat(name)
        air = air - solid
    air.mat("air")
    mesh = ng.Mesh(occ.OCCGeometry(occ.Glue([*bodies.values(), air])).GenerateMesh(maxh=2 * size, grading=0.5))
    mesh.Curve(6)
    return TwoBodyMesh(mesh, tuple(magnets), frozen_array(center, (3,)), unit, ball_radius)
