"""Tetrahedral meshes of conductors of any shape, from OpenCASCADE solids: for those whose eddy currents are known."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import ngsolve
import numpy as np
from netgen.occ import Box as OccBox, Glue, OCCGeometry, Pnt

from spinlev.geometry.meshes.plate import ConductorMesh


@dataclass(frozen=True, eq=False)
class Conductor:
    """A conducting solid.

    Parameters
    ----------
    shape : netgen.occ solid, in millimetres
    conductivity : S/m
    cell : largest cell size in it, mm
    """

    shape: Any
    conductivity: float
    cell: float


def occ_mesh(
    conductors: Mapping[str, Conductor], reach: float = 6.0, grading: float = 0.5, curve_order: int = 3
) -> ConductorMesh:
    """Mesh of separate `conductors` by name, in an air box `reach` times as far as the outermost conductor point.

    Faces are curved to `curve_order`.  Cells grow from the conductors outwards with Netgen's `grading` (0 to 1).

    Raises
    ------
    ValueError : no conductors, or a cell size or conductivity that is not positive
    """
    if not conductors:
        raise ValueError("Input conductors must hold at least one conductor; instead received none.")
    lower, upper, solids = np.full(3, np.inf), np.full(3, -np.inf), []
    for name, conductor in conductors.items():
        if not conductor.cell > 0:
            raise ValueError(f"Input cell_mm of {name} must be positive; instead received {conductor.cell!r}.")
        solid = conductor.shape
        solid.mat(name)
        solid.maxh = conductor.cell
        corners = solid.bounding_box
        lower = np.minimum(lower, [corners[0].x, corners[0].y, corners[0].z])
        upper = np.maximum(upper, [corners[1].x, corners[1].y, corners[1].z])
        solids.append(solid)
    center, half = (lower + upper) / 2, reach * (upper - lower).max() / 2
    air = OccBox(Pnt(*(center - half)), Pnt(*(center + half)))
    air.mat("air")
    for face in air.faces:
        face.name = "far"
    for solid in solids:
        air = air - solid
    mesh = ngsolve.Mesh(OCCGeometry(Glue([*solids, air])).GenerateMesh(grading=grading, maxh=float(half)))
    mesh.Curve(curve_order)
    return ConductorMesh(mesh, {name: conductor.conductivity for name, conductor in conductors.items()})
