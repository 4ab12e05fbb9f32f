"""From the keys of a scene file to the scene in SI units."""

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..common import Array, InputError, shown
from ..files import regular_file
from ..magnets import Magnet
from ..rotor import Conductor, horizontal as horizontal_rotor, tilt as tilted_rotor, vertical as vertical_rotor
from ..shapes import Box, Cylinder, rotation_matrix
from ..solids import Part, Solid, known_shape
from ..step_file import read_part
from .contents import AbsoluteStart, Drag, Floater, Lowering, MapReading, OffsetStart, Plate, Scene
from .messages import SceneError, describe_fault, overlap_faults
from .schema import (
    MILLI,
    DragSection,
    ExplicitRotor,
    FloaterSection,
    HorizontalRotor,
    MagnetSection,
    PlateSection,
    Rotor,
    SceneSection,
    StartSection,
    TiltRotor,
    VerticalRotor,
    key_faults,
    placed,
    solid,
)

FILES = ("file", "field_map")
"""Keys that name one."""
LARGEST = 2**30
"""Bytes of a file that a scene may name."""
MOST_BODIES = 64
"""Magnets and conductors of a scene beside a known one, unless that has more."""


def assemble(keys: Mapping[str, Any], source: str, folder: Path | None = None, known: Scene | None = None) -> Scene:
    """The scene of a scene file's keys.

    Parameters
    ----------
    keys : as TOML has them
    source : names it in messages
    folder : where the files lie that it names; left out, where `source` does
    known : for keys of which nothing is known, a scene whose files alone they may name, as it has them: no path is
        opened, and there are at most `MOST_BODIES` or as many as it has. Left out: any file, which is read.

    Raises
    ------
    SceneError : unknown, missing or wrong keys, bodies that overlap, or a file that is not known
    """
    try:
        table = SceneSection.model_validate(keys)
    except ValidationError as error:
        raise SceneError(source, [describe_fault(detail) for detail in error.errors()]) from None
    faults = key_faults(table) + (_too_many(table.rotor, known) if known else [])
    if faults:
        raise SceneError(source, faults)
    try:
        folder = Path(source).parent if folder is None else folder
        scene = _scene(table, folder, known)
        if known is None:
            files = tuple((str(folder / name), content_digest(folder / name)) for name in _named_files(keys))
        else:
            folder, files = known.folder, known.files
        scene = replace(scene, folder=folder, files=files)
    except InputError as error:  # a file
        raise SceneError(source, [str(error)]) from None
    faults = overlap_faults(scene)
    if faults:
        raise SceneError(source, faults)
    return scene


def content_digest(path: Path) -> str:
    """SHA-256 of a file's content; empty where there is no file, or one so large that no reader takes it."""
    try:
        with regular_file(path, LARGEST, "file", "a file") as stream:
            found = os.fstat(stream.fileno())
        return _digest(path, (found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns))
    except (InputError, OSError):
        return ""


