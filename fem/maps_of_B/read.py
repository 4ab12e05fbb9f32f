"""Columns of a map from a text: a probe's, a spreadsheet's, COMSOL's, Maxwell's or CST's, in whatever dialect it is.

How often a character comes, by which libraries tell the dialects of tables of any content, need not be asked: a map has
titles of coordinates and of B. The separator is the one under which they are there, with numbers below them.
"""

import codecs
import csv
import io
import re
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...geometry.common import Array, InputError, shown
from ...geometry.files import file_content, hdf5_fault, is_hdf5, regular_file
from ...geometry.scene.contents import MapReading
from ..cache import TableFileError, read_checked
from . import columns as cols
from .columns import AXES, COMPONENTS, METERS, NEEDED, Column, FieldMap, FieldMapError

MOST_BYTES = 250_000_000
HEADER_LINES = 300  # Lines in which the titles must be
COMMENT = re.compile(r"\s*(?:%+|#+|//+|!+|\*+)\s?")
RULE = re.compile(r"[\s=_+|-]*")  # An empty line, or one that is drawn
LENGTH_UNIT = re.compile(r"length unit\W+(\w+)", re.IGNORECASE)  # COMSOL's unit of the coordinates, in a comment
SEP = re.compile(r"\"?sep=(.)\"?", re.IGNORECASE)  # A spreadsheet's first line
GRID = re.compile(r"Grid Output Min:\s*\[(\S+) (\S+) (\S+)\]", re.IGNORECASE)
# Maxwell's titles: coordinates and B are in m and T.
VECTOR_DATA = re.compile(r"\s*X,\s*Y,\s*Z,\s*Vector data\s*\"(.*)\"\s*", re.IGNORECASE)
# One of titles that only spaces part, such as `mf.Bx (T) @ freq=50`.
TITLE = re.compile(r"\"[^\"]*\"|\S+(?:[ ]?(?:\[[^\]]*\]|\([^)]*\)))?(?:[ ]@[ ][^\s=]+=\S+(?:(?<=,)[ ][^\s=]+=\S+)*)?")
MISSING = {"", "na", "n/a", "#n/a", "null", "none", "-", "--", "nan(ind)", "-nan(ind)", "1.#qnan", "-1.#ind"}
FORTRAN = str.maketrans("dD−", "eE-")
GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+")  # Where a comma may part thousands


@dataclass(frozen=True)
class _Table:
    """Titles and the lines below them; `usual` units of length and of B hold for titles without one."""

    separator: str | None
    titles: list[str]
    lines: list[str]
    usual: tuple[str | None, str | None] = (None, None)

    def rows(self) -> Iterator[list[str]]:
        """Cells of every line that is no comment."""
        lines = (line for line in self.lines if not RULE.fullmatch(line) and not COMMENT.match(line))
        return _cells(lines, self.separator)


def _text(path: Path, reading: MapReading) -> FieldMap:
    """A map from a table as text. Raises FieldMapError: no text or titles of a map, a cell of no number or two."""
    lines = _lines(file_content(path, MOST_BYTES, "map", "a file"))
    separators: Sequence[str | None] = (",", ";", "\t", "|", None)
    if said := SEP.fullmatch(lines[0].strip()):
        lines, separators = lines[1:], (said[1],)
    maxwell = _maxwell(lines)
    tables = [maxwell] if maxwell else [t for s in separators if (t := _table(lines, s, reading))]
    if not tables:
        heads = [COMMENT.sub("", line, count=1) for line in lines[:HEADER_LINES] if line.strip()]
        splits = [_titles(line, separator, []) for line in heads for separator in separators]
        nearest = max(splits, key=lambda titles: len(cols.known_columns(titles, reading)), default=[])
        known = [column.name for column in cols.known_columns(nearest, reading).values()]
        received = ", ".join(known) or "none that is known"
        if any(title.strip() for title in nearest):
            received += f" of the titles {shown(', '.join(title.strip() for title in nearest), 200)}"
        raise FieldMapError(f"Input columns must hold {NEEDED}; instead received {received}. {cols.VALID}")
    faults = []
    for table in tables:
        row = next(table.rows(), [])  # units may stand in a line of their own below the titles
        units = {k: row[k].strip(" ()[]{}<>\"'") for k in cols.known_columns(table.titles, reading) if k < len(row)}
        below = {k: unit for k, unit in units.items() if unit}
        if not all(map(cols.unit_named, below.values())):
            below = {}
        source = _Source(table.titles, below, table.usual, partial(_numbers, table, skipped=1 if below else 0))
        try:
            return _field_map(source, reading, vectors=False)
        except FieldMapError as error:
            faults.append(error)
    raise faults[0]


