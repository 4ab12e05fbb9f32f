"""Frozen dataclasses as netCDF: one codec for the tables of every solver.

Numbers become variables, one for each field of a class, with the unit that the field's metadata names and the sentence
that the class's documentation has for it; all objects of a class share them. Which object holds which numbers is said
by one text in JSON, the variable `content`. Only classes that the fields' types name are made of it: no file can run
anything.
"""

import inspect
import json
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
import xarray as xr

from ..geometry.common import InputError

Table = TypeVar("Table")
CONTENT = "content"


class CodecError(InputError):
    """A data set does not hold such an object."""


def to_dataset(value: Any) -> xr.Dataset:
    """A dataclass, or a tuple or number, with all that is in it: dataclasses, tuples, mappings, arrays, texts, numbers.

    Raises TypeError: something else is in it.
    """
    pools: dict[str, list[np.ndarray]] = {}
    labels: dict[str, dict[str, str]] = {}

    def packed(value: Any, name: str, label: Mapping[str, str]) -> Any:
        if isinstance(value, np.ndarray) or (isinstance(value, float) and "units" in label):
            if np.iscomplexobj(value):
                return {"complex": [packed(part, f"{name}_{end}", label)
                                    for part, end in ((value.real, "real"), (value.imag, "imag"))]}  # fmt: skip
            array = np.asarray(value, label.get("dtype"))
            pools.setdefault(name, []).append(array)
            labels.setdefault(name, {"units": "1"} | {k: text for k, text in label.items() if k != "dtype"})
            return {"number": name} if isinstance(value, float) else {"array": [name, *array.shape]}
        if is_dataclass(value) and not isinstance(value, type):
            said, inner = _documentation(type(value)), {}
            for each in fields(value):
                below = {"long_name": said.get(each.name, each.name), **each.metadata}
                inner[each.name] = packed(getattr(value, each.name), f"{type(value).__name__}.{each.name}", below)
            return {"class": [type(value).__name__, inner]}
        if isinstance(value, tuple | list):
            return {"tuple": [packed(item, name, label) for item in value]}
        if isinstance(value, Mapping):
            return {"mapping": {key: packed(item, name, label) for key, item in value.items()}}
        if isinstance(value, Path):
            return {"path": str(value)}
        if value is None or isinstance(value, str | int | float):
            return value
        raise TypeError(f"Input value must be of what tables are made of; instead {name} is {type(value).__name__}.")

    content = json.dumps(packed(value, "value", {}))
    variables = {name: _variable(name, arrays, labels[name]) for name, arrays in pools.items()}
    about = {"units": "1", "long_name": "which object holds which numbers, JSON"}
    return xr.Dataset(variables | {CONTENT: xr.Variable((), content, about)})


def from_dataset(dataset: xr.Dataset, form: type[Table]) -> Table:
    """The object of a type, or of `tuple[...]`, that `to_dataset` made a data set of.

    Raises CodecError: the data set holds something else.
    """
    classes, left = _classes(form, {}), dict[str, np.ndarray]()

    def taken(name: str, shape: list[int]) -> np.ndarray:
        rest = left[name] if name in left else dataset[name].values.ravel()
        size = int(np.prod(shape))
        found, left[name] = rest[:size], rest[size:]
        return found.reshape(shape).astype(float if found.dtype.kind == "f" else found.dtype)

    def unpacked(tree: Any) -> Any:
        if not isinstance(tree, dict):
            return tree
        ((kind, inner),) = tree.items()
        if kind == "class":
            return classes[inner[0]](**{name: unpacked(part) for name, part in inner[1].items()})
        if kind == "tuple":
            return tuple(map(unpacked, inner))
        if kind == "mapping":
            return {key: unpacked(part) for key, part in inner.items()}
        if kind == "complex":
            real, imaginary = map(unpacked, inner)
            return real + 1j * imaginary
        if kind == "path":
            return Path(inner)
        return float(taken(inner, [1])[0]) if kind == "number" else taken(inner[0], inner[1:])

    try:
        return unpacked(json.loads(str(dataset[CONTENT].item())))  # type: ignore[no-any-return]
    except (KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        name = getattr(form, "__name__", form)
        raise CodecError(f"Input dataset must hold a {name}; instead {type(error).__name__}: {error}.") from error


def _variable(name: str, arrays: list[np.ndarray], label: dict[str, str]) -> xr.Variable:
    """All arrays of a name: along a further axis where they have one shape, else one after the other."""
    alike = len({array.shape for array in arrays}) == 1
    whole = np.stack(arrays) if alike else np.concatenate([array.ravel() for array in arrays])
    return xr.Variable([f"{axis}_of_{size}" for axis, size in zip("abcdefg", whole.shape, strict=False)], whole, label)


def _classes(form: Any, found: dict[str, type]) -> dict[str, type]:
    """Dataclasses that a type names, by their names, and all that their fields' types name."""
    if isinstance(form, type) and is_dataclass(form):
        if form.__name__ not in found:
            found[form.__name__] = form
            for hint in get_type_hints(form).values():
                _classes(hint, found)
    else:
        for argument in get_args(form):
            _classes(argument, found)
    return found


@cache
def _documentation(form: type) -> dict[str, str]:
    """Sentences of a class's documentation about its parameters, by name."""
    lines = re.findall(r"^(\w+(?:, \w+)*) : (.*(?:\n {4,}.*)*)", inspect.getdoc(form) or "", re.MULTILINE)
    return {name: " ".join(text.split()) for names, text in lines for name in names.split(", ")}
