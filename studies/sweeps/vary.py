"""Which values a scene's parameters take: `KEY=FIRST:LAST:STEP` or `KEY=VALUE,VALUE,...`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from ...geometry.basics import InputError

MOST = 100_000
"""Points of a sweep, at most."""


def parse_vary(asked: Sequence[str]) -> dict[str, list[float]]:
    """Values by key, in the order given.

    Raises
    ------
    InputError : not of this form, no number, no value, a key given twice, or too many points
    """
    found: dict[str, list[float]] = {}
    for text in asked:
        key, equals, values = text.partition("=")
        if not equals or not key:
            raise _wrong(text)
        if key in found:
            raise InputError(f"Input --vary must give each key once; instead received {key} twice.")
        found[key] = _values(text, values)
    if np.prod([float(len(values)) for values in found.values()]) > MOST:
        raise InputError(f"Input --vary must make at most {MOST} points; instead received {', '.join(asked)}.")
    return found


def combinations(values: Mapping[str, Sequence[float]]) -> list[dict[str, float]]:
    """Every combination; the last key changes fastest."""
    return [dict(zip(values, chosen, strict=True)) for chosen in product(*values.values())]


def _values(text: str, values: str) -> list[float]:
    separator = ":" if ":" in values else ","
    try:
        numbers = [float(part) for part in values.split(separator)]
    except ValueError:
        raise _wrong(text) from None
    if not np.all(np.isfinite(numbers)):
        raise _wrong(text)
    if separator == ",":
        if len(set(numbers)) < len(numbers):
            raise InputError(f"Input --vary must give each value once; instead received {text!r}.")
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
        f"rotor.displacement_mm=1:4:0.5; instead received {text!r}."
    )
