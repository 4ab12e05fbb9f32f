"""Rotors from magpylib's magnets, and the field of a table as a source of magpylib."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import magpylib
import numpy as np
from scipy.spatial.transform import Rotation

from ..fem.cache import cache_folder
from ..fem.files import write_whole
from ..fem.rotor.table import RotorTable
from ..geometry.common import MU_0, Array, InputError
from ..geometry.meshes.solids import Body, Facets, Segment, lies_within, step_text
from ..geometry.scene.files import pose_keys, shape_keys
from ..geometry.scene.making import magnets
from ..geometry.shapes import Box, Cylinder, Sphere
from ..geometry.solids import Part, Solid

KINDS = (
    magpylib.magnet.Cuboid,
    magpylib.magnet.Cylinder,
    magpylib.magnet.CylinderSegment,
    magpylib.magnet.Sphere,
    magpylib.magnet.Tetrahedron,
    magpylib.magnet.TriangularMesh,
)
SIZES = ("diameter", "dimension", "vertices")
MOST_TESLA = 10.0  # four times what iron saturates at; in millitesla every magnet has more
MOST_TRIANGLES = 2000
SAME, SAME_ANGLE = 1e-9, 1e-7  # relative difference of sizes, and of angles in degrees, that are one


def from_magpylib(
    collection: Any, recoil_permeability: float = 1.05, folder: str | Path | None = None
) -> dict[str, Any]:
    """The rotor that magpylib's magnets make, for `spinlev.scene(rotor=...)`.

    Parameters
    ----------
    collection : magpylib.Collection, one of its magnets, or a list of both
        Cuboids, cylinders and their segments, spheres, tetrahedra and closed triangular meshes without a path, in the
        rotor's frame: the axis of rotation is z. A magnet that lies within another and has the opposite polarisation is
        a cavity in it, as in a ring made of two cylinders.
    recoil_permeability : float
        Relative permeability of all magnets; magpylib itself has none.
    folder : str or Path, optional
        Where STEP files are written of what the keys of a scene file do not describe: segments, tetrahedra, meshes, and
        bodies with a cavity. By default the user's cache.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file, lengths in mm; the same field to 1e-12 where the permeability is 1, and
        to 1e-6 that of a STEP file.

    Raises
    ------
    InputError
        Nothing in it, a source of another kind, one without size or polarisation, or one that moves along a path;
        a mesh that is open, or in several pieces; values in millimetres and millitesla, as magpylib 4 had them.

    Examples
    --------
    >>> import magpylib
    >>> cube = magpylib.magnet.Cuboid(dimension=(0.01, 0.01, 0.01), polarization=(1.3, 0, 0), position=(0.002, 0, 0))
    >>> from_magpylib(cube)["magnets"][0]["center_mm"]
    [2.0, 0.0, 0.0]
    """
    sources = list(_sources(collection))
    if not sources:
        raise InputError("Input collection must hold at least one magnet; instead it is empty.")
    parts = Path(folder) if folder else cache_folder() / "parts"
    tables = [
        {
            # Of what has no keys, and of a body with a cavity, there is a file.
            **(_file(magnet, holes, parts) if holes or not isinstance(magnet.body, Solid) else shape_keys(magnet.body)),
            **pose_keys(magnet.body),  # type: ignore[arg-type]  # which asks for no more than a body has
            "polarization_T": (magnet.polarization + 0.0).tolist(),
            "recoil_permeability": float(recoil_permeability),
        }
        for magnet, holes in _cavities(_joined([_magnet(source) for source in sources]))
    ]
    return dict(magnets(*tables))


@dataclass(frozen=True)
class _Magnet:
    """A source: its body in the rotor's frame, and its polarisation (3,) T along the body's axes."""

    body: Body
    polarization: Array
    source: Any

    @property
    def in_rotor(self) -> Array:
        return self.body.rotation @ self.polarization


def _sources(collection: Any) -> Iterator[Any]:
    """All sources of collections and lists in each other."""
    if isinstance(collection, magpylib.Collection):
        yield from collection.sources_all
    elif isinstance(collection, list | tuple | set):
        for entry in collection:
            yield from _sources(entry)
    else:
        yield collection


def _magnet(source: Any) -> _Magnet:
    if not isinstance(source, KINDS):
        raise InputError(
            "Input collection must hold cuboids, cylinders and their segments, spheres, tetrahedra and triangular "
            f"meshes only; instead received {source!r}."
        )
    size = next((getattr(source, name) for name in SIZES if getattr(source, name, None) is not None), None)
    if size is None or source.polarization is None:
        raise InputError(f"Input collection must have magnets with a size and a polarisation; instead: {source!r}.")
    if np.ndim(source.position) != 1 or np.ndim(source.polarization) != 1:
        raise InputError(f"Input collection must hold magnets at rest; instead {source!r} has a path.")
    polarization = np.asarray(source.polarization, float)
    if np.linalg.norm(polarization) > MOST_TESLA:
        raise InputError(
            f"Input polarization must be in T, and lengths in m, as in magpylib 5; instead {source!r} has "
            f"{np.linalg.norm(polarization):.4g} T. These look like the millimetres and millitesla of magpylib 4: "
            "divide both by 1000."
        )
    pose = np.asarray(source.position, float), source.orientation.as_matrix()
    return _Magnet(_body(source, np.asarray(size, float), pose), polarization, source)


def _body(source: Any, size: Array, pose: tuple[Array, Array]) -> Body:
    if isinstance(source, magpylib.magnet.Sphere):
        return Sphere(float(size) / 2, *pose)
    if isinstance(source, magpylib.magnet.Cuboid):
        return Box(size, *pose)
    if isinstance(source, magpylib.magnet.Cylinder):
        return Cylinder(float(size[0]) / 2, float(size[1]), *pose)
    if isinstance(source, magpylib.magnet.CylinderSegment):
        inner, outer, height, start, end = map(float, size)
        return _ring(Segment(inner, outer, height, start, end, *pose))
    if isinstance(source, magpylib.magnet.Tetrahedron):
        return Facets(size[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]], *pose)
    for fault in ("open", "disconnected", "selfintersecting"):
        if getattr(source, f"status_{fault}"):
            raise InputError(f"Input mesh must be one closed surface; instead {source!r} is {fault}.")
    if len(source.mesh) > MOST_TRIANGLES:
        raise InputError(
            f"Input mesh must have at most {MOST_TRIANGLES} triangles; instead {source!r} has {len(source.mesh)}. "
            "Simplify it, as PyVista's decimate does."
        )
    return Facets(np.asarray(source.mesh, float), *pose)


def _ring(segment: Segment) -> Body:
    """The segment, or where it goes all around the ring or cylinder that it is."""
    pose = segment.center, segment.rotation
    if abs(segment.end - segment.start - 360) > SAME_ANGLE:
        return segment
    return Cylinder(segment.radius, segment.height, *pose, inner_radius=segment.inner_radius)


def _joined(found: Sequence[_Magnet]) -> list[_Magnet]:
    """Magnets, of which segments that together go all around, with one polarisation, are one ring."""
    left, joined = list(found), list[_Magnet]()
    while left:
        first = left.pop(0)
        if isinstance(first.body, Segment):
            others = [other for other in left if _same_ring(first, other)]
            turns = sorted(_angles(first.body, one.body) for one in (first, *others))  # type: ignore[arg-type]
            ends, begins = np.array([end for _, end in turns]), np.roll([start for start, _ in turns], -1)
            gaps = (ends - begins + 180) % 360 - 180
            whole = abs(sum(end - start for start, end in turns) - 360) < SAME_ANGLE
            if others and whole and np.abs(gaps).max() < SAME_ANGLE:
                first = replace(first, body=_ring(replace(first.body, start=0.0, end=360.0)))
                left = [other for other in left if not any(other is one for one in others)]
        joined.append(first)
    return joined


def _same_ring(one: _Magnet, other: _Magnet) -> bool:
    a, b = one.body, other.body
    if not (isinstance(a, Segment) and isinstance(b, Segment)):
        return False
    sizes, others = ((s.inner_radius, s.radius, s.height) for s in (a, b))
    return (
        bool(np.allclose(sizes, others, rtol=SAME, atol=0.0))
        and float(np.linalg.norm(a.center - b.center)) < SAME * a.radius
        and float(a.rotation[:, 2] @ b.rotation[:, 2]) > 1 - SAME
        and _alike(one.in_rotor, other.in_rotor)
    )


def _angles(frame: Segment, segment: Segment) -> tuple[float, float]:
    """Where a segment of the same axis begins and ends about that of a frame, degrees; it begins within a turn."""
    turn = frame.rotation.T @ segment.rotation
    start = segment.start + float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0])))
    start = round(start % 360, 9) % 360
    return start, start + segment.end - segment.start


def _alike(one: Array, other: Array) -> bool:
    return float(np.linalg.norm(one - other)) <= SAME * float(np.linalg.norm(one))


def _cavities(found: Sequence[_Magnet]) -> list[tuple[_Magnet, list[Body]]]:
    """Every magnet that is none with the cavities that opposite ones within it make.

    A cylinder in one of its height about the same axis makes it a ring, which has a closed form.
    """
    holes: dict[int, list[Body]] = {}
    used: set[int] = set()
    for k, inner in enumerate(found):
        for j, outer in enumerate(found):
            near = float(np.linalg.norm(inner.body.center - outer.body.center)) < outer.body.circumradius
            opposite = inner.in_rotor.any() and _alike(outer.in_rotor, -inner.in_rotor)
            if j != k and j not in used and near and opposite and lies_within(inner.body, outer.body):
                holes.setdefault(j, []).append(inner.body)
                used.add(k)
                break
    result = list[tuple[_Magnet, list[Body]]]()
    for k, magnet in enumerate(found):
        if k in used:
            continue
        bodies = holes.get(k, [])
        ring = _bored(magnet.body, bodies[0]) if len(bodies) == 1 else None
        result.append((replace(magnet, body=ring), []) if ring is not None else (magnet, bodies))
    return result


def _bored(outer: Body, inner: Body) -> Cylinder | None:
    """The ring that a cylinder within another leaves, where both have the same axis and height."""
    if not (isinstance(outer, Cylinder) and isinstance(inner, Cylinder)) or outer.inner_radius or inner.inner_radius:
        return None
    apart = float(np.linalg.norm(outer.center - inner.center))
    along = abs(float(outer.rotation[:, 2] @ inner.rotation[:, 2]))
    if apart > SAME * outer.radius or along < 1 - SAME or abs(outer.height - inner.height) > SAME * outer.height:
        return None
    return replace(outer, inner_radius=inner.radius)


def _file(magnet: _Magnet, cavities: Sequence[Body], folder: Path) -> dict[str, Any]:
    """The file of a magnet, written if it is not there; its name tells its content."""
    try:
        content = step_text(magnet.body, cavities).encode()
    except InputError as error:
        raise InputError(f"{magnet.source!r}: {error}") from None
    path = (folder / f"{hashlib.sha256(content).hexdigest()[:20]}.step").absolute()
    try:
        if not path.exists() or path.read_bytes() != content:
            write_whole(path, content)
    except OSError as error:
        raise InputError(f"Input folder must be one that files can be written to; instead: {error}.") from None
    return {"file": str(path)}


def to_magpylib(table: RotorTable) -> Any:
    """The field of a rotor's table as a collection of magpylib, for its `getB`, its sensors and its figures.

    Parameters
    ----------
    table : RotorTable
        From `spinlev.rotor_table`. Closed forms become magnets; expansions (finite elements, dipoles) a custom source,
        which gives NaN where the table does not reach.

    Returns
    -------
    magpylib.Collection
        In the rotor's frame, SI units; the table's field to 1e-12.
    """
    sources: list[Any] = []
    for magnet in table.uniform:
        turn = Rotation.from_matrix(magnet.body.rotation)
        pose = {"position": magnet.body.center, "orientation": turn, "polarization": magnet.polarization}
        sources.append(_source(magnet.body, pose))
    if not table.expansions:
        return magpylib.Collection(*sources)
    rest = RotorTable(table.model, table.magnets, (), table.expansions)

    def field(field: str, observers: Array) -> Array | None:
        if field not in ("B", "H"):  # magpylib may also ask for J and M
            return None
        points = np.asarray(observers, float).reshape(-1, 3)
        found, known = np.full(points.shape, np.nan), rest.in_range(points)
        found[known] = rest.evaluate(points[known])[0]
        return found if field == "B" else found / MU_0

    return magpylib.Collection(*sources, magpylib.misc.CustomSource(field_func=field))


def _source(body: Solid, pose: dict[str, Any]) -> Any:
    if isinstance(body, Part):
        raise InputError("Input table must have no part from a file among its closed forms; instead it has one.")
    if isinstance(body, Sphere):
        return magpylib.magnet.Sphere(diameter=2 * body.radius, **pose)
    if isinstance(body, Cylinder):
        if body.inner_radius:
            ring = (body.inner_radius, body.radius, body.height, 0, 360)
            return magpylib.magnet.CylinderSegment(dimension=ring, **pose)
        return magpylib.magnet.Cylinder(dimension=(2 * body.radius, body.height), **pose)
    return magpylib.magnet.Cuboid(dimension=body.size, **pose)
