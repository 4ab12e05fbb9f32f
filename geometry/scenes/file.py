"""Reads a scene file and tells every fault of it at once."""

import logging
import os
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from .assembly import assemble
from .contents import Scene
from .faults import SceneError
from .writing import scene_keys


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
        The file is missing or unreadable, is not TOML, has unknown, missing or wrong keys, or its bodies overlap, or
        its map of the field is no file.
    """
    source = str(path)
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SceneError(source, ["Input scene must be a TOML file that exists; instead there is none."]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(source, [f"Input scene must be a readable UTF-8 text; instead: {error}."]) from None
    scene = parse_scene(text, source)
    if scene.field_map and not os.path.isfile(scene.field_map):  # unlike Path.is_file never raises
        raise SceneError(source, [f"Input rotor.field_map must be a file; instead there is no {scene.field_map}."])
    for remark in scene.remarks:
        logging.getLogger("spinlev").info(remark)
    return scene


def parse_scene(text: str, source: str = "scene", changes: Mapping[str, float] | None = None) -> Scene:
    """Build a scene from the text of a scene file.

    Parameters
    ----------
    text : str
        As in a scene file, TOML.
    source : str
        What messages call it.
    changes : dict of str to float, optional
        Numbers that replace those of the text, by key, such as `rotor.displacement_mm` or `plate.center_mm.2`.

    Returns
    -------
    Scene
        What it describes, in SI units.

    Raises
    ------
    SceneError
        As `load_scene`, also for a change that no key takes.
    """
    try:
        keys = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(source, [f"Input scene must be TOML; instead: {error}."]) from None
    for key, value in (changes or {}).items():
        _replace(keys, key, value, source)
    scene = assemble(keys, source)
    return scene if changes else replace(scene, text=text)


def changed(scene: Scene, changes: Mapping[str, float], source: str = "scene") -> Scene:
    """The scene with numbers replaced by key, as in `parse_scene`. Raises SceneError."""
    keys = scene_keys(scene)
    for key, value in changes.items():
        _replace(keys, key, value, source)
    return assemble(keys, source)


def _replace(raw: Any, key: str, value: float, source: str) -> None:
    """Put a number in the place of `key`: names of tables, and numbers of list entries from 0, joined by dots."""
    *path, last = (int(part) if part.isdecimal() else part for part in key.split("."))
    try:
        for part in path:
            raw = raw[part]
        if isinstance(last, int):
            raw[last] = value
        else:
            raw.update({last: value})
    except (KeyError, IndexError, TypeError, AttributeError):
        raise SceneError(
            source, [f"Input {key} must be a key inside the tables and lists that the scene has; instead it is not."]
        ) from None
