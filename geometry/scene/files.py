"""A scene as the keys of a scene file: what is written beside a result, also of a scene that was made in Python."""

import hashlib
import json
import logging
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..common import Array, InputError, shown
from ..files import file_content, regular_file
from ..magnets import Magnet
from ..rotor import Conductor, horizontal, tilt, vertical
from ..shapes import Box, Ring, rotation_angles
from ..solids import Part, Solid, moved
from .contents import AbsoluteStart, Drag, Floater, OffsetStart, Plate, Scene
from .making import Table, assemble, content_digest
from .messages import SceneError
from .schema import shape_keys

SAME = 1e-12
"""Relative difference of numbers below which they are taken for the same."""
DEFAULT_START = {"offset_mm": [0.0, 0.0, 0.1]}


def scene_text(scene: Scene) -> str:
    """The scene file of a scene: the one that was read if it still says the same, else one written from the object."""
    return scene.text if scene.text and _says(scene.text, scene) else _toml(_written_keys(scene))


def startless_text(scene: Scene) -> str:
    """The scene file of a scene as if it did not say where a flight begins: the same for all flights of one scene."""
    return scene_text(replace(scene, start=OffsetStart()))


def scene_keys(scene: Scene) -> dict[str, Any]:
    """The keys of a scene file that describe a scene, as tables within tables."""
    return tomllib.loads(scene_text(scene))


def keys_and_folder(scene: Scene) -> tuple[dict[str, Any], Path]:
    """The keys that describe a scene, those of its file if it still says so, and where the files lie they name."""
    if scene.text and _says(scene.text, scene):
        return tomllib.loads(scene.text), scene.folder
    return tomllib.loads(_toml(_written_keys(scene))), Path()


def scene_digest(scene: Scene) -> str:
    """SHA-256 of what a scene says and of the content of the files that it names, whatever their names are.

    Comments do not count. Of a file that was read with the scene it is the content that was read.
    """
    keys, contents = _written_keys(scene), [map_digest(scene)]
    keys["rotor"].pop("field_map", None)
    for magnet, body in zip(keys["rotor"].get("magnets", ()), (m.body for m in scene.rotor), strict=False):
        if magnet.pop("file", None):
            contents.append(str(body.shape_numbers.tolist()))
    return hashlib.sha256(json.dumps([keys, contents], sort_keys=True).encode()).hexdigest()


def map_digest(scene: Scene) -> str:
    """SHA-256 of the content of a scene's map of the field; empty where it has none."""
    path = scene.field_map
    return "" if path is None else dict(scene.files).get(str(path)) or content_digest(path)


def _says(text: str, scene: Scene) -> bool:
    """Whether a scene file describes this scene; the folder of its files is not in the file, and none is opened."""
    try:
        return _written_keys(assemble(tomllib.loads(text), "scene", scene.folder, scene)) == _written_keys(scene)
    except (SceneError, tomllib.TOMLDecodeError):
        return False


def _written_keys(scene: Scene) -> dict[str, Any]:
    keys: dict[str, Any] = {
        "frequency_hz": _number(scene.frequency),
        "gravity_m_s2": _numbers(scene.gravity),
        "rotor": _rotor(scene.rotor) | _field_map(scene),
        "floater": _floater(scene.floater),
    }
    if scene.conductors:
        keys["rotor"]["conductors"] = [_conductor(conductor) for conductor in scene.conductors]
    if scene.plate:
        keys["plate"] = _plate(scene.plate)
    stokes = Drag.of(scene.floater)
    if scene.drag == replace(stokes, air=True):
        keys["drag"] = {"model": "air"}
    elif scene.drag != stokes:
        keys["drag"] = {"linear_N_s_m": scene.drag.linear, "angular_N_m_s": scene.drag.angular}
    start = _start(scene)
    return keys if start == DEFAULT_START else keys | {"start": start}


