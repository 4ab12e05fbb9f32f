"""Numbers given on the command line, and points to evaluate a field at, from a CSV file."""

from __future__ import annotations

import csv
import io
import math
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...geometry.basics import InputError, file_content, shown

if TYPE_CHECKING:
    from ...geometry.basics import Array

COLUMNS = ("x_mm", "y_mm", "z_mm")
MOST = 50_000_000
"""Bytes of a file of points: a million of them."""
FARTHEST = 1e9
"""Largest coordinate, mm: beyond, powers of it overflow."""


def three_numbers(name: str, text: str) -> Array:
    """(3,) from X,Y,Z. Raises InputError where they are not three finite numbers."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(abs(number) <= FARTHEST for number in numbers):
        raise InputError(
            f"Input {name} must be three numbers X,Y,Z of at most {FARTHEST:g} mm; instead received {shown(text)}."
        )
    return _in_array(numbers)


def map_extent(text: str) -> Array:
    """(4,) m left, right, lower and upper end of a map, from HALF or the four in mm. Raises InputError."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == 1:
        numbers = [-numbers[0], numbers[0]] * 2
    sound = len(numbers) == 4 and all(map(math.isfinite, numbers))
    if not (sound and numbers[0] < numbers[1] and numbers[2] < numbers[3]):
        raise InputError(
            "Input --extent-mm must be one positive number, or LEFT,RIGHT,LOWER,UPPER in rising order; instead "
            f"received {shown(text)}."
        )
    return _in_array(numbers) * 1e-3


def is_number(value: Any) -> bool:
    """Whether it is a finite number that a float holds."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer larger than any float
        return False


def positive(name: str, value: float) -> None:
    """Raises InputError where the value is no positive finite number."""
    if not (is_number(value) and value > 0):
        raise InputError(f"Input {name} must be a positive number; instead received {shown(value)}.")


def finite(name: str, value: float) -> float:
    """The value. Raises InputError where it is no finite number."""
    if not is_number(value):
        raise InputError(f"Input {name} must be a finite number; instead received {shown(value)}.")
    return float(value)


def read_points(path: Path) -> Array:
    """Points (n, 3) in m from a CSV file with a header that has the columns x_mm, y_mm, z_mm.

    Raises `InputError` where the file is missing, no file, too large, empty, lacks a column or has an entry that is no
    finite number or too large a one.
    """
    content = file_content(path, MOST, "points", f"a CSV file with {', '.join(COLUMNS)}")
    try:
        rows = csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), skipinitialspace=True)
        header = [name.strip() for name in next(rows, [])]
        if any(column not in header for column in COLUMNS):
            received = shown(", ".join(header))
            raise InputError(
                f"{path}: Input header must have the columns {', '.join(COLUMNS)}; instead received {received}."
            )
        where = [header.index(column) for column in COLUMNS]
        found = [
            [_number(path, line, row, i) for i in where]
            for line, row in enumerate(rows, start=2)
            if any(cell.strip() for cell in row)
        ]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: Input points must be a readable CSV text; instead: {error}.") from None
    if not found:
        raise InputError(f"{path}: Input points must be at least one line below the header; instead received none.")
    return _in_array(found) * 1e-3


def _in_array(numbers: list[Any]) -> Array:
    """As an array; NumPy is loaded when the first number is read, not with the command line."""
    import numpy as np

    return np.array(numbers)


def _number(path: Path, line: int, row: list[str], column: int) -> float:
    text = row[column].strip() if column < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}: Input line {line} must have three finite numbers; instead received {shown(text)}.")
    if abs(value) > FARTHEST:
        raise InputError(
            f"{path}: Input line {line} must have numbers of at most {FARTHEST:g} mm; instead received {value:g}."
        )
    return value
