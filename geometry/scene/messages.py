"""Faults of a scene, in one grammar: Input KEY must be RULE; instead received VALUE."""

import difflib
import re
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from pydantic_core import ErrorDetails

from ..common import InputError, printable, shown
from ..overlap import TOUCHING, apart, body_overlap, deepest_overlap_in_a_turn
from . import schema
from .contents import AbsoluteStart, Scene
from .schema import ExplicitRotor

LONGEST = 60  # Characters of a key in a message
LONGEST_SOURCE = 300  # Characters of a file's name in a message
# Beyond these a scene is unusual: remanence, T, and sizes of magnets and floater, m
STRONGEST, SIZES = 2.0, (1e-4, 1.0)
# In the text of a scene file: a table or one of a list of tables, and a key; and the key that a fault is about.
HEADER, KEY = re.compile(r"\s*(\[\[?)\s*([\w.-]+)\s*\]"), re.compile(r"\s*([\w.-]+)\s*=")
NAMED = re.compile(r"(?:unknown key `|Input )([\w.\[\]-]+)")
COMMA = re.compile(r"[-+]?\d+,\d+")  # a number as many languages write it
MOST = 20  # Faults of a scene that are listed; the rest are counted
# By their keys; rotors by their configuration, but for that of `rotor.magnets`.
TABLES: dict[str, type[schema.Table]] = {
    "": schema.SceneTable,
    "horizontal": schema.DisplacedRotor,
    "vertical": schema.DisplacedRotor,
    "tilt": schema.TiltRotor,
    "magnets": schema.MagnetTable,
    "conductors": schema.ConductorTable,
    "floater": schema.FloaterTable,
    "floater.magnets": schema.FloaterMagnetTable,
    "bodies": schema.BallastTable,
    "plate": schema.PlateTable,
    "lowering": schema.LoweringTable,
    "coils": schema.CoilTable,
    "drag": schema.DragTable,
    "start": schema.StartTable,
    "drive": schema.DriveTable,
}
# The kinds of error of pydantic.
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
    """A scene file that cannot be used.

    Parameters
    ----------
    source : what messages call it
    faults : everything that is wrong
    text : of the file, if it is given, in which the lines of keys are found
    """

    def __init__(self, source: str, faults: Sequence[str], text: str = "") -> None:
        self.faults = tuple(faults)
        lines = lines_of_keys(text)
        source = printable(source).replace("\n", "\\n")
        if len(source) > LONGEST_SOURCE:
            source = f"…{source[-LONGEST_SOURCE:]}"
        listed = [f"{source}: {_with_line(fault, lines)}" for fault in self.faults[:MOST]]
        more = len(self.faults) - len(listed)
        super().__init__("\n".join([*listed, f"{source}: and {more} more faults."] if more else listed))


def lines_of_keys(text: str) -> dict[str, int]:
    """Line, from 1, of each key and table of a scene file's `text`, as messages name them, `rotor.magnets[0].file`."""
    lines, table, count = dict[str, int](), "", dict[str, int]()
    for number, line in enumerate(text.splitlines(), 1):
        if header := HEADER.match(line):
            table = header[2]
            if header[1] == "[[":
                count[table] = count.get(table, -1) + 1
                table = f"{table}[{count[table]}]"
            lines.setdefault(table, number)
        elif key := KEY.match(line):
            lines.setdefault(f"{table}.{key[1]}".removeprefix("."), number)
    return lines


def _with_line(fault: str, lines: dict[str, int]) -> str:
    """A `fault` with the line of its key, or else of the table in which it is."""
    named = NAMED.match(fault)
    key = named[1] if named else ""
    while key and key not in lines:
        key = key[: max(key.rfind("."), key.rfind("["), 0)]
    if not key:
        return fault
    end = fault.endswith(".")
    return f"{fault.removesuffix('.')} (line {lines[key]}){'.' if end else ''}"


