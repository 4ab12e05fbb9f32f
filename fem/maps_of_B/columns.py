"""A map of B: values at points, from a probe or from another program."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import Array, InputError, frozen_array, shown
from ...geometry.scene.contents import MapReading


class FieldMapError(InputError):
    """A map that cannot be used; the message says which entry, and why."""


@dataclass(frozen=True, eq=False)
class FieldMap:
    """Observed field components at points in any order. Raises FieldMapError: wrong shapes, or values."""

    points: Array  #: (n, 3) m, rotor's frame
    field: Array  #: (n, 3) T; NaN where a component was not observed
    #: (n, 3) standard errors of `field`, T, or what broadcasts to it; None if they are not known
    errors: Array | None = None
    read_as: tuple[str, str] = ("m", "T")  #: units of length and of B that the file was taken to have

    def __post_init__(self) -> None:
        points, field = np.asarray(self.points, float), np.asarray(self.field, float)
        for name, values in (("points", points), ("field", field)):
            if values.ndim != 2 or values.shape[1] != 3 or len(values) != len(points):
                raise FieldMapError(
                    f"Input {name} must have shape ({len(points)}, 3); instead received {values.shape}."
                )
        _require(np.isfinite(points), points, "points", "finite")
        _require(~np.isinf(field), field, "field", "finite, or NaN where it was not observed")
        object.__setattr__(self, "points", frozen_array(points, points.shape))
        object.__setattr__(self, "field", frozen_array(field, field.shape))
        if self.errors is not None:
            errors = np.broadcast_to(np.asarray(self.errors, float), field.shape)
            positive = (errors > 0) & np.isfinite(errors)
            _require(positive | np.isnan(field), errors, "errors", "positive where the field is observed")
            object.__setattr__(self, "errors", frozen_array(errors, field.shape))

    @property
    def observations(self) -> int:
        return int(np.isfinite(self.field).sum())

    def where(self, chosen: ArrayLike) -> "FieldMap":
        """The part of the map at `chosen` points: (n,) booleans or indices."""
        chosen = np.asarray(chosen)
        errors = None if self.errors is None else self.errors[chosen]
        return FieldMap(self.points[chosen], self.field[chosen], errors, self.read_as)

    def outside(self, center: ArrayLike, radius: float) -> "FieldMap":
        """The part of the map farther than `radius` (m) from `center` (3,) m: to leave out what lies in a magnet."""
        return self.where(np.linalg.norm(self.points - np.asarray(center, float), axis=1) > radius)


def _require(good: np.ndarray, values: Array, name: str, rule: str) -> None:
    if not good.all():
        row = int(np.argmin(good.all(axis=1)))
        raise FieldMapError(f"Input {name} must be {rule}; instead received {values[row].tolist()} at point {row}.")


AXES = ("x", "y", "z")
COMPONENTS = tuple(f"B{axis}" for axis in AXES)
ERRORS = tuple(f"{component}_err" for component in COMPONENTS)
# VTK's names in small letters: 0 where a point has no value; flags, one of which says that it is hidden.
MASK, GHOSTS = "vtkvalidpointmask", "vtkghosttype"
HIDDEN, HIDDEN_CELL = 2, 32
NEEDED = "x, y, z and at least one of Bx, By, Bz"
VALID = "Valid: x_mm,y_mm,z_mm,Bx_mT,By_mT,Bz_mT."
METERS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "in": 0.0254}
TESLAS = {"T": 1.0, "mT": 1e-3, "µT": 1e-6, "nT": 1e-9, "G": 1e-4, "mG": 1e-7, "kG": 0.1}
UNITS = {**METERS, **TESLAS}
OTHER_NAMES = {
    "m": "meter meters metre metres",
    "cm": "centimeter centimeters centimetre centimetres",
    "mm": "millimeter millimeters millimetre millimetres",
    "µm": "um micrometer micrometers micrometre micrometres micron microns",
    "in": "inch inches",
    "T": "tesla vs/m2 wb/m2",
    "mT": "millitesla mvs/m2 mwb/m2",
    "µT": "ut microtesla",
    "nT": "nanotesla",
    "G": "gs gauss",
    "mG": "mgs milligauss",
    "kG": "kgs kilogauss",
}
# By every name in small letters: instruments print MT for mT, and none means a megatesla.
UNIT_OF = {name: unit for unit, names in OTHER_NAMES.items() for name in (unit.casefold(), *names.split())}
SPELLINGS = str.maketrans({"μ": "µ", "²": "2", "^": None, "·": None, "*": None, " ": None, "\u00a0": None})

_AXIS = (
    r"(?P<axis>[xyz])(?:[ _-]?(?:coord(?:inate)?|pos(?:ition)?))?|(?:coord(?:inate)?|pos(?:ition)?)[ _]?(?P<pos>[xyz])"
)
_COMPONENT = r"(?:B[ _.-]?(?P<b>[xyz])|magnetic[ _]flux[ _]density,?[ _](?P<long>[xyz])[ _-]component)"
_ENTRY = r"(?P<what>B|points|coordinates)(?:[:_](?P<n>[0-2])|\[(?P<k>[0-2])\])"
_VECTOR = r"(?P<vector>B|magnetic[ _]flux[ _]density)(?P<vector_err>_err)?"
_UNIT = r"[ _]?[\[({<](?P<bracket>[^\])}>]*)[\])}>]|(?:[ _]in[ _]|[_/]|,? )(?P<bare>[^\W\d_]+(?:/m\^?[2²])?)"
# `x_mm`, `Bx [mT]`, `mf.Bx (T) @ freq=50`, `Points:0`; a number at the end is that of a repeated title.
TITLE = re.compile(
    rf"(?:{_ENTRY}|{_AXIS}|(?:\w+[.:])*(?:{_COMPONENT}(?P<err>[ _](?:err|error))?|{_VECTOR}))(?:{_UNIT})?"
    r"(?:[ ._#]\d+)?(?:[ _]?@.*)?",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Column:
    """What a title says."""

    title: str  # as it stands in the file
    name: str  # one of `AXES`, `COMPONENTS`, `ERRORS`, "B" or "B_err" of a vector, `MASK` or `GHOSTS`
    unit: str | None  # as it is written, or None

    @property
    def parts(self) -> tuple[str, ...]:
        """What it holds: of a vector the three components."""
        return {"B": COMPONENTS, "B_err": ERRORS}.get(self.name, (self.name,))

    @property
    def is_field(self) -> bool:
        return self.name in (*COMPONENTS, "B")

    def known_unit(self, reading: MapReading, usual: str | None = None) -> str:
        """Its key of `UNITS`: of the scene, its own or the `usual`. Raises FieldMapError: none of length or of B."""
        kind = "length" if self.name in AXES else "field"
        if (said := getattr(reading, f"{kind}_unit") or self.unit or usual) is None:
            example = f"{self.name}_{'mm' if kind == 'length' else 'mT'}"
            raise FieldMapError(
                f"Input column {self.title} must have a unit, as in the title {example} or netCDF's attribute units; "
                f"instead it has none. The scene can name it: rotor.map_{kind}_unit."
            )
        allowed, known = METERS if kind == "length" else TESLAS, unit_named(said)
        if known not in allowed:
            raise FieldMapError(
                f"Input unit of {self.name} must be one of {', '.join(allowed)}; instead received {said!r}."
            )
        return str(known)


def unit_named(unit: object) -> str | None:
    """The unit's name here, a key of `UNITS`; None if it is none."""
    return UNIT_OF.get(str(unit).translate(SPELLINGS).casefold())


