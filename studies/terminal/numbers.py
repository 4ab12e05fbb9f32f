"""Numbers given on the command line."""

from numbers import Real

import numpy as np

from ...geometry.basics import Array, InputError


def three_numbers(name: str, text: str) -> Array:
    """(3,) from X,Y,Z. Raises InputError where they are not three finite numbers."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != 3 or not np.all(np.isfinite(numbers)):
        raise InputError(f"Input {name} must be three numbers X,Y,Z; instead received {text!r}.")
    return numbers


def positive(name: str, value: float) -> None:
    """Raises InputError where the value is no positive finite number."""
    if not (isinstance(value, Real) and 0 < value < float("inf")):
        raise InputError(f"Input {name} must be a positive number; instead received {value}.")


def finite(name: str, value: float) -> float:
    """The value. Raises InputError where it is no finite number."""
    if not (isinstance(value, Real) and abs(value) < float("inf")):
        raise InputError(f"Input {name} must be a finite number; instead received {value!r}.")
    return float(value)
