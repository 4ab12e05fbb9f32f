"""Mesh of one connected piece of metal, without the air around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import netgen.occ as occ
import ngsolve
import ngsolve as ng
import numpy as np

from ..common import Array, frozen_array
from ..solids import Solid
from .solids import occ_solid

CURVED = 5  # Polynomial degree of the elements at a mantle; they leave 1e-4 of its volume and place
ROUND = 1.0  # Elements in a radius of curvature


@dataclass(frozen=True, eq=False)
class MetalMesh:
    """Mesh of a piece of metal."""

    mesh: Any  # the `ngsolve.Mesh`
    center: Array  # (3,) origin of the mesh's coordinates, m
    unit: float  # length of one unit of the mesh, m

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


MILLIMETRE = 1e-3  # Length unit of all meshes, m
PLANES = ("x0", "y0", "z0")  # Boundary names of the mirror planes


@dataclass(frozen=True, eq=False)
class ConductorMesh:
    """A volume mesh in millimetres with the boundary "far" all around."""

    mesh: ngsolve.Mesh  # NGSolve mesh; where there are mirrors, it holds only the part with non-negative coordinates
    conductivity: Mapping[str, float]  # S/m by material name; every other material is air
    # axes (0, 1, 2) whose plane through the origin mirrors the conductors; those boundaries are named "x0", "y0", "z0".
    # Sources and fields need no symmetry: they are split into parity classes
    mirrors: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        materials = set(self.mesh.GetMaterials())
        for name, value in self.conductivity.items():
            if name not in materials:
                raise ValueError(f"Input conductivity must name one of {sorted(materials)}; instead received {name}.")
            if not value > 0:
                raise ValueError(f"Input conductivity of {name} must be positive, S/m; instead received {value!r}.")
        if "far" not in self.mesh.GetBoundaries():
            found = sorted(set(self.mesh.GetBoundaries()))
            raise ValueError(f"Input mesh must have a boundary 'far'; instead received {found}.")

    @property
    def images(self) -> int:
        """Number of mirror images that make up the whole."""
        return 1 << len(self.mirrors)

    @property
    def pattern(self) -> str:
        """Regular expression of the conducting materials."""
        return "|".join(self.conductivity)
