"""From the keys of a scene file to the scene in SI units, and the tables of such keys in Python."""

import copy
import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..common import InputError, shown
from ..files import regular_file
from ..magnets import Magnet
from ..rotor import Conductor, horizontal as horizontal_rotor, tilt as tilted_rotor, vertical as vertical_rotor
from ..shapes import Box, Cylinder, Ring, Sphere, rotation_matrix
from ..solids import Part, Solid, known_shape
from ..step_file import read_part
from .contents import AbsoluteStart, Drag, Floater, Lowering, MapReading, OffsetStart, Plate, Scene
from .messages import SceneError, described_faults, overlap_faults
from .schema import (
    AnyRotor,
    DisplacedRotor,
    ExplicitRotor,
    FloaterTable,
    MagnetTable,
    SceneTable,
    StartTable,
    TiltRotor,
    key_faults,
)

MILLI = 1e-3
LARGEST = 2**30  # Bytes of a file that a scene may name
MOST_BODIES = 64  # Magnets and conductors of a scene beside a known one, unless that has more
ORIGIN = (0.0, 0.0, 0.0)


def assemble(keys: Mapping[str, Any], source: str, folder: Path | None = None, known: Scene | None = None) -> Scene:
    """The scene of a scene file's keys, which it keeps; names of files in them are from the folder at hand then.

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
        table = SceneTable.model_validate(keys)
    except ValidationError as error:
        raise SceneError(source, described_faults(error.errors())) from None
    faults = key_faults(table) + (_too_many(table.rotor, known) if known else [])
    if faults:
        raise SceneError(source, faults)
    try:
        paths = _named_files(table.rotor, Path(source).parent if folder is None else folder, known)
        read = {part.file: part for part in known.parts} if known else {}
        parts = {path: read.get(path) or read_part(path) for number, path in paths.items() if number is not None}
        scene = _scene(table, paths, parts)
        files = {str(path): content_digest(path) for path in paths.values()} if known is None else dict(known.files)
    except InputError as error:  # a file
        raise SceneError(source, [str(error)]) from None
    faults = overlap_faults(scene)
    if faults:
        raise SceneError(source, faults)
    own = copy.deepcopy(dict(keys))
    for number, path in paths.items():
        if number is None:
            own["rotor"]["field_map"] = str(path)
        else:
            own["rotor"]["magnets"][number]["file"] = str(path)
    scene = replace(scene, files=tuple(files.items()), parts=tuple(parts.values()))
    return replace(scene, keys=(own, scene))


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


def _too_many(rotor: AnyRotor, known: Scene) -> list[str]:
    """What is wrong with a number of bodies whose overlaps would take minutes."""
    number = len(rotor.conductors) + (len(rotor.magnets) if isinstance(rotor, ExplicitRotor) else 0)
    most = max(MOST_BODIES, len(known.turning_bodies))
    if number <= most:
        return []
    said = f"Input rotor must have at most {most} magnets and conductors here; instead received {number}."
    return [f"{said} Give the scene to the command line."]


def _named_files(rotor: AnyRotor, folder: Path, known: Scene | None) -> dict[int | None, Path]:
    """The files that a rotor names: those of magnets by their number, that of its map by None.

    Beside a known scene a name means one of its files, which is `folder / name` or ends so. No disk is asked.
    """
    names: dict[int | None, str | None] = {None: rotor.field_map}
    if isinstance(rotor, ExplicitRotor):
        names |= {k: magnet.file for k, magnet in enumerate(rotor.magnets)}
    found: dict[int | None, Path] = {}
    for number, name in names.items():
        if name and known is None:
            found[number] = folder / name
        elif name and known:
            own = [known.field_map] if number is None else [part.file for part in known.parts]
            files, end = [file for file in own if file], Path(name).parts
            alike = [file for file in files if file == folder / name or file.parts[-len(end) :] == end]
            if not alike:
                key = "field_map" if number is None else f"magnets[{number}].file"
                raise InputError(
                    f"Input rotor.{key} must be a file of the scene that was opened first; instead received "
                    f"{shown(name)}. Give the scene to the command line."
                )
            found[number] = folder / name if folder / name in alike else alike[0]
    return found


def _scene(table: SceneTable, paths: Mapping[int | None, Path], parts: Mapping[Path, Part]) -> Scene:
    rotor, floater, plate, drag = table.rotor, _floater(table.floater), table.plate, table.drag
    down, air = plate.lowering if plate else None, Drag.of(floater)
    if drag and drag.linear_N_s_m is not None and drag.angular_N_m_s is not None:
        air = Drag(drag.linear_N_s_m, drag.angular_N_m_s)
    if isinstance(rotor, ExplicitRotor):
        bodies = [parts[paths[k]] if magnet.file else None for k, magnet in enumerate(rotor.magnets)]
        magnets = tuple(_magnet(*pair, rotor) for pair in zip(rotor.magnets, bodies, strict=True))
    else:
        magnets = _article_magnets(rotor)
    lowering = Lowering(down.start_s, down.speed_mm_s * MILLI, down.distance_mm * MILLI) if down else None
    return Scene(
        frequency=table.frequency_hz,
        gravity=np.array(table.gravity_m_s2),
        rotor=magnets,
        floater=floater,
        plate=Plate(_solid(plate).box, plate.conductivity_S_m, lowering) if plate else None,
        drag=replace(air, air=True) if drag and drag.model == "air" else air,
        start=_start(table.start or StartTable()),
        field_map=paths.get(None),
        map_reading=MapReading(rotor.map_length_unit, rotor.map_field_unit, rotor.map_columns),
        conductors=tuple(Conductor(_solid(c), c.conductivity_S_m) for c in rotor.conductors),
    )


def _solid(table: Any) -> Solid:
    """The body of a table's shape, in its place if the table has one."""
    center, angles = (getattr(table, key, ORIGIN) for key in ("center_mm", "rotation_deg"))
    pose = MILLI * np.array(center), rotation_matrix(angles)
    shape, radius = getattr(table, "shape", "cuboid"), (getattr(table, "diameter_mm", None) or 0.0) * MILLI / 2
    if shape == "sphere":
        return Sphere(radius, *pose)
    if shape == "cylinder":
        return Cylinder(radius, table.height_mm * MILLI, *pose)
    if shape == "ring":
        return Ring(radius, table.inner_diameter_mm * MILLI / 2, table.height_mm * MILLI, *pose)
    return Box(np.array([table.edge_mm] * 3 if shape == "cube" else table.size_mm) * MILLI, *pose)


