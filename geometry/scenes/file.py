"""Reads a scene file and tells every fault of it at once."""

import logging
import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..basics import InputError, file_content, regular_file, shown
from .assembly import assemble, content_digest
from .contents import Scene
from .faults import SceneError
from .writing import keys_and_folder

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
