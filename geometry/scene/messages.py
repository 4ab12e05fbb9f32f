"""Faults of a scene, in one grammar: Input KEY must be RULE; instead received VALUE."""

import difflib
import re
from collections.abc import Iterator, Sequence
from itertools import combinations, product
from typing import Any, get_args

import numpy as np
from pydantic_core import ErrorDetails

from ..common import InputError, printable, shown
from ..overlap import TOUCHING, apart, body_overlap, deepest_overlap_in_a_turn
from ..solids import Solid
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
OPPOSITE = 1 - 1e-9  # cosine of the angle between two axes from which on they are opposite
MOST = 20  # Faults of a scene that are listed; the rest are counted
# By their configuration.
ROTORS: dict[Any, type[schema.Table]] = dict.fromkeys(("horizontal", "vertical"), schema.DisplacedRotor)
ROTORS |= {"tilt": schema.TiltRotor, "magnets": ExplicitRotor}
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


# Tables of several kinds, and what pydantic calls the kind in the place of a fault.
TAGGED = "rotor", "plate", "floater", "start"
TAGS = "horizontal", "vertical", "tilt", "magnets", "one", "several"


class SceneError(InputError):
    """A scene file that cannot be used, called `source` in messages: all `faults`, by its `text` with lines of keys."""

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
    """The faults found by the schema, as sentences that say what to do; a mistyped key is one fault."""
    unknown = [detail["loc"] for detail in details if detail["type"] == "extra_forbidden"]
    meant = {(*place[:-1], close) for place in unknown for close in _close(place)}
    return [_described(detail) for detail in details if detail["type"] != "missing" or detail["loc"] not in meant]


def _described(detail: ErrorDetails) -> str:
    place, kind, received = list(detail["loc"]), detail["type"], detail["input"]
    if place[0] in TAGGED and len(place) > 1 and place[1] in TAGS:
        del place[1]
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
    if key.isascii() and len(key) <= LONGEST:
        return key if key.replace("_", "").replace("-", "").isalnum() else repr(key)
    return f'"{key[:LONGEST].encode("unicode_escape").decode()}{"..." if len(key) > LONGEST else ""}"'


def _allowed(place: Sequence[Any]) -> list[str]:
    """The keys allowed beside the one at a place of pydantic's, in which kinds of tables stand as keys do."""
    table: type[schema.Table] = schema.SceneTable
    for part in place[:-1]:
        field = table.model_fields.get(part)
        table = ROTORS.get(part, table) if field is None else _table(field.annotation) or table
    return list(table.model_fields)


def _table(form: Any) -> type[schema.Table] | None:
    """The table, or the first of several, in a key's type."""
    if isinstance(form, type) and issubclass(form, schema.Table):
        return form
    return next((found for part in get_args(form) if (found := _table(part))), None)


def _close(place: Sequence[Any]) -> list[str]:
    return difflib.get_close_matches(str(place[-1])[:LONGEST], _allowed(place), n=1)


Fault = tuple[str, ...]  # A key, the rule, what is there instead, and perhaps a way out
GIVEN = "be given", "it is missing"


def _sentence(key: str, rule: str, instead: str, *way_out: str) -> str:
    return " ".join([f"Input {key} must {rule}; instead {instead}.", *way_out])


def key_faults(table: schema.SceneTable) -> list[str]:
    """One sentence for each rule between keys that is broken."""
    return [_sentence(*fault) for fault in _key_faults(table)]


