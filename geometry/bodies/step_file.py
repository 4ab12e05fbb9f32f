"""Solids from STEP files, which OpenCASCADE reads; lengths there are in millimetres."""

import tempfile
from pathlib import Path

import numpy as np

from ..basics import Array, InputError, Part, file_content

MILLI = 1e-3
MOST = 100_000_000
"""Bytes of a STEP file."""
FINE = 3.0
"""Triangles in a radius of curvature of the surface by which distances are told."""


def read_part(path: Path) -> Part:
    """The one closed solid of a STEP file, its middle at the origin.

    Raises
    ------
    InputError : no such file, not a STEP file, or anything in it but one closed solid
    """
    content = file_content(path, MOST, "file", "a STEP file")
    return part_of(content.decode("utf-8", errors="replace"), path)


def part_of(text: str, path: Path) -> Part:
    """The solid of the text of a STEP file; `path` names it in messages. Raises InputError."""
    if not text.lstrip().startswith("ISO-10303-21"):
        found = "is empty" if not text.strip() else "does not begin with ISO-10303-21"
        raise InputError(f"Input file must be a STEP file; instead {path} {found}.")
    import netgen.occ as occ  # slow to load, and only for scenes with such a part
    import ngsolve as ng
    from netgen.meshing import NgException

    with tempfile.NamedTemporaryFile("w", suffix=".step", encoding="utf-8") as copy:
        copy.write(text)
        copy.flush()
        try:
            shape = occ.OCCGeometry(copy.name).shape
        except NgException as error:
            raise InputError(f"Input file must be a STEP file; instead {path} cannot be read: {error}.") from None
    solids = list(shape.solids)
    if len(solids) != 1 or not solids[0].mass > 0:
        found = f"{len(solids)} solids" if solids else f"none, and {len(shape.faces)} open faces"
        raise InputError(f"Input file must hold one closed solid; instead {path} holds {found}.")
    lower, upper = (np.array([corner.x, corner.y, corner.z]) for corner in solids[0].bounding_box)
    size = float(np.linalg.norm(upper - lower))
    geometry = occ.OCCGeometry(solids[0])
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=size / 4, curvaturesafety=FINE, parallel_meshing=False))
    places = np.array([vertex.point for vertex in mesh.vertices]) * MILLI
    faces = [[places[vertex.nr] for vertex in element.vertices] for element in mesh.Elements(ng.BND)]
    middle = (lower + upper) / 2 * MILLI
    triangles = _outwards(np.array(faces) - middle)
    centroid = np.array([solids[0].center.x, solids[0].center.y, solids[0].center.z]) * MILLI - middle
    volume = float(solids[0].mass) * MILLI**3
    area = sum(float(face.mass) for face in solids[0].faces) * MILLI**2
    return Part(path, text, triangles, (upper - lower) * MILLI, -middle, volume, area, centroid)


def _outwards(triangles: Array) -> Array:
    """Triangles with their normals outwards: together they hold a positive volume."""
    held = np.sum(triangles[:, 0] * np.cross(triangles[:, 1], triangles[:, 2]))
    return triangles if held > 0 else triangles[:, ::-1]
