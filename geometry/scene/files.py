"""Scene files: read and checked, changed, and written again with what the user wrote of what was not replaced since."""

import copy
import hashlib
import json
import logging
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..common import Array, InputError, shown, spelled
from ..files import file_content, regular_file
from ..magnets import Magnet
from ..shapes import rotation_angles
from ..solids import Part, Solid
from . import schema
from .contents import Coil, Drag, DriveStep, OffsetStart, Scene
from .making import WITH_TOLERANCE, assemble, content_digest
from .messages import SceneError, unusual

SAME = 1e-12  # Entry of a vector, in its largest, below which it is round-off
MOST = 5_000_000  # Bytes of a scene file; one with a thousand magnets has 200 000
MOST_OF_MAP = 1_000_000_000  # Bytes of a map of the field
# A dotted key of so many parts: reading it takes time and memory that grow with their square.
LONGEST_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')[ \t]*\.[ \t]*){20}""")
# The unit at a key's end, and its size where it is not that of the objects of a scene.
UNIT = re.compile(r"_(mm_s|mm|kA_m|hz|s|T|S_m|kg_m3|N_s_m|N_m_s|m_s2)$")
IN_SI = {"_mm_s": 1e-3, "_mm": 1e-3, "_kA_m": 1e3, "_hz": 2 * np.pi}
DECIMAL_COMMA = re.compile(r"\s*[\w.-]+\s*=\s*[-+]?\d+,\s*\d")
DEEPEST = 10  # Tables and lists in each other; a scene has five
LARGEST = 2**1000  # Integers below it are floats


def load_scene(path: str | Path) -> Scene:
    """Read and check a scene file.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    Scene
        What it describes, in SI units.

    Raises
    ------
    SceneError
        The file is missing, no file, too large or unreadable, is not TOML, has unknown, missing or wrong keys, or its
        bodies overlap, or its map of the field is no file.
    """
    source = str(path) if isinstance(path, str | Path) else "scene"
    try:
        scene = parse_scene(_text(path, "scene").replace("\r\n", "\n").replace("\r", "\n"), source)
        if scene.field_map:
            regular_file(scene.field_map, MOST_OF_MAP, "rotor.field_map", "a map of the field").close()
    except SceneError:
        raise
    except InputError as error:
        raise SceneError(source, [str(error)]) from None
    _warned(scene)
    for keys, magnet in zip(scene_keys(scene).get("rotor", {}).get("magnets", ()), scene.rotor, strict=False):
        body = magnet.body
        if keys.get("file") and not isinstance(body, Part):
            size = body.described_size.removeprefix(body.kind).strip()
            said = f"{Path(keys['file']).name} is a {body.kind}, {size}, and is computed as one"
            logging.getLogger("spinlev").info(said)
    return scene


def toml_tables(path: str | Path, name: str) -> dict[str, Any]:
    """The tables of a TOML file that messages call `name`. Raises InputError where there is none."""
    return _keys(_text(path, name), str(path))


def _text(path: str | Path, name: str) -> str:
    try:
        return file_content(path, MOST, name, "a TOML file").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(str(path), [f"Input {name} must be a text in UTF-8; instead: {error}."]) from None


def parse_scene(
    text: str, source: str = "scene", changes: Mapping[str, float] | None = None, known: Scene | None = None
) -> Scene:
    """Build a scene from the text of a scene file.

    Parameters
    ----------
    text : str
        As in a scene file, TOML.
    source : str
        What messages call it.
    changes : dict of str to float, optional
        Numbers that replace those of the text, by key, such as `rotor.displacement_mm` or `plate.center_mm.2`.
    known : Scene, optional
        A scene whose files alone the text may name, for a text of which nothing is known: no other path is opened.

    Returns
    -------
    Scene
        What it describes, in SI units.

    Raises
    ------
    SceneError
        As `load_scene`, also for a change that no key takes.
    """
    keys = _keys(text, source)
    for key, value in (changes or {}).items():
        _replace(keys, key, value, source)
    try:
        scene = assemble(keys, source, known=known)
    except SceneError as error:
        raise SceneError(source, error.faults, text=text) from None
    return scene if changes else replace(scene, text=text)