def _key_faults(table: schema.SceneTable) -> Iterator[Fault]:
    rotor, there = table.rotor, table.model_fields_set
    for place, start in table.starts.items():
        if start.offset_mm is not None and start.position_mm is not None:
            yield place, "have offset_mm or position_mm", "received both"
        for key in ("velocity_mm_s", "moment", "spin_hz", "body_x"):
            given = getattr(start, key)
            if given is not None and start.position_mm is None:
                yield f"{place}.{key}", f"come with {place}.position_mm", "received it alone"
            if given is not None and key in ("moment", "body_x") and not any(given):
                yield f"{place}.{key}", "be a direction, not zero", f"received {given}"
    if drag := table.drag:
        for key in ("linear_N_s_m", "angular_N_m_s"):
            if (getattr(drag, key) is not None) == bool(drag.model):
                beside = "be left out beside drag.model", "received both"
                yield f"drag.{key}", *(beside if drag.model else GIVEN)
    magnets: dict[str, Any] = {"rotor": rotor}
    if isinstance(rotor, ExplicitRotor):
        magnets = {f"rotor.magnets[{k}]": magnet for k, magnet in enumerate(rotor.magnets)}
    for place, magnet in magnets.items():
        yield from _shape_faults(place, magnet)
        key, (along, across) = "remanence_T" if magnet is rotor else "polarization_T", magnet.recoil_permeability
        if along != across and not np.any(getattr(magnet, key)):
            yield f"{place}.{key}", "not be zero where recoil_permeability has an easy axis", "it is zero"
    for k, conductor in enumerate(rotor.conductors):
        yield from _shape_faults(f"rotor.conductors[{k}]", conductor)
    needed = () if table.coils and "rotor" not in there else ("frequency_hz", "rotor")
    yield from ((key, *GIVEN) for key in needed if key not in there)
    yield from _coil_faults(table, table.coils or ())
    for name, floater in table.named("floater").items():
        for fault in _floater_faults(floater):
            yield tuple(re.sub("(?<!the )floater", name, part) for part in fault)
    yield from _several_faults(table)
    plates = table.named("plate")
    for name, plate in plates.items():
        yield from _shape_faults(name, plate)
        if plate.lowering != plates.get("plate[0]", plate).lowering:
            yield f"{name}.lowering", "be that of plate[0], as all plates are lowered together", "it is another"
    yield from _drive_faults(table)
    if rotor.field_map is None:
        alone = [k for k in ("map_length_unit", "map_field_unit", "map_columns") if getattr(rotor, k) is not None]
        yield from ((f"rotor.{key}", "come with rotor.field_map", "received it alone") for key in alone)


def _drive_faults(table: schema.SceneTable) -> Iterator[Fault]:
    for k, step in enumerate(table.drive or ()):
        kinds = [key for key in ("to_hz", "stop", "hold_s") if getattr(step, key) is not None]
        ways = [key for key in ("center_mm", "axis") if getattr(step, key) is not None]
        if step.axis is not None and not np.any(step.axis):
            yield f"drive[{k}].axis", "be a direction, not zero", f"received {step.axis}"
        if ways and table.plate is not None:
            rule = "be left out beside a plate, whose currents are known for a rotor that stays where it is"
            way_out = "Leave the plate out, or lower it (plate.lowering)."
            yield f"drive[{k}].{ways[0]}", rule, "it is given", way_out
        if ways and "hold_s" in kinds:
            yield f"drive[{k}].hold_s", f"be in_s beside {ways[0]}", "received hold_s"
        elif len(kinds) > 1 or not kinds + ways:
            received = " and ".join(kinds) or "none of them"
            yield f"drive[{k}]", "have one of to_hz, stop and hold_s", f"received {received}"
        elif (step.in_s is None) != (kinds == ["hold_s"]):
            rule, instead = ("be left out", "received both") if step.in_s else GIVEN
            yield f"drive[{k}].in_s", f"{rule} beside {(kinds + ways)[0]}", instead


def _coil_faults(table: schema.SceneTable, coils: Sequence[schema.CoilTable]) -> Iterator[Fault]:
    """Faults of coils, and of those beside a rotor with what their field would do and is not computed."""
    changing = [bool(isinstance(coil.current_A, list) or coil.frequency_hz) for coil in coils]
    for k, coil in enumerate(coils):
        place = f"coils[{k}].current_A"
        if coil.width_mm >= 2 * coil.radius_mm:
            rule = "be less than twice radius_mm, of the middle of the winding"
            yield f"coils[{k}].width_mm", rule, f"received {coil.width_mm:g}"
        if isinstance(coil.current_A, list):
            if coil.frequency_hz or coil.phase_deg:
                yield place, "be a number beside frequency_hz and phase_deg", "received a table"
            if np.any(np.diff(np.array(coil.current_A)[:, 0]) <= 0):
                yield place, "have increasing times", "they are not"
    if not coils or "rotor" not in table.model_fields_set:
        return
    if any(step.center_mm is not None or step.axis is not None for step in table.drive or ()):
        yield "drive", "have no center_mm and no axis beside coils, which stay where they are", "it has"
    if isinstance(floater := table.floater, list):
        yield "floater", "be one table beside coils and a rotor", "received a list"
        return
    others = [k for k, coil in enumerate(coils) if any(coil.center_mm[:2]) or changing[k]]
    if others and (floater.conductivity_S_m or any(part.conductivity_S_m for part in floater.tables)):
        rule = (
            f"have no conductivity_S_m beside coils[{others[0]}], which is off the rotor's axis or has a current that "
            "changes: what it drives in the floater is not computed"
        )
        yield "floater", rule, "it has", "Steady currents about the axis may stand beside any floater."
    for name, plate in table.named("plate").items():
        if any(changing):
            rule = (
                f"be left out beside coils[{changing.index(True)}], whose current changes and would drive currents in "
                "it, which is not computed"
            )
            yield name, rule, "it is given", "Steady currents drive none."
        elif plate.lowering is not None:
            rule = "be left out beside coils, whose field would drive currents in a plate that moves"
            yield f"{name}.lowering", f"{rule}, which is not computed", "it is given"


