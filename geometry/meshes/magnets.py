"""Finite-element meshes of magnets in a ball of air (Netgen and OpenCASCADE).

Lengths inside a mesh are measured in its `unit`, from its `center`, so that coordinates are of order one. The regions
are `magnet0`, `magnet1`, … and `air`; the boundaries are `outer`, the surface of the ball, and `faces`, those of all
magnets.

Mirror planes of the magnets spare half of it each. They are found from shapes and permeabilities: a mirror plane of the
bodies need not be one of their polarisation. Any polarisation is the sum of parts that are even or odd at every plane
(`parity_parts`), and each part needs but the bodies' share on one side of all planes.
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import TYPE_CHECKING, Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np

from ..common import Array, MeshError, frozen_array
from ..files import LostError, call_apart
from ..magnets import Magnet
from ..overlap import TOUCHING, body_overlap
from ..shapes import Box, Cylinder, Sphere
from ..solids import Part, Solid, moved, with_frame
from .solids import LONGEST, SIMPLER, SMALLEST, SolidMesh, occ_solid, unmeshed

if TYPE_CHECKING:
    import meshio

LARGE = 100.0
TINY = 1e-7  # Lengths in units of the mesh; a gap of a micrometre between centimetres is 1e-4
# Size of the elements at the edges of a part, for each layer that others have there: netgen's layers know no corner of
# more than three edges, and crash.
GRADED = 0.5
ON_EDGE = 5e-3  # How near to the edges of a part's triangles its own lie, in circumradii
SAME_PLACE = 1e-9  # Positions that differ by less than this part of the bodies' size are the same
# A plane in a gap is left out if corners lie nearer to it than this part of the shortest edge: elements at the plane
# would be larger than their distance from the edges, whose singularity is resolved only where elements touch them.
NARROW_SIDE = 0.04


@dataclass(frozen=True)
class MeshSettings:
    """Fineness of the mesh."""

    ball_radius: float = 1.3  # of the ball of air, in radii of the smallest ball about all magnets
    magnet_size: float = 1.0  # largest element in a magnet, in cube roots of its volume
    air_size: float = 1.0  # largest element in the air, in units of the mesh
    grading: float = 0.5  # how fast sizes may grow (0 slow … 1 fast)
    hp_layers: int = 1  # layers of elements that shrink towards the magnets' edges and corners
    hp_factor: float = 0.15  # ratio of the sizes of two such layers
    curve_order: int = 6  # polynomial degree of the curved elements at the sphere and at round magnets
    curvature: float = 2.0  # elements in a radius of curvature
    smallest: float = SMALLEST  # least element that a radius of curvature asks for, in cube roots of a part's volume

    def __post_init__(self) -> None:
        if self.ball_radius <= 1:
            raise ValueError(f"Input ball_radius must exceed 1; instead received {self.ball_radius}.")
        if not 0 < self.hp_factor < 0.25:  # from 1/4 on a tetrahedron with four singular corners turns inside out
            raise ValueError(f"Input hp_factor must lie between 0 and 0.25; instead received {self.hp_factor}.")


@dataclass(frozen=True, eq=False)
class MagnetMesh(SolidMesh):
    """A mesh of magnets in a ball of air, whose radius is in units; one unit is the radius of the ball about them."""

    magnets: tuple[Magnet, ...]  # the bodies; the region of number k is called `magnet{k}`
    ball_radius: float  # radius of the ball of air, in units
    # coordinate planes through the centre that cut the ball; only the positive side is meshed
    planes: tuple[int, ...] = ()

    @property
    def elements(self) -> int:
        return int(self.mesh.ne)


def mesh_magnets(
    magnets: Sequence[Magnet],
    settings: MeshSettings | None = None,
    planes: tuple[int, ...] = (),
    edges_of: Sequence[Solid] | None = None,
) -> MagnetMesh:
    """Mesh `magnets` in a ball of air as finely as `settings` say; they may touch each other.

    Raises ValueError: no magnet, or two that overlap; MeshError, ComputationError: a part from a file cannot be meshed,
    takes too long or too much memory. Coordinate `planes` (0: across x, …) mirror the magnets; only the positive side
    is meshed, and the faces there are the boundaries `plane0`, … At edges and corners of the bodies `edges_of`, by
    default the magnets, the field is singular.
    """
    settings = settings or MeshSettings()
    if not (magnets := tuple(magnets)):
        raise ValueError("Input magnets must hold at least one magnet; instead received none.")
    for i, j in combinations(range(len(magnets)), 2):
        if (depth := body_overlap(magnets[i].body, magnets[j].body)) > TOUCHING:
            raise ValueError(
                f"Input magnets must not overlap; instead magnets {i} and {j} do, {depth * 1e3:.3g} mm deep."
            )
    reach = np.array([magnet.body.reach(np.eye(3)) for magnet in magnets])
    places = np.array([magnet.body.center for magnet in magnets])
    center = ((places - reach).min(axis=0) + (places + reach).max(axis=0)) / 2
    unit = max(magnet.body.farthest(center) for magnet in magnets)
    bodies = [magnet.body for magnet in magnets] if edges_of is None else list(edges_of)
    files = sorted({body.file.name for body in bodies if isinstance(body, Part)})
    given = magnets, bodies, center, unit, settings, planes
    if not files:
        mesh = _finished(_meshed(*given), bodies, settings)
    else:  # on the shape of a part the mesher may crash
        sys.modules["ngsolve.comp"] = ng.comp  # where pickle looks for the class of a mesh: else for a file
        try:
            mesh = call_apart(LONGEST, _meshed_apart, *given)
        except LostError as error:
            raise unmeshed(error, ", ".join(files)) from None
        if _layered(bodies, settings):
            mesh = _finished(mesh, bodies, settings)
    return MagnetMesh(mesh, frozen_array(center, (3,)), unit, magnets, settings.ball_radius, planes)


def _meshed_apart(*given: Any) -> Any:
    """`_meshed`, finished; with layers only a copy is, to crash here if it does: they do not survive pickle."""
    mesh, (_, bodies, _, _, settings, _) = _meshed(*given), given
    if _layered(bodies, settings):
        _finished(pickle.loads(pickle.dumps(mesh)), bodies, settings)
        return mesh
    return _finished(mesh, bodies, settings)


def _layered(edges_of: Sequence[Solid], settings: MeshSettings) -> bool:
    return bool(settings.hp_layers) and not all(isinstance(body, Part) for body in edges_of)


def _finished(mesh: Any, edges_of: Sequence[Solid], settings: MeshSettings) -> Any:
    if _layered(edges_of, settings):
        mesh.RefineHP(settings.hp_layers, settings.hp_factor)
    mesh.Curve(settings.curve_order)
    return mesh


def _meshed(
    magnets: Sequence[Magnet],
    edges_of: Sequence[Solid],
    center: Array,
    unit: float,
    settings: MeshSettings,
    planes: tuple[int, ...],
) -> Any:
    """The mesh of `mesh_magnets`, in `unit` from `center`, without layers; at edges of parts elements are small."""
    lower = [0.0 if axis in planes else -LARGE for axis in range(3)]
    kept = occ.Box(occ.Pnt(*lower), occ.Pnt(LARGE, LARGE, LARGE))
    air = occ.Sphere(occ.Pnt(0, 0, 0), settings.ball_radius)
    air.faces.name = "outer"
    air, solids = air * kept, []
    for k, magnet in enumerate(magnets):
        solid = occ_solid(magnet.body, center, unit) * kept
        solid.mat(f"magnet{k}")
        solid.maxh = _size(magnet.body, settings) / unit
        if solid.solids:
            solid.faces.name = "faces"
            solids.append(solid)
            air = air - solid
    air.mat("air")
    shape = occ.Glue([*solids, air])
    for face in shape.faces:
        for axis in planes:
            if abs(face.center[axis]) < TINY:
                face.name = f"plane{axis}"
    bodies = [moved(body, body.center - center) for body in edges_of]
    parts = [body for body in bodies if isinstance(body, Part)]
    if _layered(bodies, settings):
        _mark_singular(shape, bodies, unit)
    for edge, part in product(shape.edges, parts):
        # where faces of a part meet at an angle
        if edge.mass > TINY and part.edge_distance(_middle(edge)[None] * unit)[0] < ON_EDGE * part.circumradius:
            edge.maxh = min(edge.maxh, _size(part, settings) * GRADED**settings.hp_layers / unit)
    smallest = min((settings.smallest * body.volume ** (1 / 3) / unit for body in parts), default=0.0)
    sizes = {"maxh": settings.air_size, "minh": smallest, "grading": settings.grading}
    try:
        geometry = occ.OCCGeometry(shape)
        mesh = ng.Mesh(geometry.GenerateMesh(**sizes, curvaturesafety=settings.curvature, parallel_meshing=False))
    except Exception as error:  # netgen raises several kinds
        if not parts:
            raise
        files = ", ".join(sorted({part.file.name for part in parts}))
        raise MeshError(f"The mesher gives up {files}: {error}. {SIMPLER}") from None
    return mesh


def _size(body: Solid, settings: MeshSettings) -> float:
    thinnest, cube = float(body.size.min()), body.volume ** (1 / 3)
    return float(settings.magnet_size * (min(thinnest, cube) * cube) ** 0.5)


def _mark_singular(shape: Any, bodies: Sequence[Solid], unit: float) -> None:
    """Mark the edges of bodies, and the points where edges of different directions meet, for hp-refinement."""
    for edge in shape.edges:
        # a sphere's poles are edges of no length
        if edge.mass > TINY and _edge_directions(_middle(edge), bodies, unit):
            edge.hpref = 1
    for vertex in shape.vertices:
        directions = _edge_directions(np.array([vertex.p.x, vertex.p.y, vertex.p.z]), bodies, unit)
        if any(abs(first @ second) < 1 - TINY for first, second in combinations(directions, 2)):
            vertex.hpref = 1


def _middle(edge: Any) -> Array:
    start, end = edge.parameter_interval
    return np.array(list(edge.Value((start + end) / 2)))


def _edge_directions(point: Array, bodies: Sequence[Solid], unit: float) -> list[Array]:
    """Directions of the edges of bodies on which a point of the mesh's coordinates lies."""
    found = []
    for body in bodies:
        local = body.to_body(point * unit)
        if isinstance(body, Box):
            excess = np.abs(local) - body.half_edges
            flush = np.abs(excess) < TINY * unit
            if excess.max() < TINY * unit and flush.sum() >= 2:
                found += [body.rotation[:, axis] for axis in range(3) if np.delete(flush, axis).all()]
        elif isinstance(body, Cylinder) and body.edge_distance((point * unit)[None])[0] < TINY * unit:
            found.append(np.asarray(body.rotation @ np.array([-local[1], local[0], 0.0]) / np.hypot(*local[:2])))
    return found


