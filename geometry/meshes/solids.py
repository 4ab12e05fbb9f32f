"""Bodies as solids of OpenCASCADE."""

import tempfile
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import scipy

from ..basics import Array, Box, Part, Ring, Solid, Sphere

MILLIMETRE = 1e-3
CURVED, ROUND = 7, 3.0
"""Degree of the elements at round surfaces, and how many of them in a radius of curvature."""


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


def _part(body: Part, center: Array, unit: float) -> Any:
    with tempfile.NamedTemporaryFile("w", suffix=".step", encoding="utf-8") as copy:
        copy.write(body.step)
        copy.flush()
        (solid,) = occ.OCCGeometry(copy.name).shape.solids
    solid = solid.Move(_direction(body.origin / MILLIMETRE))
    turn = scipy.spatial.transform.Rotation.from_matrix(body.rotation).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(turn))
    if angle > 0:
        axis = occ.Axis(occ.Pnt(0, 0, 0), occ.gp_Dir(*map(float, turn / angle)))
        solid = solid.Rotate(axis, angle)
    return solid.Scale(occ.Pnt(0, 0, 0), MILLIMETRE / unit).Move(_direction((body.center - center) / unit))


def part_edges(body: Part, center: Array, unit: float) -> list[Any]:
    """The edges between two faces of a part, in a mesh's coordinates; the seam of a mantle is none."""
    solid = occ_solid(body, center, unit)
    owners = [list(face.edges) for face in solid.faces]
    return [edge for edge in solid.edges if sum(any(edge == own for own in face) for face in owners) > 1]


def part_rule(body: Part, order: int) -> tuple[Array, Array]:
    """Points (n, 3) m in a part and weights (n,) m³, on curved tetrahedra, for polynomials up to about `order`."""
    unit = body.volume ** (1 / 3)
    geometry = occ.OCCGeometry(_part(body, body.center, unit))
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=0.6, curvaturesafety=ROUND, parallel_meshing=False))
    mesh.Curve(CURVED)
    rule = ng.IntegrationRule(ng.TET, order)
    places = mesh.MapToAllElements(rule, ng.VOL)
    points = np.asarray(ng.CF((ng.x, ng.y, ng.z))(places)).reshape(-1, 3)
    stretch = np.abs(np.asarray(ng.Det(ng.specialcf.JacobianMatrix(3))(places))).ravel()
    return body.center + points * unit, np.tile(rule.weights, mesh.ne) * stretch * unit**3


def _direction(vector: Array) -> Any:
    return occ.gp_Vec(*map(float, vector))
