"""Finite-element meshes of magnets in a ball of air (Netgen and OpenCASCADE).

Lengths inside a mesh are measured in its `unit`, from its `center`, so that coordinates are of order one. The regions
are `magnet0`, `magnet1`, … and `air`; the boundaries are `outer`, the surface of the ball, and `faces`, those of all
magnets.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np

from ..basics import Array, Box, frozen_array
from ..bodies import Magnet, overlapping_magnets

LARGE = 100.0
TINY = 1e-7
"""Lengths in units of the mesh; a gap of a micrometre between centimetres is 1e-4."""


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
    planes : coordinate planes through the centre that cut the ball; only the positive side is meshed
    """

    mesh: Any
    magnets: tuple[Magnet, ...]
    center: Array
    unit: float
    ball_radius: float
    planes: tuple[int, ...] = ()

    @property
    def elements(self) -> int:
        """Number of volume elements."""
        return int(self.mesh.ne)

    def to_meter(self, points: Array) -> Array:
        """Positions (n, 3) in m of `points` (n, 3) in the mesh's coordinates."""
        return np.asarray(points * self.unit + self.center)


def mesh_magnets(
    magnets: Sequence[Magnet],
    settings: MeshSettings | None = None,
    planes: tuple[int, ...] = (),
    edges_of: Sequence[Box] | None = None,
) -> MagnetMesh:
    """Mesh magnets in a ball of air; they may touch each other.

    Parameters
    ----------
    planes : coordinate planes (0: across x, …) that mirror the magnets; only the positive side is meshed. The faces
        there are the boundaries `plane0`, …
    edges_of : the boxes at whose edges and corners the field is singular; by default the magnets

    Raises
    ------
    ValueError : no magnet, or two that overlap
    """
    settings = settings or MeshSettings()
    magnets = tuple(magnets)
    if not magnets:
        raise ValueError("Input magnets must hold at least one magnet; instead received none.")
    for i, j, depth in overlapping_magnets(magnets):
        raise ValueError(f"Input magnets must not overlap; instead magnets {i} and {j} do, {depth * 1e3:.3g} mm deep.")
    corners = np.concatenate([magnet.box.corners for magnet in magnets])
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2
    unit = float(np.linalg.norm(corners - center, axis=1).max())
    kept = _kept_side(planes)
    solids = []
    for k, magnet in enumerate(magnets):
        solid = _solid(magnet.box, center, unit) * kept
        solid.mat(f"magnet{k}")
        solid.maxh = settings.magnet_size * float(np.min(magnet.box.size) * magnet.box.volume ** (1 / 3)) ** 0.5 / unit
        if solid.solids:
            solids.append(solid)
    boxes = [magnet.box for magnet in magnets] if edges_of is None else edges_of
    scaled = [Box(box.size / unit, (box.center - center) / unit, box.rotation) for box in boxes]
    mesh = _generate(solids, kept, planes, scaled, settings)
    return MagnetMesh(mesh, magnets, frozen_array(center, (3,)), unit, settings.ball_radius, planes)


def _kept_side(planes: tuple[int, ...]) -> Any:
    """A box, larger than any ball, on the positive side of the planes."""
    lower = [0.0 if axis in planes else -LARGE for axis in range(3)]
    return occ.Box(occ.Pnt(*lower), occ.Pnt(LARGE, LARGE, LARGE))


def _generate(
    solids: list[Any], kept: Any, planes: tuple[int, ...], boxes: Sequence[Box], settings: MeshSettings
) -> Any:
    air = occ.Sphere(occ.Pnt(0, 0, 0), settings.ball_radius)
    air.faces.name = "outer"
    air = air * kept
    for solid in solids:
        solid.faces.name = "faces"
        air = air - solid
    air.mat("air")
    shape = occ.Glue([*solids, air])
    for face in shape.faces:
        for axis in planes:
            if abs(face.center[axis]) < TINY:
                face.name = f"plane{axis}"
    if settings.hp_layers:
        _mark_singular(shape, boxes)
    mesh = ng.Mesh(
        occ.OCCGeometry(shape).GenerateMesh(maxh=settings.air_size, grading=settings.grading, parallel_meshing=False)
    )
    if settings.hp_layers:
        mesh.RefineHP(settings.hp_layers, settings.hp_factor)
    mesh.Curve(settings.curve_order)
    return mesh


def _mark_singular(shape: Any, boxes: Sequence[Box]) -> None:
    """Mark the edges of boxes, and the points where edges of different directions meet, for hp-refinement."""
    for edge in shape.edges:
        if _edge_directions(edge.center, boxes):
            edge.hpref = 1
    for vertex in shape.vertices:
        directions = _edge_directions(vertex.p, boxes)
        if any(abs(first @ second) < 1 - TINY for first, second in combinations(directions, 2)):
            vertex.hpref = 1


def _edge_directions(point: Any, boxes: Sequence[Box]) -> list[Array]:
    """Directions of the edges of boxes on which a point lies."""
    found = []
    for box in boxes:
        excess = np.abs(box.to_body([point.x, point.y, point.z])) - box.half_edges
        flush = np.abs(excess) < TINY
        if excess.max() < TINY and flush.sum() >= 2:
            found += [box.rotation[:, axis] for axis in range(3) if np.delete(flush, axis).all()]
    return found


def _solid(box: Box, center: Array, unit: float) -> Any:
    """The box as a solid in the mesh's coordinates."""
    half = box.half_edges / unit
    origin = (box.center - center) / unit - box.rotation @ half
    axes = occ.Axes(tuple(map(float, origin)), n=_direction(box.rotation[:, 2]), h=_direction(box.rotation[:, 0]))
    return occ.WorkPlane(axes).Rectangle(2 * half[0], 2 * half[1]).Face().Extrude(float(2 * half[2]))


def _direction(vector: Array) -> Any:
    return occ.gp_Vec(*map(float, vector))