# Names and vertex order of NGSolve's element shapes in meshio, where volumes are positive.
MESHIO_SHAPES = {
    "TET": ("tetra", [0, 2, 1, 3]),
    "PRISM": ("wedge", [0, 2, 1, 3, 5, 4]),
    "PYRAMID": ("pyramid", [0, 3, 2, 1, 4]),
    "HEX": ("hexahedron", [0, 3, 2, 1, 4, 7, 6, 5]),
}


def to_meshio(mesh: MagnetMesh) -> meshio.Mesh:
    """The mesh with straight edges in m; Gmsh's regions are k + 1 of `magnet{k}`, and of air the last."""
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


@dataclass(frozen=True, eq=False)
class Symmetry:
    """Mirror planes through one centre."""

    center: Array  # (3,) m
    axes: Array  # (3, 3) matrix whose columns are the axes of the mirrors' frame
    planes: tuple[int, ...]  # which of the planes across those axes mirror the bodies onto themselves

    def to_frame(self, magnet: Magnet) -> Magnet:
        """The magnet as seen in the mirrors' frame: planes are coordinate planes through the origin."""
        return replace(magnet, body=with_frame(moved(magnet.body, magnet.body.center - self.center), self.axes.T))


def find_symmetry(magnets: Sequence[Magnet]) -> Symmetry:
    """The frame, of the rotor or of the first magnet, in which the bodies have most mirror planes."""
    found = []
    for axes in (np.eye(3), magnets[0].body.rotation):
        ends = np.concatenate([_ends(magnet.body, axes) for magnet in magnets])
        symmetry = Symmetry(axes @ ((ends.min(axis=0) + ends.max(axis=0)) / 2), axes, ())
        seen = [symmetry.to_frame(magnet) for magnet in magnets]
        planes = [a for a in range(3) if mirror_images(seen, a) is not None and not _in_narrow_gap(seen, a)]
        found.append(replace(symmetry, planes=tuple(planes)))
    return max(found, key=lambda symmetry: len(symmetry.planes))


