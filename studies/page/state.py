"""What a page is about: a scene, the models and the body spin; and the same as the text of an address."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any
from urllib.parse import urlencode

import numpy as np

from ...geometry.common import InputError
from ...geometry.scene.contents import Scene
from ...geometry.scene.files import changed, parse_scene, scene_keys, scene_text
from ...geometry.scene.making import assemble
from ...geometry.scene.messages import SceneError
from ..cli.options import SPINS, FieldModel, Models, PlateModel, check_between, finite, refused

CHOICES = ("model", "plate_model", "spin")  # Keys of an address that are none of the scene file
LONGEST, LARGEST = 20_000, 200_000  # Characters of an address's state; bytes of a scene file that is opened in a page


MEASURES = {
    "horizontal": ("displacement_mm", "Displacement (mm)", 0.0, 10.0),
    "vertical": ("displacement_mm", "Displacement (mm)", 5.0, 30.0),
    "tilt": ("angle_deg", "Tilt (°)", 0.0, 45.0),
}  # What moves a rotor of the article
PLATE_REACH = 20.0  # How far a plate whose middle is level with the rotor's can be moved, mm
SIZES = {"edge_mm": "edge (mm)", "diameter_mm": "diameter (mm)", "height_mm": "height (mm)"}  # Of rotor and floater


@dataclass(frozen=True, eq=False)
class PageState:
    """All that decides what a page shows, but for the trajectory."""

    scene: Scene
    model: FieldModel = "fem"  # of the field
    plate_model: PlateModel = "auto"  # of the plate's currents
    spin: float = 0.0  # of the body in its equilibria
    source: str = "scene"  # the scene's file, or another name of it in messages
    first: Scene | None = None  # that the page began with, whose files alone another one may name; None: `scene`

    @cached_property
    def keys(self) -> Mapping[str, Any]:
        return scene_keys(self.scene)

    @property
    def models(self) -> Models:
        return Models(self.model, self.plate_model)

    def copies(self) -> dict[str, str]:
        """What asks for the same elsewhere: a `line` about a scene file, a whole `command` of a shell, and `python`."""
        chosen = f"--model {self.model} --plate-model {self.plate_model}{f' --spin {self.spin:g}' if self.spin else ''}"
        line, text = f"spinlev equilibria scene.toml {chosen}", scene_text(self.scene)
        asked = f'model="{self.model}", plate_model="{self.plate_model}", spin={self.spin:g}'
        program = f'scene = sl.parse_scene(r"""\n{text}""")\nfound = sl.equilibria(scene, {asked})\n'
        program += 'print(found[["distance", "polar_angle", "growth", "stable"]].to_dataframe())\n'
        command = f"cat > scene.toml << 'END'\n{text}END\n{line}\n"
        return {"line": line, "command": command, "python": f"import spinlev as sl\n\n{program}"}

    def changed(self, key: str, value: float) -> "PageState":
        """With another number: of the scene file, by its dotted key, or `spin`. Raises SceneError."""
        if key == "spin":
            return replace(self, spin=finite("spin", value))
        return replace(self, scene=changed(self.scene, {key: value}, self.source, self.first or self.scene))

    def query(self) -> str:
        parts = {"model": self.model, "plate_model": self.plate_model, "spin": json.dumps(self.spin)}
        return urlencode(parts | _flat(self.keys))

    def with_query(self, asked: Mapping[str, str]) -> "PageState":
        """The state of an address: of a whole scene, or one that changes what it names; its rotor or plate is whole.

        Raises SceneError or InputError: a scene, a file, a model or a spin that cannot be, or more than an address may
        hold.
        """
        if sum(len(key) + len(value) for key, value in asked.items()) > LONGEST:
            raise InputError(f"Input address must have at most {LONGEST} characters of a scene; instead it is longer.")
        chosen: dict[str, Any] = {key: asked.get(key, getattr(self, key)) for key in CHOICES}
        Models(chosen["model"], chosen["plate_model"]).checked()
        try:
            spin = finite("spin", float(chosen["spin"]))
        except ValueError:
            raise refused("spin", "be a number", chosen["spin"]) from None
        check_between("spin", spin, SPINS)
        if not (given := {key: value for key, value in asked.items() if key not in CHOICES}):
            return replace(self, **{**chosen, "spin": spin})
        tables = {key.partition(".")[0] for key in given}
        whole = tables >= {"frequency_hz", "rotor", "floater"}
        kept = {} if whole else {k: v for k, v in scene_keys(self.scene).items() if k == "floater" or k not in tables}
        for key, text in given.items():
            _put(kept, key.split("."), text)
        scene = assemble(kept, self.source, known=self.first or self.scene)
        return replace(self, scene=scene, **{**chosen, "spin": spin})

    def opened(self, content: bytes, name: str) -> "PageState":
        """The state in which a page shows a scene file of its reader's. Raises as `with_query`."""
        if len(content) > LARGEST:
            raise InputError(f"Input scene must have at most {LARGEST} bytes in a page; instead it has {len(content)}.")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            raise SceneError(name, ["Input scene must be a readable UTF-8 text; instead it is not."]) from None
        known = self.first or self.scene
        return replace(first_state(parse_scene(text, name, known=known), name), first=known)


