"""Bodies as solids of OpenCASCADE."""

from typing import Any

import netgen.occ as occ

from ..basics import Array, Box, Ring, Solid, Sphere


def occ_solid(body: Solid, center: Array, unit: float) -> Any:
    """The body as a solid in a mesh's coordinates: lengths in `unit` (m) from `center` (3,) m."""
    x, _, z = body.rotation.T
    if isinstance(body, Sphere):
        return occ.Sphere(occ.Pnt(*map(float, (body.center - center) / unit)), body.radius / unit)
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


def _direction(vector: Array) -> Any:
    return occ.gp_Vec(*map(float, vector))