def _in_narrow_gap(magnets: Sequence[Magnet], axis: int) -> bool:
    """Whether the plane across a coordinate axis runs close by a corner of a body, but not through it."""
    bodies = [magnet.body for magnet in magnets]
    corners = [body.corners if isinstance(body, Box) else _ends(body, np.eye(3)) for body in bodies]
    heights = np.abs(np.concatenate(corners)[:, axis])
    shortest = min(float(body.size.min()) for body in bodies)
    return bool(np.any((heights > SAME_PLACE * shortest) & (heights < NARROW_SIDE * shortest)))


def _ends(body: Solid, axes: Array) -> Array:
    """(2, 3) coordinates along axes (columns) between which a body lies."""
    reach = body.reach(axes.T)
    return np.asarray(body.center @ axes + np.array([-reach, reach]))


def _same_body(body: Solid, other: Solid, flip: Array) -> bool:
    """Whether the mirror image of a body takes the place of another."""
    allowed = SAME_PLACE * max(body.circumradius, float(np.linalg.norm(body.center)))
    if body.kind != other.kind or np.linalg.norm(body.center * flip - other.center) > allowed:
        return False
    if isinstance(body, Box):
        distance = np.linalg.norm((body.corners * flip)[:, None] - other.corners, axis=-1)
        return bool(distance.min(axis=1).max() <= allowed)
    if isinstance(body, Part) or np.abs(body.shape_numbers - other.shape_numbers).max() > allowed:
        return False
    return isinstance(body, Sphere) or bool(abs((body.rotation[:, 2] * flip) @ other.rotation[:, 2]) > 1 - 1e-15)


