"""Constants of nature and of the experiment's materials, and arrays that frozen objects hold."""

import difflib
import inspect
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import wraps
from html import escape
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
MU_0 = 4e-7 * math.pi  # Vacuum permeability, T m/A (the value before 2019; the relative difference is 5e-10)
MAGNET_CONDUCTIVITY = 6.7e5  # Electrical conductivity of sintered NdFeB, S/m; makers give 6.2e5 to 9e5


def frozen_array(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Copy `values` into a read-only float array of the given shape."""
    array = np.array(values, dtype=float).reshape(shape)
    array.flags.writeable = False
    return array


def freeze(owner: object, **shapes: tuple[int, ...]) -> None:
    """Read-only float arrays of these shapes in fields of a frozen dataclass."""
    for name, shape in shapes.items():
        object.__setattr__(owner, name, frozen_array(getattr(owner, name), shape))


def even_directions(number: int) -> Array:
    """Unit vectors (number, 3) all around, evenly: a spiral of the golden angle."""
    steps = np.arange(number) + 0.5
    height, angle = 1 - 2 * steps / number, np.pi * (1 + 5**0.5) * steps
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


class SpinlevError(Exception):
    """An error whose message is for the user."""

    exit_status = 1


class InputError(SpinlevError, ValueError):
    """An input that cannot be used; the message names it, the rule and the value."""

    exit_status = 2


class ComputationError(SpinlevError, RuntimeError):
    """The computation ended without an answer; the message says why, and what would help."""


class MeshError(ComputationError):
    """No mesh of the bodies, or one whose elements do not match each other."""


def no_argument(function: str, name: str, allowed: Iterable[str]) -> str:
    """Message for a `name` that is no argument of a `function`, with the one of the `allowed` that it may stand for."""
    return f"Input {name} must be an argument of {function}; instead it is none ({_hint(name, list(allowed))})."


def _hint(name: str, known: Collection[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean `{close[0]}`?" if close else f"allowed are {', '.join(known)}"


def check_names(given: Iterable[Any], known: Collection[str], name: str, what: str) -> None:
    """Raises InputError about the input `name` unless all that is `given` is `known`, which are `what`."""
    for one in given:
        if one not in known:
            hint = _hint(str(one), known)
            raise InputError(f"Input {name} must name {what}; instead received {shown(one)} ({hint})")


def spelled(function: "Callable[P, T]") -> "Callable[P, T]":
    """A function that says of a slip in the name of an argument which one was probably meant."""
    signature = inspect.signature(function)

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            signature.bind(*args, **kwargs)
        except TypeError:
            for name in kwargs.keys() - signature.parameters.keys():
                missing = [known for known in signature.parameters if known not in kwargs]
                raise TypeError(no_argument(function.__name__, name, missing)) from None
            raise
        return function(*args, **kwargs)

    return called


def shown(value: object, most: int = 80) -> str:
    """A value that was received, for a message: as Python writes it, on one line, no longer than `most`."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits; lists in lists by the thousand
        return f"a value ({type(value).__name__}) that is too long to be shown"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def printable(text: str) -> str:
    """Text for a terminal, which must not obey what a file or a name holds: control characters are escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def millimetres(lengths: ArrayLike) -> str:
    """Lengths (n,) in m as `(x, y, z) mm`."""
    return f"({listed(np.asarray(lengths, float) * 1e3)}) mm"


def listed(values: ArrayLike) -> str:
    """Numbers (n,) joined by commas, round-off of 1e-9 left out."""
    return ", ".join(f"{value:.4g}" for value in np.round(np.asarray(values, float), 9) + 0.0)


def counted(number: int, thing: str) -> str:
    """The number with its noun, in the plural unless it is one."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def html_table(title: str, rows: Mapping[str, str]) -> str:
    """A small table for a notebook, two columns."""
    lines = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
    return f"<table><caption>{escape(title)}</caption>{lines}</table>"


Report = Callable[[str], None]  # Takes a message of work
Watch = Callable[[str, float], None]  # Takes the name of a stage and the share of it that is done
Item = TypeVar("Item")
P = ParamSpec("P")
T = TypeVar("T")


def unwatched(stage: str, share: float) -> None:
    """Ignore progress."""


def watched(items: Iterable[Item], watch: Watch, stage: str) -> Iterator[Item]:
    """The `items` one after the other, each reported to `watch` as a share of a `stage`."""
    known = list(items)
    for done, item in enumerate(known):
        watch(stage, done / len(known))
        yield item
