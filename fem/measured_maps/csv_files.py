"""Columns of a map from a CSV file: a probe's, or COMSOL's."""

import csv
import re
from pathlib import Path

import numpy as np

from ...geometry.basics import Array
from .field_map import FieldMapError
from .units import AXES, unit_scale

COMMENT = "%"
"""Begins the lines of COMSOL's header; the last of them names the columns."""
COMSOL = re.compile(r"(?:\w+\.)*(x|y|z|B[xyz])\s*(?:\((\w+)\))?$")
"""A column of COMSOL: `x`, `mf.Bx (T)`."""


def csv_columns(path: Path) -> dict[str, Array]:
    """Columns x, y, z, Bx, By, Bz, Bx_err, By_err, Bz_err in SI units, as far as they are there."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream, skipinitialspace=True) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FieldMapError(f"Input map must be a readable CSV text; instead: {error}.") from None
    head = [row for row in rows if row[0].startswith(COMMENT)]
    known = _comsol_header(head) if head else _plain_header(rows[0] if rows else [])
    body = rows[len(head) :] if head else rows[1:]
    columns = {}
    for index, (title, name, unit) in known.items():
        scale = unit_scale(name, unit)
        columns[name] = scale * np.array([_number(title, k, row, index) for k, row in enumerate(body, 1)])
    return columns


def _plain_header(row: list[str]) -> dict[int, tuple[str, str, str]]:
    """Title, name and unit of the known columns, by number."""
    parts = {k: (title.strip(), *title.strip().rpartition("_")[::2]) for k, title in enumerate(row)}
    return {k: p for k, p in parts.items() if p[1] in AXES or p[1].removesuffix("_err") in ("Bx", "By", "Bz")}


def _comsol_header(head: list[list[str]]) -> dict[int, tuple[str, str, str]]:
    """The same from COMSOL's header, in which the lengths have one unit for all."""
    said = {row[0].lstrip(COMMENT).strip().lower(): row[1].strip() for row in head if len(row) == 2}
    titles = [title.lstrip(COMMENT).strip() for title in head[-1]]
    found = {k: (title, COMSOL.fullmatch(title)) for k, title in enumerate(titles)}
    length = said.get("length unit", "m")
    return {
        k: (title, match[1], match[2] or (length if match[1] in AXES else "T"))
        for k, (title, match) in found.items()
        if match
    }


def _number(title: str, line: int, row: list[str], column: int) -> float:
    text = row[column].strip() if column < len(row) else ""
    try:
        return float(text) if text else np.nan
    except ValueError:
        raise FieldMapError(
            f"Input {title} in row {line} below the header must be a number or empty; instead received {text!r}."
        ) from None
