"""Structured hexahedral meshes of boxes on a tensor-product grid, and where its lines lie."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import netgen.meshing as netgen
import ngsolve
import numpy as np

from ..basics import Array, frozen_array
from .conductors import PLANES

SizeFunction = Callable[[Array], Array]
SAMPLES = 4000
HEXAHEDRON = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))


def graded_partition(breakpoints: Sequence[float], size: SizeFunction) -> Array:
    """Increasing grid lines that hold all `breakpoints` and whose spacing follows `size`.

    Between neighbouring breakpoints the lines share ∫ dx/size equally, so that no cell is larger than asked for.

    Raises
    ------
    ValueError : breakpoints do not increase
    """
    if np.any(np.diff(breakpoints) <= 0):
        raise ValueError(f"Input breakpoints must increase; instead received {list(breakpoints)}.")
    lines = [float(breakpoints[0])]
    for start, end in itertools.pairwise(breakpoints):
        fine = np.linspace(start, end, SAMPLES)
        density = 1 / size(fine)
        count = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(fine))])
        cells = max(1, int(np.ceil(count[-1] - 1e-9)))
        lines.extend(np.interp(np.arange(1, cells) * count[-1] / cells, count, fine))
        lines.append(float(end))
    return np.array(lines)


@dataclass(frozen=True, eq=False)
class Block:
    """An axis-parallel box of one material, from `lower` (3,) to `upper` (3,), mm; later blocks cut earlier ones."""

    material: str
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "lower", frozen_array(self.lower, (3,)))
        object.__setattr__(self, "upper", frozen_array(self.upper, (3,)))


def hex_mesh(lines: Sequence[Array], blocks: Sequence[Block], mirrors: tuple[int, ...] = ()) -> ngsolve.Mesh:
    """Mesh with the grid `lines` (mm) of each axis: air with `blocks` in it.

    The outer boundary is named "far", and "x0", "y0", "z0" where the lower end of an axis in `mirrors` lies.
    A cell belongs to the last block that holds its centre, so that block faces must be grid lines.
    """
    materials = ["air", *dict.fromkeys(block.material for block in blocks if block.material != "air")]
    mesh = netgen.Mesh()
    mesh.dim = 3
    points = _add_points(mesh, lines)
    for number in range(1, 5):
        mesh.Add(netgen.FaceDescriptor(surfnr=number, domin=1, bc=number))
    centers = np.stack(np.meshgrid(*[(a[1:] + a[:-1]) / 2 for a in map(np.asarray, lines)], indexing="ij"), -1)
    number_of = np.ones(centers.shape[:3], int)
    for block in blocks:
        inside = np.all((centers > block.lower) & (centers < block.upper), axis=-1)
        number_of[inside] = materials.index(block.material) + 1
    for cell, number in np.ndenumerate(number_of):
        corners = [points[tuple(np.add(cell, corner))] for corner in HEXAHEDRON]
        mesh.Add(netgen.Element3D(int(number), corners))
    _add_boundary(mesh, points, mirrors)
    for number, name in enumerate(materials, start=1):
        mesh.SetMaterial(number, name)
    for number, name in enumerate([*PLANES, "far"]):
        mesh.SetBCName(number, name)
    return ngsolve.Mesh(mesh)


def _add_points(mesh: netgen.Mesh, lines: Sequence[Array]) -> np.ndarray:
    points = np.empty([len(a) for a in lines], dtype=object)
    for index in np.ndindex(*points.shape):
        position = (float(a[i]) for a, i in zip(lines, index, strict=True))
        points[index] = mesh.Add(netgen.MeshPoint(netgen.Pnt(*position)))
    return points


def _add_boundary(mesh: netgen.Mesh, points: np.ndarray, mirrors: tuple[int, ...]) -> None:
    for axis in range(3):
        for end in (0, -1):
            number = axis + 1 if end == 0 and axis in mirrors else 4
            layer = np.take(points, end, axis=axis)
            for i, j in np.ndindex(layer.shape[0] - 1, layer.shape[1] - 1):
                mesh.Add(netgen.Element2D(number, [layer[i + a, j + b] for a, b in SQUARE]))
