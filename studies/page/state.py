"""What a page is about: a scene, the models and the body spin; and the same as the text of an address."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, cast, get_args
from urllib.parse import urlencode

from ...geometry.basics import InputError, shown
from ...geometry.scenes import Scene, SceneError, assemble, changed, parse_scene, scene_keys
from ..terminal import FieldModel, Models, PlateModel, finite

QUICK: tuple[FieldModel, ...] = ("dipole", "cuboid")
"""Fields whose equilibria follow a slider at once."""
CHOICES = ("model", "plate_model", "spin")
"""Keys of an address that are none of the scene file."""
LONGEST, LARGEST = 20_000, 200_000
"""Characters of an address's state; bytes of a scene file that is opened in a page."""


@dataclass(frozen=True, eq=False)
class PageState:
    """All that decides what a page shows, but for the flight.

    Parameters
    ----------
    scene : its scene
    model : of the field
    plate_model : of the plate's currents
    spin : body spin of the equilibria
    source : the scene's file, or another name of it in messages
    first : the scene that the page began with, whose files alone another one may name; None: `scene` itself
    """

    scene: Scene
    model: FieldModel = "dipole"
    plate_model: PlateModel = "slab"
    spin: float = 0.0
    source: str = "scene"
    first: Scene | None = None

    @cached_property
    def keys(self) -> Mapping[str, Any]:
        """Of the scene file."""
        return scene_keys(self.scene)

    @property
    def models(self) -> Models:
        """As the commands take them."""
        return Models(self.model, self.plate_model)

    @property
    def whole_quickly(self) -> bool:
        """Whether the numbers that follow a slider at once are already those of the models asked for."""
        felt = self.scene.plate is not None and self.plate_model != "none"
        return self.model in QUICK and not felt

    @property
    def command(self) -> str:
        """Options of the command line that ask for the same of the scene file."""
        spin = f" --spin {self.spin:g}" if self.spin else ""
        return f"--model {self.model} --plate-model {self.plate_model}{spin}"

    def changed(self, key: str, value: float) -> Self:
        """With another number: of the scene file, by its dotted key, or `spin`. Raises SceneError."""
        if key == "spin":
            return replace(self, spin=finite("spin", value))
        return replace(self, scene=changed(self.scene, {key: value}, self.source, self.first or self.scene))

    def query(self) -> str:
        """The state as the text behind the question mark of an address."""
        parts = {"model": self.model, "plate_model": self.plate_model, "spin": json.dumps(self.spin)}
        return urlencode(parts | dict(_flat(self.keys)))

    def with_query(self, asked: Mapping[str, str]) -> Self:
        """The state of an address: of a whole scene, or one that changes what it names; its rotor or plate is whole.

        Raises
        ------
        SceneError : the scene of the address cannot be, or names a file that the first scene does not
        InputError : a model that does not exist, a spin that is no number, or more than an address may hold
        """
        if sum(len(key) + len(value) for key, value in asked.items()) > LONGEST:
            raise InputError(f"Input address must have at most {LONGEST} characters of a scene; instead it is longer.")
        given = {key: value for key, value in asked.items() if key not in CHOICES}
        scene = self._scene(given) if given else self.scene
        return replace(
            self,
            scene=scene,
            model=_choice(
                "model", asked.get("model", self.model), cast("tuple[FieldModel, ...]", get_args(FieldModel))
            ),
            plate_model=_choice("plate_model", asked.get("plate_model", self.plate_model), get_args(PlateModel)),
            spin=_spin(asked.get("spin", self.spin)),
        )

    def opened(self, content: bytes, name: str) -> Self:
        """The state in which a page shows a scene file of its reader's.

        Raises
        ------
        SceneError : the scene cannot be, or names a file that the first scene does not
        InputError : no text, or more than a page takes
        """
        if len(content) > LARGEST:
            raise InputError(f"Input scene must have at most {LARGEST} bytes in a page; instead it has {len(content)}.")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            raise SceneError(name, ["Input scene must be a readable UTF-8 text; instead it is not."]) from None
        known = self.first or self.scene
        new = first_state(parse_scene(text, name, known=known), name)
        return replace(
            self,
            scene=new.scene,
            model=new.model,
            plate_model=new.plate_model,
            spin=new.spin,
            source=name,
            first=known,
        )

    def _scene(self, given: Mapping[str, str]) -> Scene:
        keys: dict[str, Any] = scene_keys(self.scene)
        tables = {key.partition(".")[0] for key in given}
        if tables >= {"frequency_hz", "rotor", "floater"}:
            keys = {}
        for table in tables - {"floater"}:
            keys.pop(table, None)
        for key, text in given.items():
            _put(keys, key.split("."), _value(text))
        return assemble(keys, self.source, known=self.first or self.scene)


def first_state(scene: Scene, source: str = "scene") -> PageState:
    """Where a page begins: everything by what can be told at once, the plate as an infinite slab if that can be."""
    model: FieldModel = "map" if scene.field_map else "dipole"
    felt = scene.plate is not None and scene.floater.body is None
    return PageState(scene, model, "slab" if felt else "none", source=source)


def _choice(name: str, value: str, known: tuple[Any, ...]) -> Any:
    if value not in known:
        raise InputError(f"Input {name} must be one of {', '.join(known)}; instead received {shown(value)}.")
    return value


def _spin(value: str | float) -> float:
    try:
        spin = finite("spin", float(value))
    except ValueError:
        raise InputError(f"Input spin must be a number; instead received {shown(value)}.") from None
    if not -1e3 <= spin <= 1e3:
        raise InputError(f"Input spin must be between -1000 and 1000; instead received {shown(value)}.")
    return spin


def _flat(keys: Mapping[str, Any], table: str = "") -> list[tuple[str, str]]:
    """Dotted keys and their values as texts; lists stay whole."""
    found = []
    for key, value in keys.items():
        name = f"{table}.{key}".lstrip(".")
        if isinstance(value, Mapping):
            found += _flat(value, name)
        else:
            found.append((name, value if isinstance(value, str) else json.dumps(value)))
    return found


def _put(keys: Any, path: list[str], value: Any) -> None:
    """Put a value in the place of a dotted key; where a number stands in its way, the scene's check says so."""
    for part in path[:-1]:
        if not isinstance(keys.get(part), dict):
            keys[part] = {}
        keys = keys[part]
    keys[path[-1]] = value


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):  # a text, or lists in lists by the thousand
        return text
