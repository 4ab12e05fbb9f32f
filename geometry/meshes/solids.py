"""Bodies as solids of OpenCASCADE: for meshes, rules of integration and STEP files."""

import contextlib
import logging
import re
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from scipy.spatial.transform import Rotation

from ..common import Array, ComputationError, InputError, MeshError, frozen_array
from ..files import CrashError, LostError, call_apart
from ..shapes import Box, Sphere
from ..solids import Part, Solid, moved

MILLIMETRE = 1e-3
CURVED, ROUND = 6, 2.0  # Degree of the elements at round surfaces, and how many of them in a radius of curvature
METAL_CURVED, METAL_ROUND = 5, 1.0  # the same for metal; they leave 1e-4 of a mantle's volume and place
METAL_LARGEST = 0.7  # Element of metal, in cube roots of the smallest body's volume
FINER = 1, 2, 4  # by which elements of metal are made smaller where the mesher fails
# Least element that a radius of curvature asks for, in cube roots of a part's volume: one spans a small fillet.
SMALLEST = 0.06
# Of that, where the mesher fails: its luck with the same part is another with elements of other sizes.
OTHERWISE = (1.0, 0.5, 0.0)
# Degree of the rule in small elements, and their edge times the degree of the polynomial, by the part's, at most.
FEW, SMALL = 8, 1.5
LONGEST = 60.0  # Seconds of processor time for a mesh of a part
SAME = 1e-7  # Distance of corners of facets that are one, in sizes of the solid
WITHIN = 1e-9  # Relative difference of volumes above which a cavity does not lie within the body
# The time, and a count of the files that the process has written: the rest is the same for the same solid.
OWN_WORDS = re.compile(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'|(?<=translator )[\d. ]+(?=')")
SIMPLER = "Leave out small features of the part, or export it again."
Try = TypeVar("Try")
Made = TypeVar("Made")


def occ_solid(body: Solid, center: Array, unit: float) -> Any:
    """The body as a solid in a mesh's coordinates: lengths in `unit` (m) from `center` (3,) m."""
    x, _, z = body.rotation.T
    if isinstance(body, Sphere):
        return occ.Sphere(occ.Pnt(*map(float, (body.center - center) / unit)), body.radius / unit)
    if isinstance(body, Part):
        solid = _turned(read_brep(body.brep).Move(_vector(body.origin / MILLIMETRE)), body.rotation)
        return solid.Scale(occ.Pnt(0, 0, 0), MILLIMETRE / unit).Move(_vector((body.center - center) / unit))
    foot = (body.center - center - body.half_edges[2] * z) / unit
    if isinstance(body, Box):
        half = body.half_edges / unit
        axes = occ.Axes(tuple(map(float, foot - body.rotation[:, :2] @ half[:2])), n=_vector(z), h=_vector(x))
        return occ.WorkPlane(axes).Rectangle(2 * half[0], 2 * half[1]).Face().Extrude(float(2 * half[2]))
    axes = occ.Axes(tuple(map(float, foot)), n=_vector(z), h=_vector(x))
    filled = occ.Cylinder(axes, body.radius / unit, body.height / unit)
    if body.inner_radius:
        return filled - occ.Cylinder(axes, body.inner_radius / unit, body.height / unit)
    return filled


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """A mesh of solids whose coordinates are lengths in `unit` from `center`."""

    mesh: Any  # the `ngsolve.Mesh`
    center: Array  # (3,) origin of the mesh's coordinates, m
    unit: float  # length of one unit of the mesh, m

    def to_meter(self, points: Array) -> Array:
        return np.asarray(points * self.unit + self.center)


def mesh_metal(bodies: Sequence[Solid]) -> SolidMesh:
    """Mesh of bodies that touch, without air. Raises MeshError."""
    center = np.mean([body.center for body in bodies], axis=0)
    unit = min(body.volume for body in bodies) ** (1 / 3)
    first, *others = (occ_solid(body, center, unit) for body in bodies)
    what = f"metal of {' and '.join(body.described_size for body in bodies)}"
    sizes = [{"maxh": METAL_LARGEST / finer, "curvaturesafety": METAL_ROUND} for finer in FINER]
    whole = sum(others, first)
    mesh = first_made(sizes, lambda size: _generated(whole, what, **size))
    mesh.Curve(METAL_CURVED)
    return SolidMesh(mesh, frozen_array(center, (3,)), unit)