def _several_faults(table: schema.SceneTable) -> Iterator[Fault]:
    number, starts = len(table.named("floater")), table.named("start")
    if not isinstance(table.floater, list):
        if isinstance(table.start, list):
            yield "start", "be one table beside one floater", "received a list"
    elif number < 2:
        yield "floater", "be one table, or a list of two and more", f"received a list of {number}"
    elif not isinstance(table.start, list) or len(starts) != number:
        rule = f"be a list of {number} tables [[start]], one for each floater"
        yield "start", rule, f"received {len(starts) or 'none'}"
    else:
        for name in (name for name, start in starts.items() if start.position_mm is None):
            yield f"{name}.position_mm", "be given where there are several floaters", "it is missing"


def _floater_faults(floater: schema.FloaterTable) -> Iterator[Fault]:
    single = [k for k in (*schema.SIZE_KEYS, "file", "remanence_T", "recoil_permeability", "density_kg_m3")
              if getattr(floater, k, None) is not None]  # fmt: skip
    sphere = floater.shape == "sphere" and not floater.composite
    if floater.composite:
        if single or floater.shape != "sphere":
            beside = " and ".join([*([] if floater.shape == "sphere" else ["shape"]), *single])
            rule = "have its sizes and materials in floater.magnets and floater.bodies alone where it has such"
            yield "floater", rule, f"received {beside} beside them"
        if not floater.magnets:
            yield "floater.magnets", "have at least one magnet", "there is ballast alone"
        for name, tables in (("magnets", floater.magnets), ("bodies", floater.bodies)):
            for k, table in enumerate(tables):
                yield from _shape_faults(f"floater.{name}[{k}]", table)
    else:
        yield from _shape_faults("floater", floater)
        yield from ((f"floater.{key}", *GIVEN) for key in ("remanence_T", "density_kg_m3") if key not in single)
    if floater.inertia_kg_m2 is not None:
        if sphere:
            yield "floater.inertia_kg_m2", "be left out of a sphere", "it is given"
        low, middle, high = sorted(floater.inertia_kg_m2)
        if high > (low + middle) * (1 + 1e-9):
            rule = "be moments of inertia, of which none is larger than the other two together"
            yield "floater.inertia_kg_m2", rule, f"received {high:g} beside {low:g} and {middle:g}"


def _shape_faults(place: str, table: Any) -> Iterator[Fault]:
    given = [key for key in schema.SIZE_KEYS if getattr(table, key, None) is not None]
    file, sizes = getattr(table, "file", None), " and ".join(given)
    if table.shape == "file" and not file:
        yield f"{place}.file", "be given, as the shape is 'file'", "it is missing"
    elif place == "floater" and file and table.shape != "file":
        yield "floater.file", "be left out, or shape be 'file'", "it is given"
    elif file and table.shape not in ("cuboid", "file"):
        yield f"{place}.shape", "be left out beside file", f"received {table.shape!r}"
    elif file and given:
        yield place, "have no size beside file", f"received {sizes}"
    elif not file and place == "floater" and not given and table.shape == "sphere":
        yield "floater.diameter_mm", *GIVEN
    elif not file and set(given) != set(wanted := schema.SIZES[table.shape]):
        rule = f"have {' and '.join(wanted)}, as the shape is {table.shape!r}"
        more = [key for key in given if key not in wanted]
        yield place, rule, f"received {sizes or 'no size'}", *([f"Leave out {' and '.join(more)}."] if more else ())
    elif not file and table.shape == "ring" and table.inner_diameter_mm >= table.diameter_mm:
        rule = f"be less than diameter_mm {table.diameter_mm:g}"
        yield f"{place}.inner_diameter_mm", rule, f"received {table.inner_diameter_mm:g}"


