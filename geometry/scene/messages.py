"""What is wrong with a scene, in one grammar: Input KEY must be RULE; instead received VALUE."""

import difflib
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from pydantic import BaseModel
from pydantic_core import ErrorDetails

from ..common import InputError, printable, shown
from ..overlap import TOUCHING, apart, body_overlap, deepest_overlap_in_a_turn
from ..scene import schema
from ..solids import Solid
from .contents import AbsoluteStart, Scene

ROTORS: dict[str, type[BaseModel]] = {
    "horizontal": schema.HorizontalRotor,
    "vertical": schema.VerticalRotor,
    "tilt": schema.TiltRotor,
    "magnets": schema.ExplicitRotor,
}
TABLES: dict[str, type[BaseModel]] = {
    "magnets": schema.MagnetSection,
    "conductors": schema.ConductorSection,
    "floater": schema.FloaterSection,
    "plate": schema.PlateSection,
    "lowering": schema.LoweringSection,
    "drag": schema.DragSection,
    "start": schema.StartSection,
}
LONGEST = 60
"""Characters of a key in a message."""
LONGEST_SOURCE = 300
"""Characters of a file's name in a message."""
MOST = 20
"""Faults of a scene that are told; the rest are counted."""
RULES = {
    "greater_than": "greater than {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than_equal": "at most {le:g}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "list_type": "a list",
    "literal_error": "{expected}",
    "too_short": "a list of {min_length} or more entries",
    "too_long": "a list of {max_length} entries",
    "model_type": "a table",
    "model_attributes_type": "a table",
}


class SceneError(InputError):
    """A scene file that cannot be used; `faults` lists everything that is wrong with it."""

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        source = printable(source).replace("\n", "\\n")
        if len(source) > LONGEST_SOURCE:
            source = f"…{source[-LONGEST_SOURCE:]}"
        told = [f"{source}: {fault}" for fault in self.faults[:MOST]]
        more = len(self.faults) - len(told)
        super().__init__("\n".join([*told, f"{source}: and {more} more faults."] if more else told))


def describe_fault(detail: ErrorDetails) -> str:
    """One fault found by the schema, as a sentence that says what to do."""
    place, kind, received = list(detail["loc"]), detail["type"], detail["input"]
    tag = place.pop(1) if place[0] == "rotor" and len(place) > 2 else None
    key = "".join(f"[{p}]" if isinstance(p, int) else f".{_named(p)}" for p in place).removeprefix(".")
    if kind == "extra_forbidden":
        return f"Input {key} must be a known key; {_allowed(place, tag)}."
    if kind == "missing":
        return f"Input {key} must be given; instead it is missing."
    if kind.startswith("union_tag"):
        configuration = received.get("configuration") if isinstance(received, dict) else received
        return (
            "Input rotor.configuration must be one of 'horizontal', 'vertical', 'tilt' (or rotor.magnets a list of "
            f"magnets); instead received {shown(configuration)}."
        )
    if place[-1] == "recoil_permeability" or place[-2:-1] == ["recoil_permeability"]:
        rule = RULES.get(kind, detail["msg"]).format(**detail.get("ctx", {}))
        if kind in ("too_short", "too_long"):
            rule = "a number, or two: along the easy axis and across it"
        return f"Input {key.removesuffix('[0]')} must be {rule}; instead received {shown(received)}."
    if kind in ("too_short", "too_long") and place[-1] != "magnets":
        return f"Input {key} must be a list of exactly 3 numbers; instead received {shown(received)}."
    if kind == "float_type" and isinstance(received, int) and not isinstance(received, bool):
        kind = "finite_number"  # no float is so large
    rule = RULES.get(kind, detail["msg"]).format(**detail.get("ctx", {}))
    return f"Input {key} must be {rule}; instead received {shown(received)}."


def _named(key: str) -> str:
    """A key as it stands in the file: in quotes where TOML wants them, and letters that look like others escaped."""
    plain = key.isascii() and key.replace("_", "").replace("-", "").isalnum() and len(key) <= LONGEST
    escaped = key[:LONGEST].encode("unicode_escape").decode() + ("..." if len(key) > LONGEST else "")
    return key if plain else repr(key) if key.isascii() and len(key) <= LONGEST else f'"{escaped}"'


def _allowed(place: list[Any], tag: Any) -> str:
    """The keys allowed beside an unknown one, the likeliest first."""
    names = [p for p in place[:-1] if isinstance(p, str)]
    if not names:
        table: type[BaseModel] = schema.SceneSection
    elif names[-1] == "rotor":
        table = ROTORS[tag]
    else:
        table = TABLES[names[-1]]
    keys = list(table.model_fields)
    close = difflib.get_close_matches(str(place[-1])[:LONGEST], keys, n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    return f"{hint}allowed are {', '.join(keys)}"


def overlap_faults(scene: Scene) -> list[str]:
    """Every overlap of the scene's bodies as a message with its depth; empty if there is none.

    The plate is checked against the rotor over a whole turn; touching is allowed.
    """
    bodies = named_bodies(scene)
    faults = [
        f"Input rotor must have magnets and conductors that do not overlap; instead {first} and {second} overlap by "
        f"{depth * 1e3:.4g} mm; move them apart by as much."
        for (first, one), (second, other) in combinations(bodies, 2)
        if not apart(one, other) and (depth := body_overlap(one, other)) > TOUCHING
    ]
    if scene.plate:
        for name, body in bodies:
            depth = deepest_overlap_in_a_turn(body, scene.plate.box)
            if depth > TOUCHING:
                faults.append(
                    f"Input plate must stay clear of the turning rotor; instead it overlaps {name} by "
                    f"{depth * 1e3:.4g} mm; move the plate away or make it thinner."
                )
    if isinstance(scene.start, AbsoluteStart):
        faults += _start_overlaps(scene, scene.start)
    return faults


def named_bodies(scene: Scene) -> list[tuple[str, Solid]]:
    """Magnets and conductors with the words that messages have for them."""
    magnets = [(f"magnet {i + 1}", magnet.body) for i, magnet in enumerate(scene.rotor)]
    return [*magnets, *((f"conductor {i + 1}", part.body) for i, part in enumerate(scene.conductors))]


def _start_overlaps(scene: Scene, start: AbsoluteStart) -> list[str]:
    bodies = [(f"rotor {name}", body) for name, body in named_bodies(scene)]
    if scene.plate:
        bodies.append(("the plate", scene.plate.box))
    place = ", ".join(f"{c * 1e3:g}" for c in start.position)
    floater = scene.floater.placed(start.position, start.moment / np.linalg.norm(start.moment))
    depths = [(name, body_overlap(box, floater)) for name, box in bodies]
    return [
        f"Input start.position_mm must leave the floater clear of all bodies; instead received [{place}], where it "
        f"overlaps {name} by {depth * 1e3:.4g} mm."
        for name, depth in depths
        if depth > TOUCHING
    ]