def _lines(content: bytes) -> list[str]:
    """Lines of a text in the encoding that its first bytes tell, in UTF-8, or as Windows writes western languages."""
    marks = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
    encodings = [name for mark, name in marks if content.startswith(mark)] or ["utf-8", "cp1252"]
    if b"\0" in content[:100] and len(encodings) == 2:
        encodings = ["utf-16-le" if content[1:2] == b"\0" else "utf-16-be"]
    for encoding in encodings:
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    raise FieldMapError(
        "Input map must be a text, netCDF or a mesh; instead its bytes are neither. Save a spreadsheet or a program's "
        "own file as CSV."
    )


def _cells(lines: Iterator[str], separator: str | None) -> Iterator[list[str]]:
    if separator is None:
        yield from (line.split() for line in lines)
        return
    try:
        rows = csv.reader(lines, delimiter=separator, skipinitialspace=True)
        yield from (row for row in rows if any(cell.strip() for cell in row))
    except csv.Error as error:
        raise FieldMapError(f"Input map must be a readable CSV text; instead: {error}.") from None


def _table(lines: list[str], separator: str | None, reading: MapReading) -> _Table | None:
    """What is below the last line of titles of a map before the numbers; None if there is no such line."""
    found, length = None, None
    for number, line in enumerate(lines[:HEADER_LINES], 1):
        bare = COMMENT.sub("", line, count=1)
        in_comment = bare != line
        if in_comment and (said := LENGTH_UNIT.search(bare)):
            length = said[1]
        titles = _titles(bare, separator, lines[number:])
        names = {column.name for column in cols.known_columns(titles, reading).values()}
        if names.issuperset(AXES) and not names.isdisjoint(COMPONENTS):
            usual = (length or "m", "T") if line.lstrip().startswith("%") else (length, None)
            found = _Table(separator, titles, lines[number:], usual)
        elif found and not in_comment and not RULE.fullmatch(line):
            break
    return found


def _titles(line: str, separator: str | None, below: list[str]) -> list[str]:
    """Titles in a line; where only spaces part them, as many as there are cells below."""
    if separator is not None:
        return next(_cells(iter([line]), separator), [])
    cells = len(next(_Table(None, [], below[:HEADER_LINES]).rows(), []))
    ways = (re.split(r"\s{2,}|\t", line.strip()), TITLE.findall(line))
    return next((titles for titles in ways if len(titles) == cells), line.split())


def _maxwell(lines: list[str]) -> _Table | None:
    for number, line in enumerate(lines[:HEADER_LINES], 1):
        if not (found := VECTOR_DATA.fullmatch(line)):
            continue
        if not re.search(r"(?<![a-z])B", found[1], re.IGNORECASE):
            raise FieldMapError(f"Input vector data of the map must be B; instead received {found[1]!r}.")
        table = _Table(None, [*AXES, *COMPONENTS], lines[number:], ("m", "T"))
        corner = next((said for before in lines[:number] if (said := GRID.search(before))), None)
        return table if corner is None else replace(table, usual=(_grid_unit(table, corner.groups()), "T"))
    return None


def _grid_unit(table: _Table, corner: Sequence[str]) -> str:
    """The unit in which the first point is the lowest corner of the grid, such as `-20mm`."""
    split = (re.fullmatch(r"(.*?\d\.?)([^\W\d]+)", entry) for entry in corner)
    pairs = [(_number(entry[1], False, "grid", 0), cols.unit_named(entry[2])) for entry in split if entry]
    said = [number * METERS.get(str(unit), np.nan) for number, unit in pairs]
    first = [_number(cell, False, axis, 1) for axis, cell in zip(AXES, next(table.rows(), []), strict=False)]
    for unit, scale in METERS.items():
        if len(said) == len(first) == 3 and np.allclose(np.array(first) * scale, said, rtol=1e-6, atol=1e-12):
            return unit
    raise FieldMapError(
        f"Input grid must begin at its lowest corner ({', '.join(corner)}); instead the first point is {first}."
    )