def _magnet(table: MagnetTable, part: Part | None, rotor: AnyRotor) -> Magnet:
    """One of an explicit rotor, whose conductivity and knee it has where it has none of its own."""
    conductivity = rotor.conductivity_S_m if table.conductivity_S_m is None else table.conductivity_S_m
    knee = table.coercivity_kA_m or rotor.coercivity_kA_m
    along, across = table.recoil_permeability
    material = along, across, conductivity, 1e3 * knee if knee else None
    polarization = np.array(table.polarization_T)
    if part is None:
        return Magnet(_solid(table), polarization, *material)
    turn = rotation_matrix(table.rotation_deg)
    part = replace(part, center=MILLI * np.array(table.center_mm) - turn @ part.origin, rotation=turn)
    body = known_shape(part) or part
    return Magnet(body, body.rotation.T @ turn @ polarization if body is not part else polarization, *material)


def _article_magnets(rotor: DisplacedRotor | TiltRotor) -> tuple[Magnet, ...]:
    material = rotor.remanence_T, *rotor.recoil_permeability
    if isinstance(rotor, TiltRotor):
        magnets = tilted_rotor(float(np.radians(rotor.angle_deg)), _solid(rotor), *material)
    else:
        build = horizontal_rotor if rotor.configuration == "horizontal" else vertical_rotor
        magnets = build(rotor.displacement_mm * MILLI, _solid(rotor), *material)
    knee = None if rotor.coercivity_kA_m is None else 1e3 * rotor.coercivity_kA_m
    return tuple(replace(magnet, conductivity=rotor.conductivity_S_m, coercivity=knee) for magnet in magnets)


def _floater(table: FloaterTable) -> Floater:
    material = (table.remanence_T, table.recoil_permeability, table.density_kg_m3, table.conductivity_S_m)
    body = _solid(table)
    return Floater(body.circumradius, *material, body if isinstance(body, Box | Cylinder) else None)


def _start(start: StartTable) -> OffsetStart | AbsoluteStart:
    if start.position_mm is None:
        return OffsetStart() if start.offset_mm is None else OffsetStart(MILLI * np.array(start.offset_mm))
    moment = np.array(start.moment or [0.0, 0.0, 1.0])
    if not 1e-100 < np.abs(moment).max() < 1e100:  # squares of its parts are no numbers
        moment = moment / np.abs(moment).max()
    return AbsoluteStart(
        position=MILLI * np.array(start.position_mm),
        velocity=MILLI * np.array(start.velocity_mm_s or ORIGIN),
        moment=moment / np.linalg.norm(moment),
        spin=2 * np.pi * np.array(start.spin_hz or ORIGIN),
    )


Table = Mapping[str, Any]  # A table of the scene file


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
    return {"configuration": "horizontal", "displacement_mm": displacement_mm, **_cube(remanence_T, edge_mm), **more}


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
    return {"configuration": "vertical", "displacement_mm": displacement_mm, **_cube(remanence_T, edge_mm), **more}


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
    return {"configuration": "tilt", "angle_deg": angle_deg, **_cube(remanence_T, edge_mm), **more}


def _cube(remanence_T: float, edge_mm: float | None) -> Table:
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