def mirror_images(magnets: Sequence[Magnet], axis: int) -> list[int] | None:
    """Number of the body that is the mirror image of each, at the plane across a coordinate axis; None if one lacks."""
    images, flip = [], mirror(axis)
    for magnet in magnets:
        seen = magnet.permeability_in_rotor * flip[:, None] * flip
        alike = (np.allclose(seen, other.permeability_in_rotor, rtol=0, atol=1e-12) for other in magnets)
        same = (k for k, like in enumerate(alike) if like and _same_body(magnet.body, magnets[k].body, flip))
        if (image := next(same, None)) is None:
            return None
        images.append(image)
    return images


def mirror(axis: int) -> Array:
    """(3,) factors that mirror a vector at the plane across a coordinate axis."""
    return np.where(np.arange(3) == axis, -1.0, 1.0)


def parity_parts(
    magnets: Sequence[Magnet], planes: tuple[int, ...], polarizations: Array | None = None
) -> list[tuple[tuple[int, ...], Array]]:
    """Parts of the polarisation that are even (+1) or odd (-1) at each of the `planes`, those that are zero left out.

    Of `polarizations` (..., n, 3) T, one or several sets, by default those of the `magnets`: pairs of the signs, one a
    plane, and the polarisations (..., n, 3), T. The potential has the same signs.
    """
    whole = polarizations
    if whole is None:
        whole = np.array([magnet.polarization_in_rotor for magnet in magnets])
    images = {axis: mirror_images(magnets, axis) for axis in planes}
    parts = []
    for signs in product((1, -1), repeat=len(planes)):
        part = whole
        for axis, sign in zip(planes, signs, strict=True):
            part = (part + sign * part[..., images[axis], :] * mirror(axis)) / 2
        if np.abs(part).max() > 1e-14 * np.abs(whole).max():
            parts.append((signs, part))
    return parts
