"""Meshes of conductors: hexahedral ones of boxes on a tensor-product grid, curved tetrahedra of any other solid."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import netgen.meshing as netgen
import netgen.occ as occ
import ngsolve
import numpy as np
from numpy.typing import ArrayLike

from ..common import MU_0, Array, freeze
from ..shapes import Box
from ..solids import Solids, moved
from .solids import occ_solid

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
        return 1 << len(self.mirrors)

    @property
    def pattern(self) -> str:
        return "|".join(self.conductivity)


SizeFunction = Callable[[Array], Array]
SAMPLES = 4000
HEXAHEDRON = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))


def graded_partition(breakpoints: Sequence[float], size: SizeFunction) -> Array:
    """Increasing lines with all `breakpoints`, which share ∫ dx/size between: no cell is larger."""
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
        freeze(self, lower=(3,), upper=(3,))


def hex_mesh(lines: Sequence[Array], blocks: Sequence[Block], mirrors: tuple[int, ...] = ()) -> ngsolve.Mesh:
    """Mesh with the grid `lines` (mm) of each axis: air with `blocks` in it.

    The outer boundary is named "far", and "x0", "y0", "z0" where the lower end of an axis in `mirrors` lies.
    A cell belongs to the last block that holds its centre, so that block faces must be grid lines.
    """
    materials = ["air", *dict.fromkeys(block.material for block in blocks if block.material != "air")]
    mesh = netgen.Mesh()
    mesh.dim = 3
    points = np.empty([len(a) for a in lines], dtype=object)
    for index in np.ndindex(*points.shape):
        position = (float(a[i]) for a, i in zip(lines, index, strict=True))
        points[index] = mesh.Add(netgen.MeshPoint(netgen.Pnt(*position)))
    for number in range(1, 5):
        mesh.Add(netgen.FaceDescriptor(surfnr=number, domin=1, bc=number))
    centers = np.stack(np.meshgrid(*[(a[1:] + a[:-1]) / 2 for a in map(np.asarray, lines)], indexing="ij"), -1)
    number_of = np.ones(centers.shape[:3], int)
    for block in blocks:
        inside = np.all((centers > block.lower) & (centers < block.upper), axis=-1)
        number_of[inside] = materials.index(block.material) + 1
    for cell, number in np.ndenumerate(number_of):
        mesh.Add(netgen.Element3D(int(number), [points[tuple(np.add(cell, corner))] for corner in HEXAHEDRON]))
    for axis, end in itertools.product(range(3), (0, -1)):
        number = axis + 1 if end == 0 and axis in mirrors else 4
        layer = np.take(points, end, axis=axis)
        for i, j in np.ndindex(layer.shape[0] - 1, layer.shape[1] - 1):
            mesh.Add(netgen.Element2D(number, [layer[i + a, j + b] for a, b in SQUARE]))
    for number, name in enumerate(materials, start=1):
        mesh.SetMaterial(number, name)
    for number, name in enumerate([*PLANES, "far"]):
        mesh.SetBCName(number, name)
    return ngsolve.Mesh(mesh)


@dataclass(frozen=True)
class MeshRule:
    """Fineness of the mesh; the defaults suit orders 3 to 5, for which few large cells cost least."""

    distance_share: float = 1.2  # cell size in the plate, in units of the distance to the nearest dipole
    skin_share: float = 2.0  # cell size at the faces, in units of the skin depth
    growth: float = 1.6  # by how much a cell grows per length away from a face
    # half edge of the air box in units of the plate's largest edge; the error of the truncation goes as its inverse
    # cube
    reach: float = 12.0

    def finer(self) -> "MeshRule":
        """The next finer mesh: cells 0.6 times as large, and a slower growth."""
        return MeshRule(0.6 * self.distance_share, 0.6 * self.skin_share, 0.8 * self.growth, self.reach)


def skin_depth(conductivity: float, frequency: float) -> float:
    """δ = (π f μ0 σ)^(-1/2), m; infinite at 0 Hz."""
    return float(1 / np.sqrt(np.pi * frequency * MU_0 * conductivity)) if frequency > 0 else np.inf


def plate_mesh(
    body: Solids,
    conductivity: float | Sequence[float],
    positions: ArrayLike,
    frequency: float,
    rule: MeshRule | None = None,
    endless: bool = False,
) -> ConductorMesh:
    """Mesh for a plate `body` and dipoles at `positions` (n, 3) m, along its axes from its middle, wherever that is.

    Raises ValueError: a size is not positive, or a position is not outside the plate. From `conductivity` (S/m, of
    several bodies of each) and `frequency` (Hz) the skin depth follows; `rule` says how fine the mesh is. An `endless`
    plate reaches, on the same cells, to the end of the air along its two longer edges: of a cuboid only.
    """
    rule, half, places = rule or MeshRule(), body.half_edges, np.asarray(positions, float).reshape(-1, 3)
    if not np.all(half > 0):
        raise ValueError(f"Input size_m must be positive; instead received {body.size.tolist()}.")
    inside = moved(body, np.zeros(3), np.eye(3)).distance(places) <= 0
    if inside.any():
        raise ValueError(
            f"Input positions_m must lie outside the plate; instead received {places[inside][0].tolist()} in its frame."
        )
    metal = np.atleast_1d(conductivity).tolist()
    depth = skin_depth(max(metal), frequency)
    if not isinstance(body, Box):
        return _solid_mesh(body, metal, places, depth, rule)
    places = np.abs(places)
    far = rule.reach * 2 * half.max()
    lines = []
    for axis in range(3):
        size_along = partial(_cell_size, axis=axis, half=half, places=places, depth=depth, rule=rule)
        lines.append(graded_partition([0.0, half[axis], far], size_along) / MILLIMETRE)
    ends = np.where(np.arange(3) == np.argmin(half), half, far) if endless else half
    mesh = hex_mesh(lines, [Block("plate", np.full(3, -1.0), ends / MILLIMETRE)], mirrors=(0, 1, 2))
    return ConductorMesh(mesh, {"plate": metal[0]}, mirrors=(0, 1, 2))


def _cell_size(coordinate: Array, axis: int, half: Array, places: Array, depth: float, rule: MeshRule) -> Array:
    edge = half[axis]
    clamped = np.minimum(coordinate, edge)[:, None]
    beside = np.maximum(np.delete(places - half, axis, axis=1), 0.0)
    distance = np.sqrt((clamped - places[:, axis]) ** 2 + np.sum(beside**2, axis=1)).min(axis=1)
    below_face = np.maximum(edge - coordinate, 0.0)
    above_face = np.maximum(coordinate - edge, 0.0)
    inner = np.minimum(rule.distance_share * distance, edge)
    skin = rule.skin_share * depth + rule.growth * below_face
    return np.asarray(np.where(coordinate <= edge, np.minimum(inner, skin), inner + rule.growth * above_face))


# Of tetrahedra: degree at round surfaces, growth over a rule's and at most, and their number in a radius of curvature.
CURVED, GRADING, STEEPEST, ROUND = 6, 0.25, 0.4, 1.0
FLAT = 1e-5  # How far from a mirror plane a face on it may reach, mm
LOOKS = 2  # Meshes whose points ask for the sizes of the next


def _solid_mesh(body: Solids, metal: Sequence[float], places: Array, depth: float, rule: MeshRule) -> ConductorMesh:
    """`plate_mesh` of solids of any shape in a ball of air, of which planes that mirror them leave a part."""
    at_home = moved(body, np.zeros(3), np.eye(3))
    mirrors = body.mirrors
    far = rule.reach * float(body.size.max()) / MILLIMETRE
    kept = occ.Box(occ.Pnt(*(0.0 if a in mirrors else -2 * far for a in range(3))), occ.Pnt(2 * far, 2 * far, 2 * far))
    air = occ.Sphere(occ.Pnt(0, 0, 0), far)
    air.faces.name = "far"
    air, solids, conductivity = air * kept, [], {}
    for k, (one, sigma) in enumerate(zip(at_home.placed, metal, strict=True)):
        solid = occ_solid(one, np.zeros(3), MILLIMETRE) * kept
        air, name = air - solid, f"plate{k or ''}"
        solid.mat(name)
        # a thin body's elements are flat: as wide as its thickness and the edge of a cube of its volume are in the mean
        solid.maxh = min((one.size.min() * one.volume ** (1 / 3)) ** 0.5, one.half_edges.max()) / MILLIMETRE
        solids.append(solid)
        conductivity[name] = sigma
    air.mat("air")
    shape = occ.Glue([*solids, air])
    for face, axis in itertools.product(shape.faces, mirrors):
        if all(abs(corner[axis]) < FLAT for corner in face.bounding_box):
            face.name = PLANES[axis]
    geometry, grading = occ.OCCGeometry(shape), min(GRADING * rule.growth, STEEPEST)
    sizes = netgen.MeshingParameters(maxh=far, grading=grading, curvaturesafety=ROUND, parallel_meshing=False)
    mesh = geometry.GenerateMesh(sizes)
    for _ in range(LOOKS):
        points = np.array([list(point.p) for point in mesh.Points()]) * MILLIMETRE
        below = -at_home.distance(points)
        inner, below = points[below > -FLAT * MILLIMETRE], below[below > -FLAT * MILLIMETRE]
        away = np.array([np.linalg.norm(places - point, axis=1).min(initial=np.inf) for point in inner])
        wanted = np.minimum(rule.distance_share * away, rule.skin_share * depth + rule.growth * below)
        for point, size in zip(inner, wanted, strict=True):
            if np.isfinite(size):
                sizes.RestrictH(*(point / MILLIMETRE).tolist(), float(size) / MILLIMETRE)
        mesh = geometry.GenerateMesh(sizes)
    found = ngsolve.Mesh(mesh)
    found.Curve(CURVED)
    return ConductorMesh(found, conductivity, mirrors)
