"""Meshes of magnets for other programs, by meshio."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import ngsolve as ng
import numpy as np

from .magnets import MagnetMesh

if TYPE_CHECKING:
    import meshio

MESHIO_SHAPES = {
    "TET": ("tetra", [0, 2, 1, 3]),
    "PRISM": ("wedge", [0, 2, 1, 3, 5, 4]),
    "PYRAMID": ("pyramid", [0, 3, 2, 1, 4]),
    "HEX": ("hexahedron", [0, 3, 2, 1, 4, 7, 6, 5]),
}
"""Names and vertex order of NGSolve's element shapes in meshio, where volumes are positive."""


def to_meshio(mesh: MagnetMesh) -> meshio.Mesh:
    """The mesh with straight edges, coordinates in m, and the region of every cell as cell data.

    Region k + 1 is `magnet{k}`, the last one is `air`; the names are in `field_data`, as Gmsh has them.
    """
    import meshio

    regions = {name: k + 1 for k, name in enumerate(mesh.mesh.GetMaterials())}
    cells: dict[str, list[list[int]]] = {}
    numbers: dict[str, list[int]] = {}
    for element in mesh.mesh.Elements(ng.VOL):
        name, order = MESHIO_SHAPES[element.type.name]
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
    import meshio

    gmsh = Path(path).suffix == ".msh"  # version 4 of that format would lose the regions
    meshio.write(path, to_meshio(mesh), file_format="gmsh22" if gmsh else None)
