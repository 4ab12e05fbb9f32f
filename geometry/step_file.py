"""Solids from STEP files, which OpenCASCADE reads in a process of its own; lengths there are in millimetres.

OpenCASCADE crashes on some damaged files and does not return from others.
"""

import re
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from .common import Array, InputError, counted
from .files import LostError, call_apart, file_content
from .solids import Part

MILLI = 1e-3
MOST = 50_000_000  # Bytes of a STEP file
# Seconds of processor time for a small file, which takes a fraction of one; bytes for each second more.
LONGEST, PACE = 8.0, 1e6
SMALLEST, LARGEST = 1e-3, 1e5  # Edges of the box about a solid, mm
FLAT = 1e-12  # Area of a triangle, in the largest one's, below which it has none
# What a closed surface may miss of being one, in its area; triangles in it of its volume, on thin walls.
CLOSED, NEARLY_ROUND = 1e-3, 0.1
ALONG_EDGES = 20_000  # Places on the edges of a solid at which its box is looked for
POINT = 1e-6  # Length of an edge below which it is a point, mm
# Of its size: what OpenCASCADE's box may exceed those places by; on splines it is that of their control points.
LOOSE = 1e-3
# Elements in a radius of curvature, their degree, places along their sides: together 1e-4 of the radius.
FINE, CURVED, ACROSS = 1.0, 6, 32
ENTITY = re.compile(
    r"#(\d+)\s*=\s*(SHAPE_DEFINITION_REPRESENTATION|PRODUCT_DEFINITION_SHAPE|NEXT_ASSEMBLY_USAGE_OCCURRENCE)"
    r"\s*\(((?:'[^']*'|[^';])*)\)\s*;"
)
SOLID = re.compile(r"=\s*(?:MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS|FACETED_BREP)\s*\(")
WAY_OUT = "Export one closed solid a file, and give each magnet its own."


def read_part(path: Path) -> Part:
    """The one closed solid of a STEP file, its middle at the origin. Raises InputError for a file of anything else."""
    return part_of(file_content(path, MOST, "file", "a STEP file").decode("utf-8", errors="replace"), path)


def part_of(text: str, path: Path) -> Part:
    """The solid of the text of a STEP file; `path` names it in messages. Raises InputError."""
    if not text.lstrip().startswith("ISO-10303-21"):
        found = "is empty" if not text.strip() else "does not begin with ISO-10303-21"
        raise InputError(f"Input file must be a STEP file; instead {path} {found}.")
    try:
        return Part(path, text, *_measured(text))
    except LostError as error:
        raise InputError(
            f"Input file must be a whole STEP file; instead OpenCASCADE {error}: {path}. Export it again."
        ) from None
    except InputError as error:
        raise InputError(f"Input file must hold one closed solid; instead {path} {error}. {WAY_OUT}") from None


@lru_cache(maxsize=16)
def _measured(text: str) -> tuple[Any, ...]:
    return call_apart(LONGEST + len(text) / PACE, measured, text)


def measured(text: str) -> tuple[str, Array, Array, Array, float, float, Array]:
    """Fields of a `Part` from its BREP on, of a STEP file's text. Raises InputError: not one closed solid."""
    solids, faces = _solids(text)
    named = max(len(SOLID.findall(text)), len(solids))
    if len(solids) != 1 or named > 1:
        unread = "" if len(solids) == named else f", of which OpenCASCADE reads {len(solids) or 'none'}"
        raise InputError(
            f"holds {counted(named, 'solid')}{unread}" if named else f"holds none, and {counted(faces, 'open face')}"
        )
    (solid,) = solids
    with tempfile.NamedTemporaryFile("r", suffix=".brep", encoding="utf-8") as copy:
        solid.WriteBrep(copy.name, withTriangles=False)
        brep = copy.read()
    volume, area = float(solid.mass), sum(float(face.mass) for face in solid.faces)
    centroid = np.array([solid.center.x, solid.center.y, solid.center.z])
    outer = np.array([[corner.x, corner.y, corner.z] for corner in solid.bounding_box])
    triangles = _triangles(solid)
    _refuse_open(triangles, volume)
    lower, upper = _box(solid, triangles, outer)
    if not np.all((upper - lower > SMALLEST) & (upper - lower < LARGEST)):
        size = " × ".join(f"{edge:.3g}" for edge in upper - lower)
        raise InputError(f"holds one of {size} mm, where {SMALLEST:g} to {LARGEST:g} mm are allowed")
    middle = (lower + upper) / 2
    return (
        brep, MILLI * (triangles - middle), MILLI * (upper - lower), -MILLI * middle, volume * MILLI**3,
        area * MILLI**2, MILLI * (centroid - middle),
    )  # fmt: skip


@lru_cache(maxsize=16)
def second_moments_of_part(part: Part) -> Array:
    """(3, 3) ∫ x xᵀ dV, m⁵, of a part about the centre of its volume along its own axes."""
    inertia = call_apart(LONGEST + len(part.brep) / PACE, inertia_of, part.brep)
    return np.asarray(np.trace(inertia) / 2 * np.eye(3) - inertia)


def inertia_of(brep: str) -> Array:
    """(3, 3) tensor of inertia, m⁵, of the solid of a BREP text about the centre of its volume."""
    from .meshes.solids import read_brep

    solid = read_brep(brep)
    return MILLI**5 * np.array([[solid.inertia[i, j] for j in range(3)] for i in range(3)])