def _numbers(table: _Table, columns: Mapping[int, Column], skipped: int) -> dict[str, Array]:
    values, width = {k: array("d") for k in columns}, len(table.titles)
    cells = (row[k] for row in table.rows() for k in columns if k < len(row))
    comma = next((mark == "," for cell in cells for mark in cell if mark in ",."), False)  # of the first with either
    is_decimal = False
    for number, row in enumerate(table.rows(), 1 - skipped):
        if number < 1:
            continue
        # none is longer than the titles, or shorter where only spaces part the cells
        if any(map(str.strip, row[width:])) or (len(row) < width and table.separator is None):
            hint = " A decimal comma needs another separator than a comma." if table.separator == "," else ""
            raise FieldMapError(
                f"Input row {number} below the titles must have {width} cells as they; instead it has {len(row)}.{hint}"
            )
        for k, column in columns.items():
            cell = row[k].strip(" \t\"'\u00a0\u202f") if k < len(row) else ""
            values[k].append(_number(cell, comma, column.title, number))
            is_decimal |= comma and "," in cell and not GROUPED.fullmatch(cell)
    if comma and not is_decimal:
        raise FieldMapError(
            "Input numbers must be such that a comma means one thing; instead each may part decimals or thousands. "
            "Write them with a decimal point."
        )
    if not all(values.values()):
        raise FieldMapError("Input map must have numbers below its titles; instead it has none.")
    return {column.name: np.frombuffer(values[k]) for k, column in columns.items()}


def _number(cell: str, comma: bool, title: str, line: int) -> float:
    if cell.casefold() in MISSING:
        return np.nan
    text = cell.replace(",", ".") if comma and "." not in cell else cell
    try:
        if "_" in text:  # which Python takes for a separator of thousands
            raise ValueError
        return float(text.translate(FORTRAN))
    except ValueError:
        raise FieldMapError(
            f"Input {title} in row {line} below the titles must be a number or empty; instead received {shown(cell)}."
        ) from None


# Endings of the names of meshes; a `.dat` is one if it is Tecplot's.
MESHES = {*meshio.extension_to_filetypes} - {".dat"}
TECPLOT = re.compile(rb"\s*(?:TITLE|VARIABLES|ZONE)\b", re.IGNORECASE)
OTHER_VTK = {".vti", ".vtr", ".vts", ".vtp", ".vtm", ".pvtu", ".pvti", ".pvts", ".pvtr", ".pvd"}
LARGEST_FILE = 1_000_000_000


@dataclass(frozen=True)
class _Source:
    titles: Sequence[str]  # of all columns
    said: Mapping[int, str]  # units by number, whatever the titles say
    # units of length and of B of titles without one, if files of the kind have them
    usual: tuple[str | None, str | None]
    # values (n,) of some columns by what they hold, as they are in the file
    numbers: Callable[[Mapping[int, Column]], Mapping[str, Array]]


def read_field_map(path: str | Path, reading: MapReading | None = None) -> FieldMap:
    """Read a map of B, its format recognised by the name of the file and by what it begins with.

    - netCDF: variables Bx, By, Bz (and Bx_err ...), or B (and B_err) with one more dimension of three components, over
      coordinates x, y, z, each with its `units`; grids and lists of points alike.
    - all that meshio reads (`.vtu`, `.vtk`, `.msh`, `.xdmf`): point data B (n, 3), or Bx, By, Bz, in m and T where
      neither their names nor `reading` tell others. Points that VTK marks as hidden or without a value are left out.
    - any other file: a table as text, with columns x, y, z, Bx, By, Bz, Bx_err, By_err, Bz_err, not all of them needed.

    Raises FieldMapError: no such file, unreadable, coordinates or every component missing or twice, an unknown unit, or
    what `FieldMap` refuses.
    """
    path, reading = Path(path), reading or MapReading()
    try:
        with regular_file(path, LARGEST_FILE, "map", "a file") as stream:
            beginning, suffix = stream.read(100), path.suffix.lower()
    except InputError as error:
        raise FieldMapError(str(error)) from None
    try:
        if suffix in OTHER_VTK:
            raise FieldMapError(
                f"Input map must be a mesh that meshio reads; instead received {suffix}. Save it as .vtu."
            )
        if suffix in (".nc", ".nc4"):
            return _field_map(_netcdf(path), reading)
        if suffix in MESHES or (suffix == ".dat" and TECPLOT.match(beginning)):
            return _field_map(_mesh(path, reading), reading)
        return _text(path, reading)
    except InputError as error:
        raise FieldMapError(f"{path}: {error}") from None


def _field_map(source: _Source, reading: MapReading, vectors: bool = True) -> FieldMap:
    columns = {k: replace(c, unit=source.said.get(k) or c.unit)
               for k, c in cols.chosen(source.titles, reading, vectors).items()}  # fmt: skip
    units = {
        name: column.known_unit(reading, source.usual[0 if name in AXES else 1])
        for column in columns.values()
        for name in column.parts
        if name not in (cols.MASK, cols.GHOSTS)
    }
    found = {name: cols.UNITS.get(units.get(name, ""), 1.0) * part for name, part in source.numbers(columns).items()}
    if not found.keys() >= {*AXES} or found.keys().isdisjoint(COMPONENTS):
        raise FieldMapError(f"Input columns must hold {NEEDED}; instead received {', '.join(units) or 'none of them'}.")
    nothing = np.full(len(found["x"]), np.nan)
    kinds = (AXES, COMPONENTS, cols.ERRORS)
    points, field, errors = (np.stack([found.get(n, nothing) for n in names], axis=-1) for names in kinds)
    hidden = np.nan_to_num(found.get(cols.GHOSTS, nothing)).astype(int) & cols.HIDDEN
    is_known = (found.get(cols.MASK, nothing) != 0) & (hidden == 0)
    if not is_known.any():
        raise FieldMapError(f"Input map must have points with a value; instead all {len(points)} are masked.")
    read_as = units["x"], next(units[name] for name in COMPONENTS if name in units)
    given = not found.keys().isdisjoint(cols.ERRORS)
    return FieldMap(points[is_known], field[is_known], errors[is_known] if given else None, read_as)


