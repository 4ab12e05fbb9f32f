"""Bodies as solids of OpenCASCADE."""

import contextlib
import tempfile
from functools import lru_cache
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import scipy

from ..basics import (
    Array,
    Box,
    ComputationError,
    CrashError,
    LostError,
    MeshError,
    Part,
    Ring,
    Solid,
    Sphere,
    call_apart,
)

MILLIMETRE = 1e-3
CURVED, ROUND = 6, 2.0
"""Degree of the elements at round surfaces, and how many of them in a radius of curvature."""
SMALLEST = 0.06
"""Least element that a radius of curvature asks for, in cube roots of a part's volume: one spans a small fillet."""
OTHERWISE = (1.0, 0.5, 0.0)
"""Of that, where the mesher fails: its luck with the same part is another with elements of other sizes."""
FEW, SMALL = 8, 1.5
"""Degree of the rule in small elements, and their edge times the degree of the polynomial, by the part's, at most."""
LONGEST = 60.0
"""Seconds of processor time for a mesh of a part."""
SIMPLER = "Leave out small features of the part, or export it again."


def occ_solid(body: Solid, center: Array, unit: float) -> Any:
    """The body as a solid in a mesh's coordinates: lengths in `unit` (m) from `center` (3,) m."""
    x, _, z = body.rotation.T
    if isinstance(body, Sphere):
        return occ.Sphere(occ.Pnt(*map(float, (body.center - center) / unit)), body.radius / unit)
    if isinstance(body, Part):
        return _part(body, center, unit)
    foot = (body.center - center - body.half_edges[2] * z) / unit
    if isinstance(body, Box):
        half = body.half_edges / unit
        corner = foot - body.rotation[:, :2] @ half[:2]
        axes = occ.Axes(tuple(map(float, corner)), n=_direction(z), h=_direction(x))
        return occ.WorkPlane(axes).Rectangle(2 * half[0], 2 * half[1]).Face().Extrude(float(2 * half[2]))
    axes = occ.Axes(tuple(map(float, foot)), n=_direction(z), h=_direction(x))
    filled = occ.Cylinder(axes, body.radius / unit, body.height / unit)
    if isinstance(body, Ring):
        return filled - occ.Cylinder(axes, body.inner_radius / unit, body.height / unit)
    return filled


def read_brep(brep: str) -> Any:
    """The solid of a BREP text."""
    with tempfile.NamedTemporaryFile("w", suffix=".brep", encoding="utf-8") as copy:
        copy.write(brep)
        copy.flush()
        (solid,) = occ.OCCGeometry(copy.name).shape.solids
    return solid


def _part(body: Part, center: Array, unit: float) -> Any:
    solid = read_brep(body.brep)
    solid = solid.Move(_direction(body.origin / MILLIMETRE))
    turn = scipy.spatial.transform.Rotation.from_matrix(body.rotation).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(turn))
    if angle > 0:
        axis = occ.Axis(occ.Pnt(0, 0, 0), occ.gp_Dir(*map(float, turn / angle)))
        solid = solid.Rotate(axis, angle)
    return solid.Scale(occ.Pnt(0, 0, 0), MILLIMETRE / unit).Move(_direction((body.center - center) / unit))


def part_rule(body: Part, order: int) -> tuple[Array, Array]:
    """Points (n, 3) m in a part and weights (n,) m³, on curved tetrahedra, for polynomials up to about `order`.

    Raises
    ------
    MeshError : the part cannot be meshed
    ComputationError : the mesher takes too long, or too much memory
    """
    try:
        points, weights = _rule(body.brep, order)
    except LostError as error:
        raise unmeshed(error, body.file.name) from None
    local = points * MILLIMETRE + body.origin
    return body.center + local @ body.rotation.T, weights * MILLIMETRE**3


@lru_cache(maxsize=8)
def _rule(brep: str, order: int) -> tuple[Array, Array]:
    *first, last = OTHERWISE
    for share in first:
        with contextlib.suppress(CrashError, MeshError):
            return call_apart(LONGEST, rule_in_solid, brep, order, share * SMALLEST)
    return call_apart(LONGEST, rule_in_solid, brep, order, last * SMALLEST)


def unmeshed(error: LostError, name: str) -> ComputationError:
    """What is told of files whose mesh another process did not make; a MeshError where another mesh may do."""
    kind = MeshError if isinstance(error, CrashError) else ComputationError
    return kind(f"The mesher {error}: {name}. {SIMPLER}")


def rule_in_solid(brep: str, order: int, smallest: float = SMALLEST) -> tuple[Array, Array]:
    """Points (n, 3) mm in the solid of a BREP text and weights (n,) mm³; small elements have few. Raises MeshError."""
    solid = read_brep(brep)
    unit = float(solid.mass) ** (1 / 3)
    sizes = {"maxh": 0.6 * unit, "minh": smallest * unit, "curvaturesafety": ROUND, "grading": 0.6}
    try:
        mesh = ng.Mesh(occ.OCCGeometry(solid).GenerateMesh(**sizes, parallel_meshing=False))
    except Exception as error:  # netgen raises several kinds
        raise MeshError(f"The part cannot be meshed: {error}. {SIMPLER}") from None
    mesh.Curve(CURVED)
    few, all_of_it = ng.IntegrationRule(ng.TET, FEW), ng.IntegrationRule(ng.TET, max(order, FEW))
    corners = np.array([vertex.point for vertex in mesh.vertices])
    extent = float(np.ptp(corners, axis=0).max())
    tets = np.array([[vertex.nr for vertex in element.vertices] for element in mesh.Elements(ng.VOL)])
    large = np.ptp(corners[tets], axis=1).max(axis=1) * order > SMALL * extent
    points, weights = _mapped(few, mesh.MapToAllElements(few, ng.VOL), len(tets))
    found = [(points[~large].reshape(-1, 3), weights[~large].ravel())]
    for number in np.flatnonzero(large):
        places = mesh.GetTrafo(ng.ElementId(ng.VOL, int(number)))(all_of_it)
        points, weights = _mapped(all_of_it, places, 1)
        found.append((points[0], weights[0]))
    points, weights = (np.concatenate(column) for column in zip(*found, strict=True))
    return points, weights


def _mapped(rule: Any, places: Any, elements: int) -> tuple[Array, Array]:
    """Points (elements, n, 3) and weights (elements, n) of a rule in all of them."""
    points = np.asarray(ng.CF((ng.x, ng.y, ng.z))(places)).reshape(elements, -1, 3)
    # with its sign: where an element folds over at a fillet, it counts twice there and once against it
    stretch = np.asarray(ng.Det(ng.specialcf.JacobianMatrix(3))(places)).reshape(elements, -1)
    return points, np.array(rule.weights) * stretch


def _direction(vector: Array) -> Any:
    return occ.gp_Vec(*map(float, vector))
