"""Finite-element meshes of magnets in a ball of air (Netgen and OpenCASCADE).

Lengths inside a mesh are measured in its `unit`, from its `center`, so that coordinates are of order one. The regions
are `magnet0`, `magnet1`, … and `air`; the boundaries are `outer`, the surface of the ball, and `faces`, those of all
magnets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import meshio
import netgen.occ as occ
import ngsolve as ng
import numpy as np

from .box import Array, Box, frozen_array
from .magnet import Magnet


@dataclass(frozen=True)
class MeshSettings:
    """How fine the mesh is.

    Parameters
    ----------
    ball_radius : of the ball of air, in radii of the smallest ball about all magnets
    magnet_size : largest element in a magnet, in cube roots of its volume
    air_size : largest element in the air, in units of the mesh
    grading : how fast sizes may grow (0 slow … 1 fast)
    hp_layers : layers of elements that shrink towards the magnets' edges and corners
    hp_factor : ratio of the sizes of two such layers
    curve_order : polynomial degree of the curved elements at the sphere
    """

    ball_radius: float = 1.3
    magnet_size: float = 1.0
    air_size: float = 1.0
    grading: float = 0.5
    hp_layers: int = 1
    hp_factor: float = 0.15
    curve_order: int = 6

    def __post_init__(self) -> None:
        if self.ball_radius <= 1:
            raise ValueError(f"Input ball_radius must exceed 1; instead received {self.ball_radius}.")
        if not 0 < self.hp_factor < 0.25:  # from 1/4 on a tetrahedron with four singular corners turns inside out
            raise ValueError(f"Input hp_factor must lie between 0 and 0.25; instead received {self.hp_factor}.")


@dataclass(frozen=True, eq=False)
class MagnetMesh:
    """A mesh of magnets in a ball of air.

    Parameters
    ----------
    mesh : the `ngsolve.Mesh`
    magnets : the bodies; the region of number k is called `magnet{k}`
    center : (3,) centre of the ball and origin of the mesh's coordinates, m
    unit : length of one unit of the mesh, m: radius of the ball about all magnets
    ball_radius : radius of the ball of air, in units
    """

    mesh: Any
    magnets: tuple[Magnet, ...]
    center: Array
    unit: float
    ball_radius: float

    @property
    def elements(self) -> int:
        """Number of volume elements."""
        return int(self.mesh.ne)

    def to_meter(self, points: Array) -> Array:
        """Positions (n, 3) in m of `points` (n, 3) in the mesh's coordinates."""
        return np.asarray(points * self.unit + self.center)


def mesh_magnets(magnets: Sequence[Magnet], settings: MeshSettings | None = None) -> MagnetMesh:
    """Mesh magnets in a ball of air; they may touch each other.

    Raises
    ------
    ValueError : no magnet, or two that overlap
    """
    settings = settings or MeshSettings()
    magnets = tuple(magnets)
    if not magnets:
        raise ValueError("Input magnets must hold at least one magnet; instead received none.")
    corners = np.concatenate([magnet.box.corners for magnet in magnets])
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2
    unit = float(np.linalg.norm(corners - center, axis=1).max())
    solids = [_solid(magnet.box, center, unit) for magnet in magnets]
    for (i, first), (j, second) in combinations(enumerate(solids), 2):
        overlap = (first * second).mass
        if overlap > 1e-9 * min(first.mass, second.mass):
            volume = overlap * unit**3 * 1e9
            raise ValueError(f"Input magnets must not overlap; instead magnets {i} and {j} share {volume:.3g} mm³.")
    for k, (magnet, solid) in enumerate(zip(magnets, solids, strict=True)):
        solid.mat(f"magnet{k}")
        solid.maxh = settings.magnet_size * magnet.box.volume ** (1 / 3) / unit
    mesh = _generate(solids, settings)
    return MagnetMesh(mesh, magnets, frozen_array(center, (3,)), unit, settings.ball_radius)


def _generate(solids: list[Any], settings: MeshSettings) -> Any:
    air = occ.Sphere(occ.Pnt(0, 0, 0), settings.ball_radius)
    air.faces.name = "outer"
    for solid in solids:
        solid.faces.name = "faces"
        air = air - solid
    air.mat("air")
    shape = occ.Glue([*solids, air])
    if settings.hp_layers:
        for solid in shape.solids:
            if solid.name != "air":
                for part in (*solid.edges, *solid.vertices):
                    part.hpref = 1
    mesh = ng.Mesh(occ.OCCGeometry(shape).GenerateMesh(maxh=settings.air_size, grading=settings.grading))
    if settings.hp_layers:
        mesh.RefineHP(settings.hp_layers, settings.hp_factor)
    mesh.Curve(settings.curve_order)
    return mesh


def _solid(box: Box, center: Array, unit: float) -> Any:
    """The box as a solid in the mesh's coordinates."""
    half = box.half_edges / unit
    origin = (box.center - center) / unit - box.rotation @ half
    axes = occ.Axes(tuple(map(float, origin)), n=_direction(box.rotation[:, 2]), h=_direction(box.rotation[:, 0]))
    return occ.WorkPlane(axes).Rectangle(2 * half[0], 2 * half[1]).Face().Extrude(float(2 * half[2]))


def _direction(vector: Array) -> Any:
    return occ.gp_Vec(*map(float, vector))


MESHIO_SHAPES = {
    ng.ET.TET: ("tetra", [0, 2, 1, 3]),
    ng.ET.PRISM: ("wedge", [0, 2, 1, 3, 5, 4]),
    ng.ET.PYRAMID: ("pyramid", [0, 3, 2, 1, 4]),
    ng.ET.HEX: ("hexahedron", [0, 3, 2, 1, 4, 7, 6, 5]),
}
"""Names and vertex order of the element shapes in meshio, where volumes are positive."""


def to_meshio(mesh: MagnetMesh) -> meshio.Mesh:
    """The mesh with straight edges, coordinates in m, and the region of every cell as cell data.

    Region k + 1 is `magnet{k}`, the last one is `air`; the names are in `field_data`, as Gmsh has them.
    """
    regions = {name: k + 1 for k, name in enumerate(mesh.mesh.GetMaterials())}
    cells: dict[str, list[list[int]]] = {}
    numbers: dict[str, list[int]] = {}
    for element in mesh.mesh.Elements(ng.VOL):
        name, order = MESHIO_SHAPES[element.type]
        cells.setdefault(name, []).append([element.vertices[i].nr for i in order])
        numbers.setdefault(name, []).append(regions[element.mat])
    points = mesh.to_meter(np.array([vertex.point for vertex in mesh.mesh.vertices]))
    ids = [np.array(values, dtype=np.int32) for values in numbers.values()]
    return meshio.Mesh(
        points,
        {name: np.array(rows) for name, rows in cells.items()},
        cell_data={"gmsh:physical": ids, "gmsh:geometrical": ids},
        field_data={name: np.array([number, 3]) for name, number in regions.items()},
    )


def write_mesh(mesh: MagnetMesh, path: str | Path) -> None:
    """Write the mesh in the format of the file's suffix (.vtu, .msh, .xdmf, …), see `to_meshio`."""
    gmsh = Path(path).suffix == ".msh"  # version 4 of that format would lose the regions
    meshio.write(path, to_meshio(mesh), file_format="gmsh22" if gmsh else None)