def described_faults(details: Sequence[ErrorDetails]) -> list[str]:
    """The faults found by the schema, as sentences that say what to do.

    A mistyped key is one fault: that the key it was meant for is missing is not said beside it.
    """
    unknown = [detail["loc"] for detail in details if detail["type"] == "extra_forbidden"]
    meant = {(*place[:-1], close) for place in unknown for close in _close(place)}
    return [_described(detail) for detail in details if detail["type"] != "missing" or detail["loc"] not in meant]


def _described(detail: ErrorDetails) -> str:
    place, kind, received = list(detail["loc"]), detail["type"], detail["input"]
    if place[0] in ("rotor", "plate") and len(place) > 2:
        del place[1]  # the tag of its kind
    key = "".join(f"[{p}]" if isinstance(p, int) else f".{_named(p)}" for p in place).removeprefix(".")
    if kind == "extra_forbidden":
        close = _close(detail["loc"])
        hint = f"did you mean `{close[0]}`?" if close else f"allowed are {', '.join(_allowed(detail['loc']))}"
        return f"unknown key `{key}` ({hint})"
    if kind == "missing":
        return f"Input {key} must be given; instead it is missing."
    if kind.startswith("union_tag"):
        configuration = received.get("configuration") if isinstance(received, dict) else received
        return (
            "Input rotor.configuration must be one of 'horizontal', 'vertical', 'tilt' (or rotor.magnets a list of "
            f"magnets); instead received {shown(configuration)}."
        )
    if kind == "float_type" and isinstance(received, int) and not isinstance(received, bool):
        kind = "finite_number"  # no float is so large
    rule = RULES.get(kind, detail["msg"]).format(**detail.get("ctx", {}))
    if kind == "float_type" and isinstance(received, str) and COMMA.fullmatch(received.strip()):
        rule = "a number with a decimal point, not a comma"
    if "recoil_permeability" in place[-2:]:
        key = key.removesuffix("[0]")
        rule = "a number, or two: along the easy axis and across it" if kind in ("too_short", "too_long") else rule
    elif kind in ("too_short", "too_long") and place[-1] != "magnets":
        rule = "a list of exactly 3 numbers"
    return f"Input {key} must be {rule}; instead received {shown(received)}."


def _named(key: str) -> str:
    """A key as it stands in the file: in quotes where TOML wants them, and letters that look like others escaped."""
    plain = key.isascii() and key.replace("_", "").replace("-", "").isalnum() and len(key) <= LONGEST
    escaped = key[:LONGEST].encode("unicode_escape").decode() + ("..." if len(key) > LONGEST else "")
    return key if plain else repr(key) if key.isascii() and len(key) <= LONGEST else f'"{escaped}"'


def _allowed(place: Sequence[Any]) -> list[str]:
    """The keys allowed beside the one at a place of pydantic's."""
    if len(place) == 3 and place[:2] == ("rotor", "magnets"):
        return list(ExplicitRotor.model_fields)
    if place[0] == "plate":
        return list(TABLES["lowering" if "lowering" in place[1:-1] else "plate"].model_fields)
    if len(place) == 4 and place[:2] == ("floater", "magnets"):
        return list(TABLES["floater.magnets"].model_fields)
    return list(TABLES[next((p for p in reversed(place[:-1]) if isinstance(p, str)), "")].model_fields)


def _close(place: Sequence[Any]) -> list[str]:
    """The key that an unknown one was likely meant for, if there is one."""
    return difflib.get_close_matches(str(place[-1])[:LONGEST], _allowed(place), n=1)