def column_of(title: str) -> Column | None:
    """The column of a title; None for a quantity that a map has no use for."""
    text = " ".join(title.strip().strip("\"'").split())
    if text.casefold() in (MASK, GHOSTS):
        return Column(text, text.casefold(), None)
    if (match := TITLE.fullmatch(text)) is None:
        return None
    found = {key: (value or "").lower() for key, value in match.groupdict().items()}
    unit = (match["bracket"] or match["bare"] or "").strip() or None
    if number := found["n"] or found["k"]:
        name = (COMPONENTS if found["what"] == "b" else AXES)[int(number)]
    elif found["vector"]:
        name = f"B{found['vector_err']}"
    elif component := found["b"] or found["long"]:
        name = f"B{component}_err" if found["err"] else f"B{component}"
    else:
        name = found["axis"] or found["pos"]
    return Column(text, name, unit)


def known_columns(titles: Sequence[str], reading: MapReading, vectors: bool = False) -> dict[int, Column]:
    """Columns of a map among `titles` by number, also those that are one but for what `reading.columns` says.

    `x_index` is none beside `x_mm`; `vectors`: whether a column can hold all components.
    """
    found: dict[int, Column] = {}
    for k, title in enumerate(titles):
        column = column_of(title)
        if column is None and reading.columns and (rest := _without(title, reading.columns)):
            column = replace(c, title=title.strip()) if (c := column_of(rest)) else None
        if column and (vectors or column.name not in ("B", "B_err")):
            found[k] = column
    with_unit = {c.name for c in found.values() if unit_named(c.unit)}
    return {k: c for k, c in found.items() if c.unit is None or unit_named(c.unit) or c.name not in with_unit}


def chosen(titles: Sequence[str], reading: MapReading, vectors: bool = False) -> dict[int, Column]:
    """Columns of a map among `titles`, see `known_columns`: each quantity once, of several as `reading.columns` says.

    Raises FieldMapError: two for one quantity, or none of what `reading` says. `vectors`: as there.
    """
    known = known_columns(titles, reading, vectors)
    if reading.columns and any(c.is_field for c in known.values()):
        titled = {k: c for k, c in known.items() if _without(titles[k], reading.columns) is not None}
        if not any(c.is_field for c in titled.values()):
            raise FieldMapError(
                f"Input rotor.map_columns must be in the titles of the components of B to take; instead received "
                f"{reading.columns!r}, which is in none of {shown(', '.join(titles), 200)}."
            )
        names = {c.name for c in titled.values()}
        known = {k: c for k, c in known.items() if k in titled or not (c.is_field or c.name in names)}
    seen: dict[str, Column] = {}
    for column in known.values():
        for name in column.parts:
            if name in seen:
                one, other = seen[name].title, column.title
                # the first can be taken by a word of its title that the second has not
                first, second = (re.findall(r"[^\W_]+(?:=[^\s,)]+)?", title) for title in (one, other))
                apart = next((word for word in first if word not in second), None)
                way = (
                    f'Take one by what its title has, such as rotor.map_columns = "{apart}".'
                    if apart
                    else "Remove one."
                )
                raise FieldMapError(
                    f"Input columns must hold {name} once; instead received {one!r} and {other!r}. {way}"
                )
            seen[name] = column
    return known


def _without(title: str, text: str) -> str | None:
    """A title without a word that it must have, or a number: `50` is not in `f=500`, `mf` not in `mfnc.Bx`."""
    word = re.escape(" ".join(text.split())).replace(r"\ ", r"\s*").replace("=", r"\s*=\s*")
    pattern = rf"(?<![a-z0-9])(?<!\d[.,]){word}(?![a-z0-9]|[.,]\d)"
    if (found := re.search(pattern, title, re.IGNORECASE)) is None:
        return None
    return re.sub(r"[ _.:-]+(?=[ _]?[\[({]|$)", "", (title[: found.start()] + title[found.end() :]).strip(" _.:-"))