def _keys(text: str, source: str) -> dict[str, Any]:
    """The tables of a text, of which TOML's parser survives the reading."""
    fault = "Input key must have fewer than 20 parts; instead there is one with more."
    try:
        if not LONGEST_KEY.search(text):
            return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        why = str(error)[:200].replace("Cannot overwrite a value", "A key stands twice")
        fault = f"Input scene must be TOML; instead: {why}."
        for number, line in enumerate(text.splitlines(), 1):
            if DECIMAL_COMMA.match(line) and f"at line {number}," in str(error):
                fault = (
                    f"Input line {number} must have a decimal point, not a comma (lists have square brackets); "
                    f"instead received {shown(line.strip())}."
                )
    except RecursionError:
        fault = "Input scene must be TOML with few lists in each other; instead some are nested too deep."
    except ValueError:  # Python's own limit
        fault = "Input scene must have numbers of a few digits; instead one has thousands."
    raise SceneError(source, [fault])


def changed(scene: Scene, changes: Mapping[str, float], source: str = "scene", known: Scene | None = None) -> Scene:
    """The `scene` with numbers replaced by key; `changes`, `source` and `known` are as in `parse_scene`.

    Raises SceneError as that does, and where a file that the scene names has another content than when it was read.
    """
    keys = scene_keys(scene)
    for key, value in changes.items():
        _replace(keys, key, value, source)
    found = assemble(keys, source, Path(), known)
    _check_same(scene, found.files, source)
    return replace(found, tolerances=scene.tolerances)


def driven(scene: Scene, steps: Sequence[Mapping[str, Any]], source: str = "drive", **keys: Any) -> Scene:
    """The scene with other steps of its drive.

    Raises SceneError: as of `changed`. `scene`: it stays as it is; `steps`: tables of `[[drive]]`, with the keys of the
    scene file; `source`: what messages call it; `keys`: others of the whole file, which take the place of the scene's.
    """
    found = assemble(scene_keys(scene) | {"drive": _plain(steps)} | keys, source, Path())
    _check_same(scene, found.files, source)
    return found


def check_files(scene: Scene, source: str = "scene") -> None:
    """Raise SceneError if a file that a scene names has another content than when the scene was read."""
    _check_same(scene, [(path, content_digest(Path(path))) for path, _ in scene.files], source)


def _check_same(scene: Scene, files: Iterable[tuple[str, str]], source: str) -> None:
    for path, digest in files:
        if dict(scene.files).get(path, digest) != digest:
            instead = "its content is another one" if digest else "it cannot be read any more"
            way_out = "Begin again, and what needs the file is computed anew."
            raise SceneError(
                source, [f"Input {path} must stay as it was when the scene was read; instead {instead}. {way_out}"]
            )


def _replace(raw: Any, key: str, value: float, source: str) -> None:
    """Put a number in the place of `key`: names of tables, and numbers of list entries from 0, joined by dots."""
    try:
        *path, last = (int(part) if part.isdecimal() else part for part in key.split("."))
        for part in path:
            raw = raw[part]
        if isinstance(last, int):
            raw[last] = value
        else:
            raw.update({last: value})
    except (ValueError, KeyError, IndexError, TypeError, AttributeError):
        raise SceneError(
            source,
            [f"Input {shown(key)} must be a key inside the tables and lists that the scene has; instead it is not."],
        ) from None


@spelled
def scene(
    *,
    frequency_hz: float,
    rotor: Mapping[str, Any],
    floater: Mapping[str, Any] | Sequence[Mapping[str, Any]],
    plate: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    gravity_m_s2: Sequence[float] = (0.0, 0.0, -9.81),
    drag: Mapping[str, Any] | None = None,
    start: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    drive: Sequence[Mapping[str, Any]] | None = None,
    **more: Any,
) -> Scene:
    """A scene from the tables of a scene file; the object itself is in SI units.

    Parameters
    ----------
    frequency_hz : float
        Turns of the rotor per second about +z, Hz.
    rotor, floater, plate : dict
        `horizontal`, `vertical`, `tilt` or `magnets`; `sphere`; `plate` (left out, none) or a list of such; or
        mappings with the keys of a scene file, as of a floater with shape "cuboid" (and size_mm) or "cylinder" (and
        diameter_mm, height_mm).
    gravity_m_s2 : sequence of 3 floats
        In the laboratory frame, m/s².
    drag : dict, optional
        "model" ("stokes", or "air": what a real sphere feels at its Reynolds number and frequency), or "linear_N_s_m"
        and "angular_N_m_s"; left out, Stokes drag in air.
    start : dict, optional
        "offset_mm" from the stable equilibrium, or "position_mm" with "velocity_mm_s", "moment" and "spin_hz"; left
        out, 0.1 mm above the stable equilibrium. Of several floaters, which are a list, a list of as many.
    drive : list of dict, optional
        Steps of the rotor's frequency from `frequency_hz` on: "to_hz" or "stop" (True) with "in_s", or "hold_s"; or of
        its way, "center_mm" and "axis".
    **more : float or list
        Further keys that stand in no table of a scene file.

    Returns
    -------
    Scene
        In SI units.

    Raises
    ------
    SceneError
        A missing, unknown or wrong key, with what is allowed, or bodies that overlap.

    Examples
    --------
    >>> import spinlev as sl
    >>> cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    >>> ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    >>> sl.scene(frequency_hz=130.0, rotor=cube, floater=ball).frequency
    130.0
    """
    keys = {"frequency_hz": frequency_hz, "gravity_m_s2": gravity_m_s2, "rotor": rotor, "floater": floater, **more}
    tables = {"plate": plate, "drag": drag, "start": start, "drive": drive}
    keys |= {name: table for name, table in tables.items() if table is not None}
    return _warned(assemble(_plain(keys), "scene"))