def _field_map(scene: Scene) -> dict[str, str]:
    told = {f"map_{name}": value for name, value in asdict(scene.map_reading).items() if value is not None}
    return ({"field_map": str(scene.field_map)} if scene.field_map else {}) | told


def _floater(floater: Floater) -> dict[str, Any]:
    shape = {"shape": floater.shape} if floater.body else {}
    keys = {
        **_shape(floater.solid),
        **shape,
        "remanence_T": _number(floater.remanence),
        "recoil_permeability": _number(floater.recoil_permeability),
        "density_kg_m3": _number(floater.density),
    }
    if not floater.body:
        del keys["shape"]
    return keys if floater.conductivity is None else keys | {"conductivity_S_m": _number(floater.conductivity)}


def _rotor(rotor: tuple[Magnet, ...]) -> dict[str, Any]:
    """A rotor of the article by its name if its magnets conduct alike, any other as its magnets."""
    first = rotor[0]
    body = moved(first.body, np.zeros(3), np.eye(3))
    remanence = float(np.linalg.norm(first.polarization))
    material = (body, remanence, first.recoil_permeability, first.transverse_permeability)
    x, _, z = rotor[-1].body.center
    angle = float(np.arctan2(first.polarization_in_rotor[2], first.polarization_in_rotor[0]))
    known = {
        ("horizontal", "displacement_mm", _milli(x)): horizontal(float(x), *material),
        ("vertical", "displacement_mm", _milli(z)): vertical(float(z), *material),
        ("tilt", "angle_deg", _number(float(np.degrees(angle)))): tilt(angle, *material),
    }
    for (configuration, key, value), like in known.items():
        alike = len(like) == len(rotor) and len({(m.conductivity, m.coercivity) for m in rotor}) == 1
        alike &= not (isinstance(body, Box) and np.ptp(body.size)) and not isinstance(body, Ring | Part)
        if alike and all(map(_same, like, rotor)) and value >= (0 if key != "angle_deg" else -90):
            return {
                "configuration": configuration,
                key: value,
                **_article_shape(body),
                "remanence_T": _number(remanence),
                "recoil_permeability": _permeability(first),
                **_optional(first),
            }
    return {"magnets": [_magnet(magnet) for magnet in rotor]}


def _article_shape(body: Solid) -> dict[str, Any]:
    return {"edge_mm": _milli(body.size[0])} if isinstance(body, Box) else _shape(body)


def _shape(body: Solid) -> dict[str, Any]:
    """A shape's keys in millimetres."""
    return {
        key: value if isinstance(value, str) else _millis(value) if np.ndim(value) else _milli(value)
        for key, value in shape_keys(body).items()
    }


def _same(one: Magnet, other: Magnet) -> bool:
    return type(one.body) is type(other.body) and bool(np.allclose(_parts(one), _parts(other), rtol=SAME, atol=1e-14))


def _parts(magnet: Magnet) -> Array:
    body = magnet.body
    turned = (body.rotation, magnet.permeability_in_rotor)
    return np.concatenate(
        [body.shape_numbers, body.center, magnet.polarization, *(matrix.ravel() for matrix in turned)]
    )


def _magnet(magnet: Magnet) -> dict[str, Any]:
    return {
        **_shape(magnet.body),
        **_pose(_at_its_origin(magnet.body)),
        "polarization_T": _numbers(magnet.polarization),
        "recoil_permeability": _permeability(magnet),
        **_optional(magnet),
    }


def _at_its_origin(body: Solid) -> Solid:
    """A part with the origin of its file for its middle, as a scene file places it."""
    return moved(body, body.center + body.rotation @ body.origin) if isinstance(body, Part) else body


def _optional(magnet: Magnet) -> dict[str, float]:
    found = {} if magnet.conductivity is None else {"conductivity_S_m": _number(magnet.conductivity)}
    return found if magnet.coercivity is None else found | {"coercivity_kA_m": _number(magnet.coercivity / 1e3)}