def unusual(scene: Scene) -> str:
    """A sentence about polarisations, sizes and distances that no magnet of a laboratory has; empty if all are usual.

    Mistaken units are most often the cause: all keys name theirs.
    """
    strongest = max([scene.floater.remanence, *(float(np.linalg.norm(one.polarization)) for one in scene.rotor)])
    sizes = [2 * scene.floater.radius, *(edge for one in scene.rotor for edge in one.box.size)]
    farthest = max((float(np.linalg.norm(one.body.center)) for one in scene.rotor), default=0.0)
    said = [f"a remanence of {strongest:.4g} T (NdFeB has up to 1.5 T)"] if strongest > STRONGEST else []
    said += [f"a size of {1e3 * size:.4g} mm" for size in (min(sizes), max(sizes)) if not SIZES[0] < size < SIZES[1]]
    said += [f"a magnet {farthest:.4g} m from the rotor's origin"] if farthest > SIZES[1] else []
    others = [("plate", body.center) for body in scene.plate.body.placed] if scene.plate else []
    others += [("start", scene.start.position)] if isinstance(scene.start, AbsoluteStart) else []
    for name, place in others:
        said += [f"a {name} {apart:.4g} m from the rotor"] if (apart := float(np.linalg.norm(place))) > SIZES[1] else []
    return f"Unusual: {', '.join(dict.fromkeys(said))}. Is that meant? Every key names its unit." if said else ""


def overlap_faults(scene: Scene) -> list[str]:
    """Every overlap of the scene's bodies as a message with its depth; empty if there is none.

    The plate is checked against the rotor over a whole turn; touching is allowed.
    """
    bodies = [(f"magnet {i}", magnet.body) for i, magnet in enumerate(scene.rotor, 1)]
    bodies += [(f"conductor {i}", part.body) for i, part in enumerate(scene.conductors, 1)]
    faults = [
        f"Input rotor must have magnets and conductors that do not overlap; instead {first} and {second} overlap by "
        f"{depth * 1e3:.4g} mm; move them apart by as much."
        for (first, one), (second, other) in combinations(bodies, 2)
        if not apart(one, other) and (depth := body_overlap(one, other)) > TOUCHING
    ]
    metal = scene.plate.body.placed if scene.plate else ()
    plates = [("plate" if len(metal) == 1 else f"plate[{k}]", body) for k, body in enumerate(metal)]
    faults += [
        f"Input {plate} must stay clear of the turning rotor; instead it overlaps {name} by "
        f"{depth * 1e3:.4g} mm; move the plate away or make it thinner."
        for plate, fixed in plates
        for name, body in bodies
        if (depth := deepest_overlap_in_a_turn(body, fixed)) > TOUCHING
    ]
    faults += [
        f"Input {second} must be apart from {first}, as currents of bodies that touch are not computed; instead "
        f"they {f'overlap by {depth * 1e3:.4g} mm' if depth > TOUCHING else 'touch'}; give them as one file."
        for (first, one), (second, other) in combinations(plates, 2)
        if (depth := body_overlap(one, other)) > -TOUCHING
    ]
    if isinstance(start := scene.start, AbsoluteStart):
        axes = scene.floater.axes(start.moment / np.linalg.norm(start.moment), start.body_x)
        floater = scene.floater.placed(start.position, axes)
        obstacles = [(f"rotor {name}", body) for name, body in bodies]
        obstacles += [("the plate" if len(plates) == 1 else name, body) for name, body in plates]
        place = ", ".join(f"{c * 1e3:g}" for c in start.position)
        faults += [
            f"Input start.position_mm must leave the floater clear of all bodies; instead received [{place}], where it "
            f"overlaps {name} by {depth * 1e3:.4g} mm."
            for name, body in obstacles
            if (depth := max(body_overlap(body, part) for part in floater)) > TOUCHING
        ]
    parts = [(f"part {k}", part) for k, part in enumerate(scene.floater.bodies, 1)]
    faults += [
        f"Input floater must have magnets and bodies that do not overlap; instead {first} and {second} overlap by "
        f"{depth * 1e3:.4g} mm; move them apart by as much."
        for (first, one), (second, other) in combinations(parts, 2)
        if not apart(one, other) and (depth := body_overlap(one, other)) > TOUCHING
    ]
    return faults