def _warned(scene: Scene) -> Scene:
    if said := unusual(scene):
        logging.getLogger("spinlev").warning(said)
    return scene


def _plain(value: Any, depth: int = 0) -> Any:
    """Tuples and arrays as lists, NumPy's numbers and integers as floats: as a scene file has them."""
    if depth > DEEPEST:  # as what is too large for a float it is left as it is: the schema refuses it
        return value
    if isinstance(value, Mapping):
        return {str(key): _plain(item, depth + 1) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), depth + 1)
    if isinstance(value, list | tuple):
        return [_plain(item, depth + 1) for item in value]
    whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < LARGEST
    return float(value) if whole else value


def scene_text(scene: Scene) -> str:
    """The scene file of a scene: the one that was read if nothing was replaced since, else one of its keys."""
    untouched = scene.text and all(_as_written(scene, name) for name in FIELDS)
    return scene.text if untouched else _toml(_with_tolerances(scene_keys(scene), dict(scene.tolerances)))


def _with_tolerances(keys: Any, tolerances: Mapping[str, float], place: str = "") -> Any:
    """Keys with their numbers as `without_tolerances` reads them, where there is a tolerance."""
    found = {k: _with_tolerances(value, tolerances, f"{place}.{k}".removeprefix(".")) for k, value in _parts(keys)}
    if isinstance(keys, Mapping | list):
        return found if isinstance(keys, Mapping) else list(found.values())
    return {"value": keys, "tolerance": tolerances[place]} if place in tolerances else keys


def _parts(keys: Any) -> Iterable[tuple[Any, Any]]:
    return keys.items() if isinstance(keys, Mapping) else enumerate(keys if isinstance(keys, list) else ())


def startless_text(scene: Scene) -> str:
    """The scene file of a scene as if it did not say where a trajectory begins: the same for all of one scene."""
    return scene_text(replace(scene, start=OffsetStart()))


def scene_keys(scene: Scene) -> dict[str, Any]:
    """The keys of a scene file that describe a scene; what was replaced since is written from the object."""
    own = scene.keys[0] if scene.keys else {}
    found = {
        name: copy.deepcopy(own.get(name)) if _as_written(scene, name) else written(scene)
        for name, (_, written) in FIELDS.items()
    }
    return {name: table for name, table in found.items() if table is not None}


# Beginnings of keys whose numbers decide no equilibrium.
OF_MOTION = re.compile(
    r"start|drive|coils\.\d+\.(center_mm\.[01]|frequency_hz|phase_deg)|plate\.lowering|rotor\.coercivity_kA_m"
)


def scene_numbers(scene: Scene) -> tuple[Scene, dict[str, float]]:
    """The scene with gravity and recoil permeabilities written out, and the numbers of its equilibria by dotted key."""
    keys = {"gravity_m_s2": [0.0, 0.0, -9.81]} | scene_keys(scene)
    rotor, floater = keys["rotor"], keys["floater"]
    floaters = floater if isinstance(floater, list) else [floater]
    for table in rotor.get("magnets", [rotor]) + [m for one in floaters for m in one.get("magnets", [one])]:
        table.setdefault("recoil_permeability", schema.RECOIL_PERMEABILITY)
    found = dict(_flattened(keys))
    whole = replace(assemble(keys, "scene", Path()), tolerances=scene.tolerances)
    _check_same(scene, whole.files, "scene")
    return whole, {key: value for key, value in found.items() if not OF_MOTION.match(key)}