def first_made(tries: Iterable[Try], make: Callable[[Try], Made]) -> Made:
    """What is made of the first of several `tries` at which the mesher neither crashes nor raises MeshError."""
    *others, last = tries
    for one in others:
        with contextlib.suppress(CrashError, MeshError):
            return make(one)
    return make(last)


def _generated(shape: Any, what: str, **sizes: float) -> Any:
    try:
        return ng.Mesh(occ.OCCGeometry(shape).GenerateMesh(**sizes, parallel_meshing=False))
    except Exception as error:  # several kinds, as of a thin wall through which large elements would go
        raise MeshError(f"The mesher gives up {what}: {error}. {SIMPLER}") from None


def read_brep(brep: str) -> Any:
    """The solid of OpenCASCADE's own text of it."""
    with tempfile.NamedTemporaryFile("w", suffix=".brep", encoding="utf-8") as copy:
        copy.write(brep)
        copy.flush()
        (solid,) = occ.OCCGeometry(copy.name).shape.solids
    return solid


def _turned(shape: Any, rotation: Array) -> Any:
    turn = Rotation.from_matrix(rotation).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(turn))
    return shape.Rotate(occ.Axis(occ.Pnt(0, 0, 0), occ.gp_Dir(*map(float, turn / angle))), angle) if angle else shape


def part_rule(body: Part, order: int) -> tuple[Array, Array]:
    """Points (n, 3) m and weights (n,) m³ in a part, to about `order`. Raises MeshError, ComputationError."""
    try:
        points, weights = _rule(body.brep, order)
    except LostError as error:
        raise unmeshed(error, body.file.name) from None
    local = points * MILLIMETRE + body.origin
    return body.center + local @ body.rotation.T, weights * MILLIMETRE**3


@lru_cache(maxsize=8)
def _rule(brep: str, order: int) -> tuple[Array, Array]:
    logging.getLogger("spinlev").info("Mesh of a part from a STEP file ...")  # a damaged one takes its whole minute
    return first_made(OTHERWISE, lambda share: call_apart(LONGEST, rule_in_solid, brep, order, share * SMALLEST))


def unmeshed(error: LostError, name: str) -> ComputationError:
    """Error for files whose mesh another process did not make; a MeshError where another mesh may do."""
    kind = MeshError if isinstance(error, CrashError) else ComputationError
    return kind(f"The mesher {error}: {name}. {SIMPLER}")


def rule_in_solid(brep: str, order: int, smallest: float = SMALLEST) -> tuple[Array, Array]:
    """Points and weights, mm, mm³, in the solid `brep` for about an `order`; its `smallest` element. MeshError."""
    solid = read_brep(brep)
    unit = float(solid.mass) ** (1 / 3)
    sizes = {"maxh": 0.6 * unit, "minh": smallest * unit, "curvaturesafety": ROUND, "grading": 0.6}
    mesh = _generated(solid, "the part", **sizes)
    mesh.Curve(CURVED)
    few, whole = ng.IntegrationRule(ng.TET, FEW), ng.IntegrationRule(ng.TET, max(order, FEW))
    corners = np.array([vertex.point for vertex in mesh.vertices])
    extent = float(np.ptp(corners, axis=0).max())
    tets = np.array([[vertex.nr for vertex in element.vertices] for element in mesh.Elements(ng.VOL)])
    large = np.ptp(corners[tets], axis=1).max(axis=1) * order > SMALL * extent
    points, weights = _mapped(few, mesh.MapToAllElements(few, ng.VOL), len(tets))
    found = [(points[~large], weights[~large])]
    for number in np.flatnonzero(large):
        found.append(_mapped(whole, mesh.GetTrafo(ng.ElementId(ng.VOL, int(number)))(whole), 1))
    every, weigh = zip(*found, strict=True)
    return np.concatenate([p.reshape(-1, 3) for p in every]), np.concatenate([w.ravel() for w in weigh])