def _netcdf(path: Path) -> _Source:
    try:
        dataset = read_checked(path)
    except TableFileError as error:
        raise FieldMapError(str(error)) from error
    titles = [str(name) for name in dataset.variables]
    said = {k: dataset[name].attrs["units"] for k, name in enumerate(titles) if "units" in dataset[name].attrs}

    def numbers(columns: Mapping[int, Column]) -> dict[str, Array]:
        found: dict[str, xr.DataArray] = {}
        for k, column in sorted(columns.items(), key=lambda entry: entry[1].name not in AXES):
            whole = dataset[titles[k]]
            if len(column.parts) == 1:
                found[column.name] = whole
                continue
            axes = [d for d in whole.dims if d not in AXES and whole.sizes[d] == 3]
            if len(axes) != 1:
                raise FieldMapError(
                    f"Input {column.name} must have one dimension of three components; instead it has {whole.sizes}."
                )
            found |= {name: whole.isel({axes[0]: k}, drop=True) for k, name in enumerate(column.parts)}
        return {n: part.values.ravel() for n, part in zip(found, xr.broadcast(*found.values()), strict=True)}

    return _Source(titles, said, (None, None), numbers)


def _mesh(path: Path, reading: MapReading) -> _Source:
    for part in (path, path.with_suffix(".h5")):  # where XDMF has its numbers
        if is_hdf5(part) and (fault := hdf5_fault(part)):
            raise FieldMapError(f"Input map must be a readable HDF5 file; instead: {fault}.")
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # where no reader takes the file meshio prints why, and leaves the program
        reason = " ".join(printed.getvalue().split()) or error
        raise FieldMapError(f"Input map must be a mesh that meshio reads; instead: {reason}.") from None
    data = {name: np.squeeze(np.asarray(values, float)) for name, values in mesh.point_data.items()}
    known = cols.known_columns(list(data), reading, vectors=True)
    # Point data that have the shape that goes with their name: `B` may be a length as well.
    fitting = [name for k, name in enumerate(data) if k in known and known[k].name not in AXES
               and data[name].shape[1:] == ((3,) if len(known[k].parts) == 3 else ())]  # fmt: skip
    in_cells = [name for name in mesh.cell_data if (c := cols.column_of(name)) and c.is_field]
    if in_cells and not any(c.is_field for c in cols.known_columns(fitting, reading, vectors=True).values()):
        raise FieldMapError(
            f"Input map must have B as point data; instead {in_cells[0]!r} is cell data. Write its values at the "
            "points, as ParaView's filter Cell Data to Point Data does."
        )
    places = dict(zip(AXES, mesh.points.T, strict=False))
    titles = [*places, *fitting]

    def numbers(columns: Mapping[int, Column]) -> dict[str, Array]:
        found: dict[str, Array] = {}
        for k, column in columns.items():
            found |= zip(column.parts, np.atleast_2d((places | data)[titles[k]].T), strict=True)
        found[cols.GHOSTS] = np.maximum(found.get(cols.GHOSTS, 0), np.where(_hidden_by_cells(mesh), cols.HIDDEN, 0))
        return found

    return _Source(titles, {}, ("m", "T"), numbers)


def _hidden_by_cells(mesh: meshio.Mesh) -> NDArray[np.bool_]:
    """Which points (n,) belong to cells that VTK marks as hidden, and to no other."""
    seen, hidden = (np.zeros(len(mesh.points), bool) for _ in range(2))
    flags: list[Array] = next((v for name, v in mesh.cell_data.items() if name.casefold() == cols.GHOSTS), [])
    for block, marks in zip(mesh.cells, flags, strict=False):
        is_hidden = np.ravel(marks).astype(int) & cols.HIDDEN_CELL != 0
        hidden[np.ravel(block.data[is_hidden])] = True
        seen[np.ravel(block.data[~is_hidden])] = True
    return np.asarray(hidden & ~seen)