def _conductor(conductor: Conductor) -> dict[str, Any]:
    body, conductivity = conductor.body, {"conductivity_S_m": _number(conductor.conductivity)}
    return {"shape": "cuboid"} | _shape(body) | _pose(body) | conductivity


def _permeability(magnet: Magnet) -> float | list[float]:
    across = magnet.transverse_permeability
    return magnet.recoil_permeability if magnet.isotropic else [magnet.recoil_permeability, float(across or 1.0)]


def _plate(plate: Plate) -> dict[str, Any]:
    keys, down = {**_box(plate.box), "conductivity_S_m": _number(plate.conductivity)}, plate.lowering
    if not down:
        return keys
    way = {"start_s": _number(down.start), "speed_mm_s": _milli(down.speed), "distance_mm": _milli(down.distance)}
    return {**keys, "lowering": way}


def _start(scene: Scene) -> dict[str, Any]:
    start = scene.start
    if not isinstance(start, AbsoluteStart):
        return {"offset_mm": _millis(start.offset)}
    return {
        "position_mm": _millis(start.position),
        "velocity_mm_s": _millis(start.velocity),
        "moment": _numbers(start.moment),
        "spin_hz": _numbers(start.spin / (2 * np.pi)),
    }


def _box(box: Box) -> dict[str, Any]:
    return {"size_mm": _millis(box.size), **_pose(box)}


def _pose(body: Solid) -> dict[str, Any]:
    return {"center_mm": _millis(body.center), "rotation_deg": _numbers(rotation_angles(body.rotation))}


def _number(value: float) -> float:
    """A number without the round-off of its way through SI units."""
    return float(f"{float(value):.14g}") + 0.0


def _milli(value: float) -> float:
    return _number(1e3 * value)


def _numbers(values: Array) -> list[float]:
    scale = float(np.abs(values).max()) * SAME
    return [_number(value) if abs(value) > scale else 0.0 for value in values]


def _millis(values: Array) -> list[float]:
    return _numbers(1e3 * np.asarray(values))


def _toml(keys: Mapping[str, Any], table: str = "") -> str:
    """Keys as TOML: numbers and texts first, then tables, then lists of tables."""
    plain, tables = "", ""
    for key, value in keys.items():
        name = f"{table}.{key}".lstrip(".")
        if isinstance(value, Mapping):
            tables += f"\n[{name}]\n{_toml(value, name)}"
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            tables += "".join(f"\n[[{name}]]\n{_toml(entry, name)}" for entry in value)
        else:
            plain += f"{key} = {json.dumps(value)}\n"
    return plain + tables


MOST = 5_000_000
"""Bytes of a scene file; one with a thousand magnets has 200 000."""
MOST_OF_MAP = 1_000_000_000
"""Bytes of a map of the field."""
LONGEST_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')[ \t]*\.[ \t]*){20}""")
"""A dotted key of so many parts: reading it takes time and memory that grow with their square."""
DECIMAL_COMMA = re.compile(r"(?m)^[^#\n\[]*=\s*[-+]?\d+,\s*\d")


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
        text = file_content(path, MOST, "scene", "a TOML file").decode("utf-8-sig")
        scene = parse_scene(text.replace("\r\n", "\n").replace("\r", "\n"), source)
        if scene.field_map:
            regular_file(scene.field_map, MOST_OF_MAP, "rotor.field_map", "a map of the field").close()
    except UnicodeDecodeError as error:
        raise SceneError(source, [f"Input scene must be a text in UTF-8; instead: {error}."]) from None
    except SceneError:
        raise
    except InputError as error:
        raise SceneError(source, [str(error)]) from None
    for remark in scene.remarks:
        logging.getLogger("spinlev").info(remark)
    return scene


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
    scene = assemble(keys, source, known=known)
    return scene if changes else replace(scene, text=text)