def unusual(scene: Scene) -> str:
    """A sentence about sizes, distances, polarisations of no laboratory, as of wrong units; empty if usual."""
    floaters = [one.floater for one in scene.each]
    strongest = max(
        [*(one.remanence for one in floaters), *(float(np.linalg.norm(one.polarization)) for one in scene.rotor)]
    )
    sizes = [*(2 * one.radius for one in floaters), *(edge for one in scene.rotor for edge in one.box.size)]
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
    """Every overlap of the scene's bodies with its depth, of the rotor over a whole turn; touching is allowed."""
    return [_sentence(*fault) for fault in _overlap_faults(scene)]


def _overlap_faults(scene: Scene) -> Iterator[Fault]:
    bodies = [(f"magnet {i}", magnet.body) for i, magnet in enumerate(scene.rotor, 1)]
    bodies += [(f"conductor {i}", part.body) for i, part in enumerate(scene.conductors, 1)]
    yield from _own_overlaps("rotor", "magnets and conductors", bodies)
    for k, (stretch, step) in enumerate(zip(scene.stretches, scene.drive, strict=False)):
        if step.axis and stretch.axes[:, 2] @ step.axis < -OPPOSITE:
            rule = "not be opposite to the axis before it, as no way to it is the shortest"
            yield f"drive[{k}].axis", rule, "it is", "Give a step between."
    metal = scene.plate.body.placed if scene.plate else ()
    plates = [("plate" if len(metal) == 1 else f"plate[{k}]", body) for k, body in enumerate(metal)]
    for (plate, fixed), (name, body) in product(plates, bodies):
        if (depth := deepest_overlap_in_a_turn(body, fixed)) > TOUCHING:
            instead = f"it overlaps {name} by {depth * 1e3:.4g} mm; move the plate away or make it thinner"
            yield plate, "stay clear of the turning rotor", instead
    for (first, one), (second, other) in combinations(plates, 2):
        if (depth := body_overlap(one, other)) > -TOUCHING:
            how = f"overlap by {depth * 1e3:.4g} mm" if depth > TOUCHING else "touch"
            rule = f"be apart from {first}, as currents of bodies that touch are not computed"
            yield second, rule, f"they {how}; give them as one file"
    windings = [] if scene.carried_by_coils else [(f"coils[{k}]", coil.body) for k, coil in enumerate(scene.coils)]
    for name, winding in windings:
        beside = [(f"the turning rotor's {other}", deepest_overlap_in_a_turn(body, winding)) for other, body in bodies]
        beside += [(f"the {other}", body_overlap(body, winding)) for other, body in plates]
        for other, depth in beside:
            if depth > TOUCHING:
                yield name, "stay clear of all bodies", f"it overlaps {other} by {depth * 1e3:.4g} mm; move it away"
    obstacles = [*((f"rotor {name}", body) for name, body in bodies), *windings]
    obstacles += [("the plate" if len(plates) == 1 else name, body) for name, body in plates]
    for k, one in enumerate(scene.each):
        start, number = one.start, f"[{k}]" if scene.companions else ""
        parts = [(f"part {n}", part) for n, part in enumerate(one.floater.bodies, 1)]
        yield from _own_overlaps(f"floater{number}", "magnets and bodies", parts)
        if not isinstance(start, AbsoluteStart):
            continue
        if start.body_x is not None and one.floater.round and not scene.carried_by_coils:
            rule = "be left out of a floater that is round about its moment, as it changes nothing"
            yield f"start{number}.body_x", rule, "it is given"
        axes = one.floater.axes(start.moment / np.linalg.norm(start.moment), start.body_x)
        own, place = one.floater.placed(start.position, axes), ", ".join(f"{c * 1e3:g}" for c in start.position)
        for name, body in obstacles:
            if (depth := max(body_overlap(body, part) for part in own)) > TOUCHING:
                instead = f"received [{place}], where it overlaps {name} by {depth * 1e3:.4g} mm"
                yield f"start{number}.position_mm", "leave the floater clear of all bodies", instead
        obstacles += [(f"floater[{k}]", part) for part in own]


def _own_overlaps(owner: str, kinds: str, bodies: Sequence[tuple[str, Solid]]) -> Iterator[Fault]:
    for (first, one), (second, other) in combinations(bodies, 2):
        if not apart(one, other) and (depth := body_overlap(one, other)) > TOUCHING:
            instead = f"{first} and {second} overlap by {depth * 1e3:.4g} mm; move them apart by as much"
            yield owner, f"have {kinds} that do not overlap", instead