def _solids(text: str) -> tuple[list[Any], int]:
    """The solids of all roots of a STEP file, and the number of faces that belong to none."""
    import netgen.occ as occ

    solids, faces, reason = [], 0, "is no STEP file"
    for root in _roots(text):
        with tempfile.NamedTemporaryFile("w", suffix=".step", encoding="utf-8") as copy:
            copy.write(root)
            copy.flush()
            try:
                shape = occ.OCCGeometry(copy.name).shape
            except Exception as error:  # of several kinds; also where a root has no body at all
                reason = f"cannot be read: {error}"
                continue
        reason = ""
        solids += list(shape.solids)
        faces += 0 if solids else len(shape.faces)
    if reason and not solids and SOLID.search(text):
        raise InputError(reason)
    return solids, faces


def _roots(text: str) -> list[str]:
    """The file once for each root, a shape that is no component, without the others: netgen reads the first alone."""
    found: dict[str, dict[str, list[str]]] = {}
    spans = {}
    for entity in ENTITY.finditer(text):
        number, name, given = entity.groups()
        found.setdefault(name, {})[number] = re.findall(r"#(\d+)", re.sub(r"'[^']*'", "", given))
        spans[number] = entity.span()
    products = {number: refs[-1] for number, refs in found.get("PRODUCT_DEFINITION_SHAPE", {}).items() if refs}
    components = {refs[1] for refs in found.get("NEXT_ASSEMBLY_USAGE_OCCURRENCE", {}).values() if len(refs) > 1}
    shapes = found.get("SHAPE_DEFINITION_REPRESENTATION", {})
    roots = [n for n, refs in shapes.items() if refs and products.get(refs[0]) not in components]
    texts = []
    for kept in roots:
        texts.append(text)
        for start, end in sorted((spans[other] for other in roots if other != kept), reverse=True):
            texts[-1] = texts[-1][:start] + texts[-1][end:]
    return texts or [text]


def _triangles(solid: Any) -> Array:
    """(n, 3, 3) mm, outwards, as OpenCASCADE draws the solid: 0.3 % of its radii off at most."""
    drawn = solid._webgui_data()["Bezier_trig_points"][:3]
    triangles = np.stack([np.reshape(corner, (-1, 4))[:, :3] for corner in drawn], axis=1)
    across = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    triangles = triangles[~(across <= FLAT * np.max(across, initial=0.0))]  # at the poles of spheres
    held = np.sum(triangles[:, 0] * np.cross(triangles[:, 1], triangles[:, 2]))
    return np.asarray(triangles if held > 0 else triangles[:, ::-1])


def _refuse_open(triangles: Array, volume: float) -> None:
    """Raises InputError where triangles do not enclose a volume: on a closed surface ∮ n dA = 0, ∮ n x dA = V I."""
    if not (np.isfinite(triangles).all() and np.isfinite(volume) and len(triangles)):
        raise InputError("holds one whose numbers are not finite")
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    places = triangles.mean(axis=1) - triangles.mean(axis=(0, 1))
    area, size = float(np.linalg.norm(normals, axis=1).sum()), float(np.abs(places).max())
    first, second = normals.sum(axis=0), normals.T @ places
    enclosed = float(np.trace(second)) / 3
    off = max(np.abs(first).max() / area, np.abs(second - enclosed * np.eye(3)).max() / (area * size))
    if not (off < CLOSED and abs(enclosed - volume) < NEARLY_ROUND * enclosed):
        raise InputError("holds one whose surface does not close")


def _box(solid: Any, triangles: Array, outer: Array) -> Array:
    """(2, 3) mm, lower and upper ends; `outer` are OpenCASCADE's."""
    edges = [edge for edge in solid.edges if edge.mass > POINT]  # the pole of a sphere is an edge without a curve
    count = max(4, ALONG_EDGES // max(1, len(edges)))
    spans = [edge.parameter_interval for edge in edges]
    places = [e.Value(t) for e, (start, end) in zip(edges, spans, strict=True) for t in np.linspace(start, end, count)]
    found = np.concatenate([triangles.reshape(-1, 3), np.array([[p.x, p.y, p.z] for p in places]).reshape(-1, 3)])
    inner = np.array([found.min(axis=0), found.max(axis=0)])
    size = float(np.linalg.norm(inner[1] - inner[0]))
    excess = np.abs(outer - inner)
    if excess.max() < LOOSE * size:
        return np.where(excess < 1e-6 * size, inner, outer)  # OpenCASCADE adds its tolerance
    found = np.concatenate([found, _sampled(solid, size)])
    return np.array([found.min(axis=0), found.max(axis=0)])


def _sampled(solid: Any, size: float) -> Array:
    import netgen.occ as occ
    import ngsolve as ng
    from netgen.meshing import MeshingStep

    sizes = {"maxh": size / 4, "curvaturesafety": FINE, "perfstepsend": MeshingStep.MESHSURFACE}
    mesh = ng.Mesh(occ.OCCGeometry(solid).GenerateMesh(**sizes, parallel_meshing=False))
    mesh.Curve(CURVED)
    grid = [(i / ACROSS, j / ACROSS) for i in range(ACROSS + 1) for j in range(ACROSS + 1 - i)]
    places = mesh.MapToAllElements(ng.IntegrationRule(grid, [1.0] * len(grid)), ng.BND)
    return np.asarray(ng.CF((ng.x, ng.y, ng.z))(places)).reshape(-1, 3)
