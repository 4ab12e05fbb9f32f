"""From the keys of a scene file to the scene in SI units, and the tables of such keys in Python."""

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..common import InputError, P, shown, spelled
from ..files import regular_file
from ..step_file import read_part
from .contents import Scene
from .messages import SceneError, described_faults, key_faults, overlap_faults
from .schema import ExplicitRotor, SceneTable

LARGEST = 2**30  # Bytes of a file that a scene may name
FILES = "file", "field_map"  # keys that name a file: of a body, or the map of the rotor's field
MOST_BODIES = 64  # Magnets and conductors of a scene beside a known one, unless that has more


def assemble(keys: Mapping[str, Any], source: str, folder: Path | None = None, known: Scene | None = None) -> Scene:
    """The scene of a scene file's `keys`, as TOML has them, which it keeps; names of files in them become paths.

    Raises SceneError: unknown, missing or wrong keys, bodies that overlap, or a file that is not known. `source` names
    it in messages; `folder` is where the files lie that it names, by default that of `source`. Keys of which nothing is
    known may name the files of a scene `known` alone, as it has them: no path is opened, and there are at most
    `MOST_BODIES` or as many as it has.
    """
    keys, tolerances, faults = without_tolerances(keys)
    if faults:
        raise SceneError(source, faults)
    try:
        table = SceneTable.model_validate(keys)
    except ValidationError as error:
        raise SceneError(source, described_faults(error.errors())) from None
    faults, rotor = key_faults(table), table.rotor
    if known:  # overlaps of very many bodies would take minutes
        number = len(rotor.conductors) + (len(rotor.magnets) if isinstance(rotor, ExplicitRotor) else 0)
        if number > (most := max(MOST_BODIES, len(known.turning_bodies))):
            said = f"Input rotor must have at most {most} magnets and conductors here; instead received {number}."
            faults.append(f"{said} Give the scene to the command line.")
    if faults:
        raise SceneError(source, faults)
    try:
        found: dict[str, list[str]] = {key: [] for key in FILES}
        own = _with_paths(keys, Path(source).parent if folder is None else folder, known, found)
        parts = {str(part.file): part for part in known.parts} if known else {}
        parts = {path: parts.get(path) or read_part(Path(path)) for path in found["file"]}
        scene = SceneTable.model_validate(own).scene(parts)
        files = {path: content_digest(Path(path)) for paths in found.values() for path in paths}
        files = files if known is None else dict(known.files)
    except InputError as error:  # a file
        raise SceneError(source, [str(error)]) from None
    if faults := overlap_faults(scene):
        raise SceneError(source, faults)
    scene = replace(
        scene, files=tuple(files.items()), parts=tuple(parts.values()), tolerances=tuple(tolerances.items())
    )
    return replace(scene, keys=(own, scene))


DEEPEST = 20  # tables and lists in each other in which numbers are looked for
WITH_TOLERANCE = {"value", "tolerance"}  # the keys of a number that says how well it is known


def without_tolerances(keys: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, float], list[str]]:
    """Keys whose numbers may be written `{value = 10, tolerance = 0.05}`: the plain ones, tolerances by key, faults."""
    tolerances, faults = dict[str, float](), list[str]()

    def plain(value: Any, place: str, depth: int = 0) -> Any:
        if depth > DEEPEST:  # the schema refuses it
            return value
        if isinstance(value, list):
            return [plain(entry, f"{place}.{k}", depth + 1) for k, entry in enumerate(value)]
        if not isinstance(value, Mapping):
            return value
        if not WITH_TOLERANCE & value.keys():
            return {key: plain(entry, f"{place}.{key}".removeprefix("."), depth + 1) for key, entry in value.items()}
        for key in value.keys() - WITH_TOLERANCE:
            faults.append(f"unknown key `{place}.{key}` (allowed are value, tolerance)")
        for key in () if len(value) > 1 else sorted(WITH_TOLERANCE - value.keys()):
            faults.append(f"Input {place}.{key} must be given; instead it is missing.")
        for key in sorted(WITH_TOLERANCE & value.keys()):
            number, any_sign = value[key], key == "value"
            fine = isinstance(number, int | float) and not isinstance(number, bool) and abs(number) < float("inf")
            if not fine or not (any_sign or number > 0):
                rule = "a number" if any_sign else "a positive number"
                faults.append(f"Input {place}.{key} must be {rule}; instead received {shown(number)}.")
            elif key == "tolerance":
                tolerances[place] = float(number)
        return value.get("value")

    return plain(keys, ""), tolerances, faults


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


