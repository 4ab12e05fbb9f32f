"""A scene as the keys of a scene file: what is written beside a result, also of a scene that was made in Python."""

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..basics import Array, Box, Part, Ring, Solid, moved, rotation_angles
from ..bodies import Conductor, Magnet, horizontal, tilt, vertical
from .assembly import assemble, content_digest
from .contents import AbsoluteStart, Drag, OffsetStart, Plate, Scene
from .faults import SceneError
from .floater import Floater
from .shapes import shape_keys

SAME = 1e-12
"""Relative difference of numbers below which they are taken for the same."""
DEFAULT_START = {"offset_mm": [0.0, 0.0, 0.1]}


def scene_text(scene: Scene) -> str:
    """The scene file of a scene: the one that was read if it still says the same, else one written from the object."""
    return scene.text if scene.text and _says(scene.text, scene) else _toml(_keys(scene))


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
    return tomllib.loads(_toml(_keys(scene))), Path()


def scene_digest(scene: Scene) -> str:
    """SHA-256 of what a scene says and of the content of the files that it names, whatever their names are.

    Comments do not count. Of a file that was read with the scene it is the content that was read.
    """
    keys, contents = _keys(scene), [map_digest(scene)]
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
        return _keys(assemble(tomllib.loads(text), "scene", scene.folder, scene)) == _keys(scene)
    except (SceneError, tomllib.TOMLDecodeError):
        return False


def _keys(scene: Scene) -> dict[str, Any]:
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