def _mapped(rule: Any, places: Any, elements: int) -> tuple[Array, Array]:
    """Points (elements, n, 3) and weights (elements, n) of a rule in all of them."""
    points = np.asarray(ng.CF((ng.x, ng.y, ng.z))(places)).reshape(elements, -1, 3)
    # with its sign: where an element folds over at a fillet, it counts twice there and once against it
    stretch = np.asarray(ng.Det(ng.specialcf.JacobianMatrix(3))(places)).reshape(elements, -1)
    return points, np.array(rule.weights) * stretch


def _vector(vector: Array) -> Any:
    return occ.gp_Vec(*map(float, vector))


# Solids of OpenCASCADE in mm, about the origin along their own axes, for STEP files


def step_text(solid: Any) -> str:
    """A STEP file (mm) of a solid; the text is the same for the same one."""
    with tempfile.NamedTemporaryFile(suffix=".step") as file:
        solid.WriteStep(file.name)
        return OWN_WORDS.sub("''", Path(file.name).read_text(encoding="utf-8"))


def solid_of(body: Solid) -> Any:
    """A body about the origin in its own axes as a solid, lengths in mm."""
    return occ_solid(moved(body, np.zeros(3), np.eye(3)), np.zeros(3), MILLIMETRE)


def segment(inner_radius: float, radius: float, height: float, start: float, end: float) -> Any:
    """Part of a ring (`inner_radius`, `radius`, `height`) about the origin and z, from `start` to `end`, degrees."""
    inner, outer, high = (length / MILLIMETRE for length in (inner_radius, radius, height))
    section = occ.WorkPlane(occ.Axes((inner, 0.0, -high / 2), n=occ.gp_Dir(0, -1, 0), h=occ.X))
    axis = occ.Axis(occ.Pnt(0, 0, 0), occ.Z)
    return section.Rectangle(outer - inner, high).Face().Revolve(axis, end - start).Rotate(axis, start)


def shifted(solid: Any, shift: Array, rotation: Array) -> Any:
    """A `solid` turned about the origin by a `rotation` (3, 3), then moved by a `shift` (3,) m."""
    return _turned(solid, rotation).Move(_vector(shift / MILLIMETRE))


def lies_within(hole: Any, solid: Any) -> bool:
    """Whether all of a solid lies within another, and fills less than it."""
    whole, part = float(solid.mass), float(hole.mass)
    return part < whole * (1 - WITHIN) and abs(float((solid - hole).mass) + part - whole) < WITHIN * whole


def joined(solids: Sequence[Any]) -> Any | None:
    """The one solid that solids make which touch, but do not overlap; None where they make none."""
    whole = sum(solids[1:], solids[0]).UnifySameDomain()
    alike = abs(float(whole.mass) - sum(float(solid.mass) for solid in solids)) < WITHIN * float(whole.mass)
    return whole if alike and len(list(whole.solids)) == 1 else None


def faceted(triangles: Array) -> Any:
    """The solid within triangles (n, 3, 3) m in any order. Raises InputError where they do not close, or cut."""
    triangles = triangles / MILLIMETRE
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    _, numbers = np.unique(np.round(triangles.reshape(-1, 3) / (SAME * size)), axis=0, return_inverse=True)
    corners = numbers.reshape(-1, 3)
    sides = np.sort(np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    met = np.unique(sides, axis=0, return_counts=True)[1]
    if not np.all(met == 2):
        raise InputError(
            f"Input triangles must enclose one solid, two at every side; instead {int(np.sum(met != 2))} sides have "
            "another number."
        )
    faces = []
    for triangle in triangles:
        points = [occ.Pnt(*map(float, corner)) for corner in triangle]
        faces.append(occ.Face(occ.Wire([occ.Segment(points[k], points[(k + 1) % 3]) for k in range(3)])))
    shells = list(occ.Sew(faces, tolerance=SAME * size).shells)
    solid = occ.Solid(shells[0]) if len(shells) == 1 else None
    if solid is None or not abs(float(solid.mass)) > 0:
        raise InputError(f"Input triangles must enclose one solid; instead they make {len(shells)} surfaces.")
    return (solid if float(solid.mass) > 0 else solid.Reversed()).UnifySameDomain()
