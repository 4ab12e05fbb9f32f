"""Rotors from magpylib's magnets, and the field of a table as a source of magpylib."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import magpylib
import numpy as np
from magpylib import magnet as kinds
from scipy.spatial.transform import Rotation

from ..fem.cache import cache_folder
from ..fem.rotor.table import RotorTable
from ..geometry.common import MU_0, Array, InputError
from ..geometry.files import write_whole
from ..geometry.meshes.solids import faceted, joined, lies_within, segment, shifted, solid_of, step_text
from ..geometry.scene.files import body_keys
from ..geometry.scene.making import magnets
from ..geometry.shapes import Box, Cylinder, Sphere
from ..geometry.solids import Part, Solid, known_shape
from ..geometry.step_file import part_of
from .cli.options import refused, wrong

KINDS = (kinds.Cuboid, kinds.Cylinder, kinds.CylinderSegment, kinds.Sphere, kinds.Tetrahedron, kinds.TriangularMesh)
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
        The table `[rotor]` of a scene file, lengths in mm; the same field to 1e-12 where the permeability is 1, to
        1e-9 of what is joined or bored, and to 1e-6 that of a STEP file.

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
    if not (sources := list(_sources(collection))):
        raise InputError("Input collection must hold at least one magnet; instead it is empty.")
    parts = Path(folder) if folder else cache_folder() / "parts"
    found = _bored(_joined([_magnet(source) for source in sources]))
    return dict(magnets(*(_table(magnet, float(recoil_permeability), parts) for magnet in found)))


@dataclass(frozen=True)
class _Magnet:
    """A source: its solid in mm and polarisation (3,) T along the body's axes; its body if a scene file has keys."""

    source: Any
    solid: Any
    center: Array
    rotation: Array
    polarization: Array
    body: Solid | None = None

    @property
    def in_rotor(self) -> Array:
        return self.rotation @ self.polarization

    def seen_from(self, frame: "_Magnet") -> Any:
        back = frame.rotation.T
        return shifted(self.solid, back @ (self.center - frame.center), back @ self.rotation)


def _table(magnet: _Magnet, recoil_permeability: float, folder: Path) -> dict[str, Any]:
    """Among `magnets` of a scene; of what has no keys the file is written if it is not there, named by its content."""
    body, polarization = magnet.body, magnet.polarization
    if body is None:
        text = step_text(magnet.solid)
        content = text.encode()
        path = (folder / f"{hashlib.sha256(content).hexdigest()[:20]}.step").absolute()
        part = part_of(text, path)
        part = replace(part, center=magnet.center - magnet.rotation @ part.origin, rotation=magnet.rotation)
        body = known_shape(part) or part
        polarization = np.round(body.rotation.T @ magnet.in_rotor, 15)
        try:
            if body is part and (not path.exists() or path.read_bytes() != content):
                write_whole(path, content)
        except OSError as error:
            raise InputError(f"Input folder must be one that files can be written to; instead: {error}.") from None
    return {
        **body_keys(body),
        "polarization_T": (polarization + 0.0).tolist(),
        "recoil_permeability": recoil_permeability,
    }


def _sources(collection: Any) -> Iterator[Any]:
    if isinstance(collection, magpylib.Collection):
        yield from collection.sources_all
    elif isinstance(collection, list | tuple | set):
        for entry in collection:
            yield from _sources(entry)
    else:
        yield collection


def _magnet(source: Any) -> _Magnet:
    if not isinstance(source, KINDS):
        known = "cuboids, cylinders and their segments, spheres, tetrahedra and triangular meshes"
        raise refused("collection", f"hold {known} only", source)
    size = next((getattr(source, name) for name in SIZES if getattr(source, name, None) is not None), None)
    if size is None or source.polarization is None:
        raise InputError(f"Input collection must have magnets with a size and a polarisation; instead: {source!r}.")
    if np.ndim(source.position) != 1 or np.ndim(source.polarization) != 1:
        raise InputError(f"Input collection must hold magnets at rest; instead {source!r} has a path.")
    polarization = np.asarray(source.polarization, float)
    if np.linalg.norm(polarization) > MOST_TESLA:
        way_out = "These look like the millimetres and millitesla of magpylib 4: divide both by 1000."
        instead = f"{source!r} has {np.linalg.norm(polarization):.4g} T. {way_out}"
        raise wrong("polarization", "be in T, and lengths in m, as in magpylib 5", instead)
    pose = np.asarray(source.position, float), source.orientation.as_matrix()
    body = _body(source, np.asarray(size, float), pose)
    solid, keyed = (solid_of(body), body) if isinstance(body, Solid) else (body, None)
    return _Magnet(source, solid, *pose, polarization, keyed)


