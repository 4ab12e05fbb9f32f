"""Which values a scene's parameters take: `KEY=FIRST:LAST:STEP` or `KEY=VALUE,VALUE,...`."""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

from ...geometry.basics import InputError, shown
from .numbers import is_number

MOST = 100_000
"""Points of a sweep, at most."""
NAMED = ("model", "plate_model", "interaction")
"""Keys whose values are names."""


def parse_vary(asked: Sequence[str]) -> dict[str, list[Any]]:
    """Values by key, in the order given.

    Raises
    ------
    InputError : not of this form, no number, no value, a key given twice, or too many points
    """
    found: dict[str, list[Any]] = {}
    for text in asked:
        key, equals, values = text.partition("=")
        if not equals or not key:
            raise _wrong(text)
        if key in found:
            raise InputError(f"Input --vary must give each key once; instead received {shown(key)} twice.")
        found[key] = [part.strip() for part in values.split(",")] if key in NAMED else _values(text, values)
    return checked_values(found, "--vary")


def checked_values(values: Mapping[str, Sequence[Any]], name: str = "values") -> dict[str, list[Any]]:
    """Values by key as lists of floats and, for `NAMED` keys, of texts; `name` is what messages call them.

    Raises
    ------
    InputError : no key, no value, one that is no finite number, one that is given twice, or too many points
    """
    if not isinstance(values, Mapping) or not all(isinstance(key, str) for key in values):
        raise InputError(f"Input {name} must be lists of values by key; instead received {shown(values)}.")
    if not values:
        raise InputError(f"Input {name} must have at least one key; instead received none.")
    found = {}
    for key, given in values.items():
        listed = (
            list(given) if isinstance(given, Iterable) and not isinstance(given, str | bytes | Mapping) else [given]
        )
        fine = all(isinstance(v, str) if key in NAMED else is_number(v) for v in listed)
        if not listed or not fine:
            what = "names" if key in NAMED else "finite numbers"
            raise InputError(f"Input {key} must be varied over {what}; instead received {shown(given)}.")
        if len(set(listed)) < len(listed):
            raise InputError(f"Input {name} must give {key} each value once; instead received {shown(given)}.")
        found[key] = listed if key in NAMED else [float(value) for value in listed]
    points = math.prod(len(each) for each in found.values())
    if points > MOST:
        raise InputError(f"Input {name} must make at most {MOST} points; instead received {points}.")
    return found


def combinations(values: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """Every combination; the last key changes fastest."""
    return [dict(zip(values, chosen, strict=True)) for chosen in product(*values.values())]


def _values(text: str, values: str) -> list[float]:
    separator = ":" if ":" in values else ","
    try:
        numbers = [float(part) for part in values.split(separator)]
    except ValueError:
        raise _wrong(text) from None
    if not all(map(math.isfinite, numbers)):
        raise _wrong(text)
    if separator == ",":
        return numbers
    if len(numbers) != 3 or numbers[2] == 0 or (numbers[1] - numbers[0]) / numbers[2] < 0:
        raise _wrong(text)
    first, last, step = numbers
    count = int(min((last - first) / step + 1e-6, MOST)) + 1
    # Rounded to 12 digits: 0.1, 0.2, 0.3 and not 0.30000000000000004.
    return [float(f"{first + k * step:.12g}") for k in range(count)]


def _wrong(text: str) -> InputError:
    return InputError(
        f"Input --vary must be KEY=FIRST:LAST:STEP or KEY=VALUE,VALUE,... with a key of the scene file, such as "
        f"rotor.displacement_mm=1:4:0.5; instead received {shown(text)}."
    )