@lru_cache(16)
def _digest(path: Path, state: tuple[int, ...]) -> str:
    """Once while the file is in a state: a map can have a hundred megabytes, and every point of a sweep asks."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _named_files(keys: Any) -> Iterator[str]:
    """Names of files in keys, at any depth."""
    if isinstance(keys, Mapping):
        yield from (keys[key] for key in FILES if isinstance(keys.get(key), str))
    for entry in keys.values() if isinstance(keys, Mapping) else keys if isinstance(keys, list) else ():
        yield from _named_files(entry)


def _scene(table: SceneSection, folder: Path, known: Scene | None) -> Scene:
    drag, floater = table.drag or DragSection(model="stokes"), _floater(table.floater)
    parts = _parts(table.rotor, folder, known)
    rotor = _rotor(table.rotor, parts)
    return Scene(
        frequency=table.frequency_hz,
        gravity=np.array(table.gravity_m_s2),
        rotor=rotor,
        floater=floater,
        plate=_plate(table.plate) if table.plate else None,
        drag=_drag(drag, floater),
        start=_start(table.start),
        field_map=_field_map(table.rotor, folder, known),
        map_reading=MapReading(table.rotor.map_length_unit, table.rotor.map_field_unit, table.rotor.map_columns),
        conductors=tuple(
            Conductor(solid(c, c.center_mm, c.rotation_deg), c.conductivity_S_m) for c in table.rotor.conductors
        ),
        remarks=_recognised(table.rotor, rotor),
        parts=tuple(parts.values()),
    )


def _too_many(rotor: Rotor, known: Scene) -> list[str]:
    """What is wrong with a number of bodies whose overlaps would take minutes."""
    number = len(rotor.conductors) + (len(rotor.magnets) if isinstance(rotor, ExplicitRotor) else 0)
    most = max(MOST_BODIES, len(known.turning_bodies))
    if number <= most:
        return []
    said = f"Input rotor must have at most {most} magnets and conductors here; instead received {number}."
    return [f"{said} Give the scene to the command line."]


def _parts(rotor: Rotor, folder: Path, known: Scene | None) -> dict[str, Part]:
    """The solids of the files that a rotor names, by these names."""
    if not isinstance(rotor, ExplicitRotor):
        return {}
    names = {magnet.file: f"rotor.magnets[{k}].file" for k, magnet in enumerate(rotor.magnets) if magnet.file}
    if known is None:
        return {name: read_part(folder / name) for name in names}
    files = {part.file: part for part in known.parts}
    return {name: files[_known_file(name, key, files, folder)] for name, key in names.items()}


def _field_map(rotor: Rotor, folder: Path, known: Scene | None) -> Path | None:
    if rotor.field_map is None or known is None:
        return folder / rotor.field_map if rotor.field_map else None
    return _known_file(rotor.field_map, "rotor.field_map", [known.field_map] if known.field_map else [], folder)


def _known_file(name: str, key: str, files: Iterable[Path], folder: Path) -> Path:
    """The one of the files that a name means: beside the scene, or by the end of its path. No disk is asked."""
    ends = (file for file in files if file.parts[-len(Path(name).parts) :] == Path(name).parts)
    for file in (*(file for file in files if file == folder / name), *ends):
        return file
    raise InputError(
        f"Input {key} must be a file of the scene that was opened first; instead received {shown(name)}. Give the "
        "scene to the command line."
    )


def _floater(table: FloaterSection) -> Floater:
    material = (table.remanence_T, table.recoil_permeability, table.density_kg_m3, table.conductivity_S_m)
    body = solid(table)
    return Floater(body.circumradius, *material, body if isinstance(body, Box | Cylinder) else None)


def _box(size_mm: list[float], center_mm: list[float], rotation_deg: list[float]) -> Box:
    return Box(_metres(size_mm), _metres(center_mm), rotation_matrix(rotation_deg))


def _drag(drag: DragSection, floater: Floater) -> Drag:
    if drag.linear_N_s_m is not None and drag.angular_N_m_s is not None:
        return Drag(drag.linear_N_s_m, drag.angular_N_m_s)
    return replace(Drag.of(floater), air=drag.model == "air")


def _metres(millimetres: list[float]) -> Array:
    return np.array(millimetres) * MILLI


def _rotor(rotor: Rotor, parts: Mapping[str, Part]) -> tuple[Magnet, ...]:
    if isinstance(rotor, ExplicitRotor):
        return tuple(_magnet(magnet, rotor, parts) for magnet in rotor.magnets)
    conductivity, knee = rotor.conductivity_S_m, _knee(rotor.coercivity_kA_m)
    return tuple(replace(magnet, conductivity=conductivity, coercivity=knee) for magnet in _of_article(rotor))


def _magnet(magnet: MagnetSection, rotor: ExplicitRotor, parts: Mapping[str, Part]) -> Magnet:
    """One of an explicit rotor, whose conductivity and knee it has where it has none of its own."""
    pose = magnet.center_mm, magnet.rotation_deg
    along, across = magnet.recoil_permeability
    conductivity = rotor.conductivity_S_m if magnet.conductivity_S_m is None else magnet.conductivity_S_m
    material = along, across, conductivity, _knee(magnet.coercivity_kA_m or rotor.coercivity_kA_m)
    polarization = np.array(magnet.polarization_T)
    if not magnet.file:
        return Magnet(solid(magnet, *pose), polarization, *material)
    body = placed(parts[magnet.file], *pose)
    known = known_shape(body)
    if known is None:
        return Magnet(body, polarization, *material)
    return Magnet(known, known.rotation.T @ body.rotation @ polarization, *material)


def _recognised(rotor: Rotor, magnets: tuple[Magnet, ...]) -> tuple[str, ...]:
    """A sentence on each magnet whose file holds a shape that has a closed form."""
    pairs = zip(rotor.magnets, magnets, strict=True) if isinstance(rotor, ExplicitRotor) else ()
    return tuple(
        f"{section.file} is a {_named(magnet.body)} and is computed as one"
        for section, magnet in pairs
        if section.file and not isinstance(magnet.body, Part)
    )


def _named(body: Solid) -> str:
    """A shape with its size, such as `cylinder, Ø 10 × 8 mm`."""
    name = "cuboid" if isinstance(body, Box) else type(body).__name__.lower()
    return f"{name}, {body.described_size.removeprefix(name).strip()},"


def _knee(coercivity: float | None) -> float | None:
    return None if coercivity is None else 1e3 * coercivity


def _of_article(rotor: HorizontalRotor | VerticalRotor | TiltRotor) -> tuple[Magnet, ...]:
    along, across = rotor.recoil_permeability
    material = rotor.remanence_T, along, across
    if isinstance(rotor, TiltRotor):
        return tilted_rotor(float(np.radians(rotor.angle_deg)), solid(rotor), *material)
    build = horizontal_rotor if rotor.configuration == "horizontal" else vertical_rotor
    return build(rotor.displacement_mm * MILLI, solid(rotor), *material)


def _plate(plate: PlateSection) -> Plate:
    down = plate.lowering
    lowering = Lowering(down.start_s, down.speed_mm_s * MILLI, down.distance_mm * MILLI) if down else None
    return Plate(_box(plate.size_mm, plate.center_mm, plate.rotation_deg), plate.conductivity_S_m, lowering)


def _start(start: StartSection | None) -> OffsetStart | AbsoluteStart:
    if start is None or start == StartSection():
        return OffsetStart()
    if start.position_mm is None:
        return OffsetStart(_metres(start.offset_mm or [0.0, 0.0, 0.1]))
    moment = np.array(start.moment or [0.0, 0.0, 1.0])
    if not 1e-100 < np.abs(moment).max() < 1e100:  # squares of its parts are no numbers
        moment = moment / np.abs(moment).max()
    return AbsoluteStart(
        position=_metres(start.position_mm),
        velocity=_metres(start.velocity_mm_s or [0.0, 0.0, 0.0]),
        moment=moment / np.linalg.norm(moment),
        spin=2 * np.pi * np.array(start.spin_hz or [0.0, 0.0, 0.0]),
    )


Table = Mapping[str, Any]
"""A table of the scene file."""


def horizontal(*, displacement_mm: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """One cube magnetised along +x and displaced along it from the axis.

    Parameters
    ----------
    displacement_mm : float
        Of the cube's centre, mm.
    remanence_T : float
        Remanence, T.
    edge_mm : float, optional
        Edge of the cubes, mm; left out where `shape` is "sphere" (with diameter_mm) or "cylinder" (and height_mm).
    **more : float or list
        Further keys, as for `magnets`.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    material = _article_material(remanence_T, edge_mm)
    return {"configuration": "horizontal", "displacement_mm": displacement_mm, **material, **more}


