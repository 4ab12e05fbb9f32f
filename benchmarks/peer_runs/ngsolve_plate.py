"""The plate in a block of air for NGSolve, and the source over it; the mesh is in millimetres."""

import netgen.occ
import ngsolve as ng
import numpy as np
from problems import MU_0, PLATE_SIZE

MILLI = 1e-3


def plate_in_air(size):
    """Tetrahedra of `size` (mm) in the plate, coarser outwards to faces named `far`."""
    half = tuple(500 * s for s in PLATE_SIZE)
    plate = netgen.occ.Box(tuple(-h for h in half), half).mat("plate")
    plate.maxh = size
    air = netgen.occ.Box((-300, -300, -300), (300, 300, 300)).mat("air")
    air.faces.name = "far"
    whole = netgen.occ.Glue([plate, air - plate])
    return ng.Mesh(netgen.occ.OCCGeometry(whole).GenerateMesh(maxh=100, grading=0.4))


def edge_elements(mesh, order, **more):
    """Their space, without gradients in the air."""
    inside = [material == "plate" for material in mesh.GetMaterials()]
    return ng.HCurl(mesh, order=order, dirichlet="far", gradientdomains=inside, **more)


def dipole(place, moment):
    """Vector potential of a dipole, T m."""
    apart = ng.CF((ng.x, ng.y, ng.z)) * MILLI - place
    return MU_0 / (4 * np.pi) * ng.Cross(moment, apart) / (apart * apart) ** 1.5
