"""A meshed set of conductors in air: what an eddy-current solver needs to know of a geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import ngsolve

MILLIMETRE = 1e-3
"""Length unit of all meshes, m."""
PLANES = ("x0", "y0", "z0")
"""Boundary names of the mirror planes."""


@dataclass(frozen=True, eq=False)
class ConductorMesh:
    """A volume mesh in millimetres with the boundary "far" all around.

    Parameters
    ----------
    mesh : NGSolve mesh; where there are mirrors, it holds only the part with non-negative coordinates
    conductivity : S/m by material name; every other material is air
    mirrors : axes (0, 1, 2) whose plane through the origin mirrors the conductors; those boundaries are named
        "x0", "y0", "z0".  Sources and fields need no symmetry: they are split into parity classes
    """

    mesh: ngsolve.Mesh
    conductivity: Mapping[str, float]
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