def _with_paths(keys: Any, folder: Path, known: Scene | None, found: dict[str, list[str]], place: str = "") -> Any:
    """Keys whose files are paths from a folder, `found` by key; beside a known scene those of it that end so."""
    if isinstance(keys, list):
        return [_with_paths(entry, folder, known, found, f"{place}[{k}]") for k, entry in enumerate(keys)]
    if not isinstance(keys, Mapping):
        return keys
    result = {}
    for key, entry in keys.items():
        there = f"{place}.{key}".removeprefix(".")
        if key not in FILES or entry is None:
            result[key] = _with_paths(entry, folder, known, found, there)
            continue
        path, end = folder / entry, Path(entry).parts
        if known:
            own = [known.field_map] if key == "field_map" else [part.file for part in known.parts]
            alike = [file for file in own if file and (file == path or file.parts[-len(end) :] == end)]
            if not alike:
                raise InputError(
                    f"Input {there} must be a file of the scene that was opened first; instead received "
                    f"{shown(entry)}. Give the scene to the command line."
                )
            path = path if path in alike else alike[0]
        found[key].append(str(path))
        result[key] = str(path)
    return result


Table = Mapping[str, Any]  # A table of the scene file


def _table(name: str) -> Callable[[Callable[P, Table]], Callable[P, Table]]:
    """Decorator of what makes a table: slips in arguments are named, and the docstring says what is returned."""

    def documented(function: Callable[P, Table]) -> Callable[P, Table]:
        found, returned = spelled(function), f"dict\n        The table `[{name}]` of a scene file.\n    "
        found.__doc__ = f"{function.__doc__}\n    Returns\n    -------\n    {returned}"
        return found

    return documented


def _rotor(configuration: str, edge_mm: float | None, **keys: Any) -> Table:
    return {"configuration": configuration, **keys} | ({} if edge_mm is None else {"edge_mm": edge_mm})


@_table("rotor")
def horizontal(*, displacement_mm: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """One cube magnetised along +x and displaced along it from the axis.

    Parameters
    ----------
    displacement_mm, remanence_T : float
        Of the cube's centre, mm, and remanence, T.
    edge_mm : float, optional
        Edge of the cubes, mm; left out where `shape` is "sphere" (with diameter_mm) or "cylinder" (and height_mm).
    **more : float or list
        Further keys, as for `magnets`.
    """
    return _rotor("horizontal", edge_mm, displacement_mm=displacement_mm, remanence_T=remanence_T, **more)


@_table("rotor")
def vertical(*, displacement_mm: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """A cube magnetised along +x and one above it along +z.

    Parameters
    ----------
    displacement_mm : float
        From centre to centre, mm.
    remanence_T, edge_mm, **more : float or list
        As for `horizontal`.
    """
    return _rotor("vertical", edge_mm, displacement_mm=displacement_mm, remanence_T=remanence_T, **more)


@_table("rotor")
def tilt(*, angle_deg: float, remanence_T: float, edge_mm: float | None = None, **more: Any) -> Table:
    """One cube, turned with its magnetisation about y.

    Parameters
    ----------
    angle_deg : float
        The magnetisation is along (cos angle, 0, sin angle), degrees.
    remanence_T, edge_mm, **more : float or list
        As for `horizontal`.
    """
    return _rotor("tilt", edge_mm, angle_deg=angle_deg, remanence_T=remanence_T, **more)


@_table("rotor")
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
    """
    return {"magnets": list(bodies), **more}


@_table("floater")
def sphere(*, diameter_mm: float, remanence_T: float, density_kg_m3: float, **more: Any) -> Table:
    """The floating sphere.

    Parameters
    ----------
    diameter_mm, remanence_T, density_kg_m3 : float
        Diameter, mm, remanence, T, and density, kg/m³.
    **more : float
        Further keys: recoil_permeability (1.05), conductivity_S_m (its eddy currents, else left out).
    """
    return {"diameter_mm": diameter_mm, "remanence_T": remanence_T, "density_kg_m3": density_kg_m3, **more}


@_table("plate")
def plate(
    *, center_mm: Sequence[float], conductivity_S_m: float, size_mm: Sequence[float] | None = None, **more: Any
) -> Table:
    """A conducting plate.

    Parameters
    ----------
    center_mm : sequence of 3 floats
        Centre in the laboratory frame, mm.
    conductivity_S_m : float
        S/m.
    size_mm : sequence of 3 floats, optional
        Edges of a cuboid, mm; left out for another shape.
    **more : list, dict or text
        Further keys: rotation_deg about x, y, z, and lowering = {start_s, speed_mm_s, distance_mm}; in place of
        size_mm shape "disc" with diameter_mm and height_mm, "ring" with inner_diameter_mm beside, "sphere" with
        diameter_mm, or "file" with the name of a STEP file as file.
    """
    size = {} if size_mm is None else {"size_mm": size_mm}
    return {**size, "center_mm": center_mm, "conductivity_S_m": conductivity_S_m, **more}