def _keys(text: str, source: str) -> dict[str, Any]:
    """The tables of a text, of which TOML's parser survives the reading."""
    if LONGEST_KEY.search(text):
        raise SceneError(source, ["Input key must have fewer than 20 parts; instead there is one with more."])
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        point = " Decimals have a point, lists square brackets." if DECIMAL_COMMA.search(text) else ""
        raise SceneError(source, [f"Input scene must be TOML; instead: {str(error)[:200]}.{point}"]) from None
    except RecursionError:
        raise SceneError(
            source, ["Input scene must be TOML with few lists in each other; instead some are nested too deep."]
        ) from None
    except ValueError:  # Python's own limit
        raise SceneError(
            source, ["Input scene must have numbers of a few digits; instead one has thousands."]
        ) from None


def changed(scene: Scene, changes: Mapping[str, float], source: str = "scene", known: Scene | None = None) -> Scene:
    """The scene with numbers replaced by key, as in `parse_scene`.

    Raises
    ------
    SceneError : as there, or a file that the scene names has another content than when the scene was read
    """
    keys, folder = keys_and_folder(scene)
    for key, value in changes.items():
        _replace(keys, key, value, source)
    found = assemble(keys, source, folder, known)
    before = dict(scene.files)
    for path, digest in found.files:
        if before.get(path, digest) != digest:
            raise _replaced(path, digest, source)
    return found


def check_files(scene: Scene, source: str = "scene") -> None:
    """Raise SceneError if a file that a scene names has another content than when the scene was read."""
    for path, digest in scene.files:
        if (found := content_digest(Path(path))) != digest:
            raise _replaced(path, found, source)


def _replaced(path: str, digest: str, source: str) -> SceneError:
    instead = "its content is another one" if digest else "it cannot be read any more"
    return SceneError(
        source,
        [
            f"Input {path} must stay as it was when the scene was read; instead {instead}. Begin again, and what needs "
            "the file is computed anew."
        ],
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


DEEPEST = 10
"""Tables and lists in each other; a scene has five."""
LARGEST = 2**1000
"""Integers below it are floats."""


def scene(
    *,
    frequency_hz: float,
    rotor: Table,
    floater: Table,
    plate: Table | None = None,
    gravity_m_s2: Sequence[float] = (0.0, 0.0, -9.81),
    drag: Table | None = None,
    start: Table | None = None,
) -> Scene:
    """A scene from the tables of a scene file; the object itself is in SI units.

    Parameters
    ----------
    frequency_hz : float
        Turns of the rotor per second about +z, Hz.
    rotor : dict
        `horizontal`, `vertical`, `tilt`, `magnets`, or a mapping with the same keys.
    floater : dict
        `sphere`, or a mapping with shape "cuboid" (and size_mm) or "cylinder" (and diameter_mm, height_mm).
    plate : dict, optional
        `plate`; left out, none.
    gravity_m_s2 : sequence of 3 floats
        In the laboratory frame, m/s².
    drag : dict, optional
        "model" ("stokes", or "air": what a real sphere feels at its Reynolds number and frequency), or "linear_N_s_m"
        and "angular_N_m_s"; left out, Stokes drag in air.
    start : dict, optional
        "offset_mm" from the stable equilibrium, or "position_mm" with "velocity_mm_s", "moment" and "spin_hz"; left
        out, 0.1 mm above the stable equilibrium.

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
    keys = {"frequency_hz": frequency_hz, "gravity_m_s2": gravity_m_s2, "rotor": rotor, "floater": floater}
    keys |= {name: table for name, table in (("plate", plate), ("drag", drag), ("start", start)) if table is not None}
    return assemble(_plain(keys), "scene")


def _plain(value: Any, depth: int = 0) -> Any:
    """Tuples and arrays as lists, NumPy's numbers and integers as floats: as a scene file has them.

    What is deeper than any scene, or too large for a float, is left as it is: the schema refuses it.
    """
    if depth > DEEPEST:
        return value
    if isinstance(value, Mapping):
        return {str(key): _plain(item, depth + 1) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist(), depth + 1)
    if isinstance(value, list | tuple):
        return [_plain(item, depth + 1) for item in value]
    whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < LARGEST
    return float(value) if whole else value
