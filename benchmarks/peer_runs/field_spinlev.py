"""spinlev: the rotor's table to a relative accuracy, from nothing, then the field at the points.

By finite elements, or by charges on surfaces ("surface"). Or by so many nodes of such charges along an edge alone
("charges"), which as the peers do not say how wrong they are; with 0 the magnets are uniform, each by itself. The
tilted cube may also be computed as one that lies straight, and turned: a reference without a tilted mesh."""

import sys
from functools import partial
from importlib.metadata import version

import numpy as np
from problems import CUBES, EDGE, RECOIL, REMANENCE, matrices, points_below
from said import measure, say

from spinlev.fem.closed_forms.moments import carriers_of
from spinlev.fem.closed_forms.uniform import remanent_field
from spinlev.fem.elements.surface_charges import SurfaceCharges
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry import Box, Magnet
from spinlev.geometry.shapes import Cylinder

case, resolution = sys.argv[1], float(sys.argv[2])
points = points_below()
bodies, way = matrices(case), np.eye(3)
if "turned" in sys.argv:
    bodies, way = np.eye(3)[None], bodies[0]
body = partial(Cylinder, EDGE / 2, EDGE) if case == "cylinder" else partial(Box, (EDGE,) * 3)
rotor = tuple(
    Magnet(body(np.array(center), turn), REMANENCE * np.array(axis), RECOIL)
    for (center, axis), turn in zip(CUBES[case], bodies, strict=True)
)


def field():
    """B at the points."""
    if "charges" in sys.argv:
        uniform = carriers_of(rotor)
        field = remanent_field(uniform, points)
        if not resolution:
            return field
        charges = SurfaceCharges(rotor, int(resolution))
        return field + charges.field(charges.beyond(uniform), points)
    table = rotor_table(rotor, "surface" if "surface" in sys.argv else "fem", resolution, nearest=0.007)
    return table.evaluate(points @ way)[0] @ way.T


values, seconds = measure(field)
say(values, seconds, 0, {"spinlev": version("spinlev")})