def vertical(*, displacement_mm: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """A cube magnetised along +x and one above it along +z.

    Parameters
    ----------
    displacement_mm : float
        From centre to centre, mm.
    remanence_T : float
        Remanence, T.
    edge_mm : float, optional
        Edge of the cubes, mm; left out where `shape` is "sphere" (with diameter_mm) or "cylinder" (and height_mm).
    **more : float or list
        Further keys, as for `magnets`.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    material = _article_material(remanence_T, edge_mm)
    return {"configuration": "vertical", "displacement_mm": displacement_mm, **material, **more}


def tilt(*, angle_deg: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """One cube, turned with its magnetisation about y.

    Parameters
    ----------
    angle_deg : float
        The magnetisation is along (cos angle, 0, sin angle), degrees.
    remanence_T : float
        Remanence, T.
    edge_mm : float, optional
        Edge of the cubes, mm; left out where `shape` is "sphere" (with diameter_mm) or "cylinder" (and height_mm).
    **more : float or list
        Further keys, as for `magnets`.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    material = _article_material(remanence_T, edge_mm)
    return {"configuration": "tilt", "angle_deg": angle_deg, **material, **more}


def _article_material(remanence_T: float, edge_mm: float | None) -> Table:
    return {"remanence_T": remanence_T} | ({} if edge_mm is None else {"edge_mm": edge_mm})


def magnets(*bodies: Table, **more: Any) -> Table:
    """Any set of magnets.

    Parameters
    ----------
    *bodies : dict
        Each with size_mm, center_mm, polarization_T, and where they are not the usual ones rotation_deg,
        recoil_permeability, conductivity_S_m, coercivity_kA_m.  For other shapes than "cuboid", in place of size_mm:
        shape "cylinder" with diameter_mm and height_mm, "ring" with inner_diameter_mm beside, "sphere" with
        diameter_mm.
    **more : float or list
        Further keys of every rotor: recoil_permeability of the article's, conductivity_S_m of all magnets (their eddy
        currents, else left out), coercivity_kA_m (the knee of their demagnetisation curves), field_map, and
        conductors, a list of tables with shape ("cuboid" or "cylinder"), size_mm or diameter_mm and height_mm,
        center_mm, rotation_deg and conductivity_S_m: metal that turns with the rotor.

    Returns
    -------
    dict
        The table `[rotor]` of a scene file.
    """
    return {"magnets": list(bodies), **more}


def sphere(*, diameter_mm: float, remanence_T: float, density_kg_m3: float, **more: Any) -> Table:
    """The floating sphere.

    Parameters
    ----------
    diameter_mm : float
        Diameter, mm.
    remanence_T : float
        Remanence, T.
    density_kg_m3 : float
        Density, kg/m³.
    **more : float
        Further keys: recoil_permeability (1.05), conductivity_S_m (its eddy currents, else left out).

    Returns
    -------
    dict
        The table `[floater]` of a scene file.
    """
    return {"diameter_mm": diameter_mm, "remanence_T": remanence_T, "density_kg_m3": density_kg_m3, **more}


def plate(*, size_mm: Sequence[float], center_mm: Sequence[float], conductivity_S_m: float, **more: Any) -> Table:
    """A conducting plate.

    Parameters
    ----------
    size_mm : sequence of 3 floats
        Edges, mm.
    center_mm : sequence of 3 floats
        Centre in the laboratory frame, mm.
    conductivity_S_m : float
        Conductivity, S/m.
    **more : list or dict
        Further keys: rotation_deg about x, y, z, and lowering = {start_s, speed_mm_s, distance_mm}.

    Returns
    -------
    dict
        The table `[plate]` of a scene file.
    """
    return {"size_mm": size_mm, "center_mm": center_mm, "conductivity_S_m": conductivity_S_m, **more}