def _flattened(value: Any, key: str = "") -> Iterator[tuple[str, float]]:
    for name, part in _parts(value):
        yield from _flattened(part, f"{key}.{name}".removeprefix("."))
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield key, float(value)


def canonical_keys(scene: Scene) -> dict[str, Any]:
    """All keys that a scene file can have, with defaults, numbers as floats, and None for what is left out."""
    return schema.SceneTable.model_validate(scene_keys(scene)).model_dump()


def scene_digest(scene: Scene) -> str:
    """SHA-256 of what a scene says and of the contents of its files as they were read, whatever their names are."""
    keys, metal = canonical_keys(scene), scene.plate.body.placed if scene.plate else ()
    bodies = [*(magnet.body for magnet in scene.rotor), *metal]
    contents = {str(body.file): str(body.shape_numbers) for body in bodies if isinstance(body, Part)}
    contents |= {path: digest for path, digest in scene.files if digest}
    keys["rotor"]["field_map"] = map_digest(scene)
    plates = keys["plate"] if isinstance(keys["plate"], list) else [keys["plate"] or {}]
    for table in (*keys["rotor"].get("magnets", ()), *plates):
        if "file" in table:
            table["file"] = contents.get(table["file"])
    return hashlib.sha256(json.dumps(keys, sort_keys=True).encode()).hexdigest()


def map_digest(scene: Scene) -> str:
    """SHA-256 of the content of a scene's map of the field; empty where it has none."""
    path = scene.field_map
    return "" if path is None else dict(scene.files).get(str(path)) or content_digest(path)


def _as_written(scene: Scene, name: str) -> bool:
    """Whether all that a key or table of the scene file decides is still what that made."""
    if not scene.keys:
        return False
    pairs = [(getattr(scene, field), getattr(scene.keys[1], field)) for field in FIELDS[name][0]]
    return all(now is then or (not isinstance(now, np.ndarray) and now == then) for now, then in pairs)


def _said(table: type[schema.Table], thing: Any) -> dict[str, Any]:
    """What a table's keys are of an object whose attributes have their names without units; those that it has."""
    keys: dict[str, Any] = {}
    for key in table.model_fields:
        unit = UNIT.search(key)
        name, size = key.removesuffix(unit[0] if unit else "").removeprefix("map_"), IN_SI.get(unit[0] if unit else "")
        value = getattr(thing, name, None)
        if isinstance(value, np.ndarray):
            keys[key] = _all_rounded(value / size) if size else value.tolist()
        elif isinstance(value, float | int | str):
            keys[key] = _rounded(float(value) / size) if size else value
    return keys


def _rotor(scene: Scene) -> dict[str, Any] | None:
    if scene.coils and not scene.rotor:
        return None
    keys: dict[str, Any] = {"magnets": [_magnet(magnet) for magnet in scene.rotor]}
    keys |= {"field_map": str(scene.field_map)} if scene.field_map else {}
    pieces = [{"shape": "cuboid"} | body_keys(c.body) for c in scene.conductors]
    conductors = [keys | _said(schema.ConductorTable, c) for keys, c in zip(pieces, scene.conductors, strict=True)]
    return keys | _said(schema.AnyRotor, scene.map_reading) | ({"conductors": conductors} if conductors else {})


def _magnet(magnet: Magnet) -> dict[str, Any]:
    keys = body_keys(magnet.body) | _said(schema.MagnetTable, magnet)
    both = [magnet.recoil_permeability, magnet.transverse_permeability]
    return keys if magnet.isotropic else keys | {"recoil_permeability": both}


def _of_each(write: Callable[[Scene], Any]) -> Callable[[Scene], Any]:
    """What `write` makes of a scene, of one with several floaters a list with that of each."""
    return lambda scene: [write(one) for one in scene.each] if scene.companions else write(scene)


def _floater(scene: Scene) -> dict[str, Any]:
    floater = scene.floater
    given = {} if floater.moments_of_inertia is None else {"inertia_kg_m2": list(floater.moments_of_inertia)}
    if not floater.pieces:
        return _said(schema.FloaterTable, floater) | shape_keys(floater.bodies[0]) | given
    magnets, bodies = list[dict[str, Any]](), list[dict[str, Any]]()
    for part in floater.pieces:
        keys = body_keys(part.magnet.body) | {"density_kg_m3": part.density}
        bare = not (part.magnet.polarization.any() or part.magnet.contrast)
        table, form = (bodies, schema.BallastTable) if bare else (magnets, schema.FloaterMagnetTable)
        table.append(keys | _said(form, part.magnet))
    return {"magnets": magnets, **({"bodies": bodies} if bodies else {}), **given}