def _body(source: Any, size: Array, pose: tuple[Array, Array]) -> Any:
    if isinstance(source, kinds.Sphere):
        return Sphere(float(size) / 2, *pose)
    if isinstance(source, kinds.Cuboid):
        return Box(size, *pose)
    if isinstance(source, kinds.Cylinder):
        return Cylinder(float(size[0]) / 2, float(size[1]), *pose)
    if isinstance(source, kinds.CylinderSegment):
        inner, outer, height, start, end = map(float, size)
        whole = abs(end - start - 360) < SAME_ANGLE
        return Cylinder(outer, height, *pose, inner) if whole else segment(inner, outer, height, start, end)
    if isinstance(source, kinds.Tetrahedron):
        return faceted(size[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]])
    for fault in ("open", "disconnected", "selfintersecting"):
        if getattr(source, f"status_{fault}"):
            raise InputError(f"Input mesh must be one closed surface; instead {source!r} is {fault}.")
    if len(source.mesh) > MOST_TRIANGLES:
        instead = f"{source!r} has {len(source.mesh)}. Simplify it, as PyVista's decimate does."
        raise wrong("mesh", f"have at most {MOST_TRIANGLES} triangles", instead)
    try:
        return faceted(np.asarray(source.mesh, float))
    except InputError as error:
        raise InputError(f"{source!r}: {error}") from None


def _alike(one: Array, other: Array) -> bool:
    return float(np.linalg.norm(one - other)) <= SAME * float(np.linalg.norm(one))


def _joined(found: Sequence[_Magnet]) -> list[_Magnet]:
    """Magnets, of which segments about one axis that touch and have one polarisation are one."""
    left, whole = list(found), list[_Magnet]()
    while left:
        first = left.pop(0)
        others = [
            other
            for other in left
            if all(isinstance(m.source, kinds.CylinderSegment) and not m.body for m in (first, other))
            and float(np.linalg.norm(first.center - other.center)) < SAME * float(first.source.dimension[1])
            and float(first.rotation[:, 2] @ other.rotation[:, 2]) > 1 - SAME
            and _alike(first.in_rotor, other.in_rotor)
        ]
        if others and (solid := joined([first.solid, *(other.seen_from(first) for other in others)])):
            first = replace(first, solid=solid)
            left = [other for other in left if not any(other is one for one in others)]
        whole.append(first)
    return whole


def _bored(found: Sequence[_Magnet]) -> list[_Magnet]:
    """Every magnet that is no cavity, without the cavities that opposite ones within it make."""
    whole = list(found)
    cavities = set[int]()
    for k, inner in enumerate(found):
        for j, outer in enumerate(found):
            ends = np.array([list(corner) for corner in outer.solid.bounding_box])
            near = 1e3 * float(np.linalg.norm(inner.center - outer.center)) < float(np.linalg.norm(ends, axis=1).max())
            opposite = inner.in_rotor.any() and _alike(outer.in_rotor, -inner.in_rotor)
            if j != k and j not in cavities and near and opposite and lies_within(inner.seen_from(outer), outer.solid):
                whole[j] = replace(whole[j], solid=whole[j].solid - inner.seen_from(outer), body=None)
                cavities.add(k)
                break
    return [magnet for k, magnet in enumerate(whole) if k not in cavities]


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
        return kinds.Sphere(diameter=2 * body.radius, **pose)
    if isinstance(body, Cylinder) and body.inner_radius:
        return kinds.CylinderSegment(dimension=(body.inner_radius, body.radius, body.height, 0, 360), **pose)
    if isinstance(body, Cylinder):
        return kinds.Cylinder(dimension=(2 * body.radius, body.height), **pose)
    return kinds.Cuboid(dimension=body.size, **pose)