def first_state(scene: Scene, source: str = "scene") -> PageState:
    """Where a page begins: finite elements, or the scene's map of the field, and the plate as the commands take it."""
    model: FieldModel = "map" if scene.field_map else "fem"
    return PageState(scene, model, "none" if scene.plate is None else "auto", source=source)


def _flat(keys: Mapping[str, Any], table: str = "") -> dict[str, str]:
    """Values as texts by dotted keys; lists stay whole."""
    found = dict[str, str]()
    for key, value in keys.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{table}{key}.")
        else:
            found[f"{table}{key}"] = value if isinstance(value, str) else json.dumps(value)
    return found


def _put(keys: Any, path: list[str], text: str) -> None:
    """Put a value in the place of a dotted key; where a number stands in its way, the scene's check says so."""
    for part in path[:-1]:
        if not isinstance(keys.get(part), dict):
            keys[part] = {}
        keys = keys[part]
    try:
        keys[path[-1]] = json.loads(text)
    except (ValueError, RecursionError):  # a text, or lists in lists by the thousand
        keys[path[-1]] = text


@dataclass(frozen=True)
class Control:
    """A number that a slider moves; `name` is its key in the scene file, or `spin`."""

    name: str
    title: str
    value: float
    start: float
    end: float
    step: float


def controls(state: PageState) -> list[Control]:
    scene, rotor, floater = state.scene, state.keys["rotor"], state.keys["floater"]
    rows: list[tuple[str, str, float, float, float, float]]
    rows = [("frequency_hz", "Frequency (Hz)", scene.frequency, 20.0, 300.0, 0.5)]
    if (kind := rotor.get("configuration")) in MEASURES:
        key, title, low, high = MEASURES[kind]
        low = max(low, 1e3 * float(scene.rotor[0].body.size[2])) if kind == "vertical" else low  # they touch
        rows.append((f"rotor.{key}", title, rotor[key], low, high, 0.05))
        rows += [(f"rotor.{k}", f"Rotor's {of}", rotor[k], 3.0, 20.0, 0.05) for k, of in SIZES.items() if k in rotor]
    rows += [(f"floater.{k}", f"Floater's {v}", floater[k], 3.0, 30.0, 0.05) for k, v in SIZES.items() if k in floater]
    for k, size in enumerate(floater.get("size_mm", ())):
        rows.append((f"floater.size_mm.{k}", f"Floater's edge along its {'xyz'[k]} (mm)", size, 3.0, 30.0, 0.05))
    rows.append(("spin", "Body spin S", state.spin, -2.0, 2.0, 0.01))
    if scene.plate is not None:
        box = scene.plate.box
        axis = int(np.abs(box.rotation[:, int(np.argmin(box.size))]).argmax())  # along which it is thin
        first, several = ("plate.0", True) if isinstance(state.keys["plate"], list) else ("plate", False)
        place = (state.keys["plate"][0] if several else state.keys["plate"])["center_mm"][axis]
        near, far = sorted((0.4 * place, 2.5 * place)) if place else (-PLATE_REACH, PLATE_REACH)
        title = ("Plate, x (mm)", "Plate, y (mm)", "Plate's height (mm)")[axis]
        rows.append((f"{first}.center_mm.{axis}", title, place, near, far, 0.25))
    found = []
    for key, title, value, low, high, step in rows:  # each range has room for its value
        start, end = np.floor(min(low, value) / step) * step, np.ceil(max(high, value) / step) * step
        found.append(Control(key, title, float(value), round(float(start), 6), round(float(end), 6), step))
    return found