def _plate(scene: Scene) -> dict[str, Any] | list[dict[str, Any]] | None:
    if (plate := scene.plate) is None:
        return None
    down = {"lowering": _said(schema.LoweringTable, plate.lowering)} if plate.lowering else {}
    pairs = zip(plate.body.placed, plate.each or [plate.conductivity], strict=True)
    each = [body_keys(body) | {"conductivity_S_m": _rounded(metal)} | down for body, metal in pairs]
    return each[0] if len(each) == 1 else each


def _drag(scene: Scene) -> dict[str, Any] | None:
    if scene.drag == (stokes := Drag.of(scene.floater)):
        return None
    return {"model": "air"} if scene.drag == replace(stokes, air=True) else _said(schema.DragTable, scene.drag)


def _step(step: DriveStep) -> dict[str, Any]:
    keys: dict[str, Any] = {} if step.frequency is None else {"to_hz": step.frequency}
    keys |= {"center_mm": _all_rounded(1e3 * np.array(step.center))} if step.center else {}
    keys |= {"axis": list(step.axis)} if step.axis else {}
    return keys | {"in_s" if keys else "hold_s": step.seconds}


def _coil(coil: Coil) -> dict[str, Any]:
    keys = _said(schema.CoilTable, coil) | {"phase_deg": _rounded(np.degrees(coil.phase))}
    current = coil.current.tolist() if isinstance(coil.current, np.ndarray) else float(coil.current)
    return keys | {"current_A": current, "frequency_hz": float(coil.frequency)}


def _start(scene: Scene) -> dict[str, Any] | None:
    keys = _said(schema.StartTable, scene.start)
    return None if keys == {"offset_mm": [0.0, 0.0, 0.1]} else keys


def shape_keys(body: Solid) -> dict[str, Any]:
    return {
        key: _all_rounded(value) if isinstance(value, np.ndarray) else _rounded(value) if key.endswith("mm") else value
        for key, value in body.keys.items()
    }


def body_keys(body: Solid) -> dict[str, Any]:
    """The keys of a body's shape, place and axes; of a part, where the origin of its file lies."""
    center = body.center + body.rotation @ body.origin if isinstance(body, Part) else body.center
    pose = {"center_mm": 1e3 * center, "rotation_deg": rotation_angles(body.rotation)}
    return shape_keys(body) | {key: _all_rounded(value) for key, value in pose.items()}


def _rounded(value: float) -> float:
    return float(f"{float(value):.14g}") + 0.0


def _all_rounded(values: Array) -> list[float]:
    scale = float(np.abs(values).max()) * SAME
    return [_rounded(value) if abs(value) > scale else 0.0 for value in values]


# What of a scene each key or table of its file decides, and how that is written from the object. Any other key decides
# the attribute of its name without the unit.
FIELDS: dict[str, tuple[tuple[str, ...], Callable[[Scene], Any]]] = {
    key: ((UNIT.sub("", key),), lambda scene, key=key: _said(schema.SceneTable, scene).get(key))
    for key in schema.SceneTable.model_fields
} | {
    "frequency_hz": (("frequency",), lambda scene: float(scene.frequency)),
    "rotor": (("rotor", "conductors", "field_map", "map_reading"), _rotor),
    "floater": (("floater", "companions"), _of_each(_floater)),
    "plate": (("plate",), _plate),
    "drag": (("drag", "floater"), _drag),
    "start": (("start", "companions"), _of_each(_start)),
    "coils": (("coils",), lambda scene: [_coil(coil) for coil in scene.coils] or None),
    "drive": (("drive",), lambda scene: [_step(step) for step in scene.drive] or None),
}


def _toml(keys: Mapping[str, Any], table: str = "") -> str:
    plain, tables = "", ""
    for key, value in keys.items():
        name = f"{table}.{key}".lstrip(".")
        if isinstance(value, Mapping) and value.keys() != WITH_TOLERANCE:
            tables += f"\n[{name}]\n{_toml(value, name)}"
        elif isinstance(value, list) and value and isinstance(value[0], Mapping) and value[0].keys() != WITH_TOLERANCE:
            tables += "".join(f"\n[[{name}]]\n{_toml(entry, name)}" for entry in value)
        else:
            plain += f"{key} = {_inline(value)}\n"
    return plain + tables


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key} = {_inline(entry)}' for key, entry in value.items())}}}"
    return f"[{', '.join(map(_inline, value))}]" if isinstance(value, list) else json.dumps(value)
