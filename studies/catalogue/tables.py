"""Tables and numbers of reports as text."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, SupportsFloat

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ...geometry.common import Array


def text_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Lines with aligned columns below their heads; numbers with four significant digits, NaN as a dash."""

    def cell(value: Any) -> str:
        if isinstance(value, str):
            return value
        return f"{float(value):.4g}" if np.isfinite(float(value)) else "–"

    cells = [tuple(head), *(tuple(map(cell, row)) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    sides = ["<"] + [">"] * (len(widths) - 1)
    return ["  ".join(f"{c:{s}{w}}" for c, s, w in zip(row, sides, widths, strict=True)).rstrip() for row in cells]


def records(dataset: xr.Dataset, keys: Mapping[str, str]) -> list[dict[str, Any]]:
    """What each place along the dimension of some variables has, for JSON: their values by key, None for NaN.

    Parameters
    ----------
    dataset : with the variables
    keys : the variable of each key, all over the same single dimension
    """
    found = zip(*(dataset[name].values.tolist() for name in keys.values()), strict=True)
    return [{key: None if each != each else each for key, each in zip(keys, row, strict=True)} for row in found]


def span(values: ArrayLike, digits: str = ".3g") -> str:
    """The smallest and the largest of the known values; a dash if there is none."""
    known = np.ravel(np.asarray(values, float))
    known = known[np.isfinite(known)]
    if not known.size:
        return "–"
    low, high = (f"{value:{digits}}" for value in (known.min(), known.max()))
    return low if low == high else f"{low} to {high}"


def uncertain(value: SupportsFloat, error: SupportsFloat) -> str:
    """A number with its error, which has one digit; without it where it is not known."""
    number, doubt = float(value), float(error)
    if not np.isfinite(doubt) or doubt <= 0:
        return f"{number:.4g}"
    return f"{number:.{int(np.clip(-np.floor(np.log10(doubt)), 0, 6))}f} ± {doubt:.1g}"


def range_text(value: xr.DataArray, error: xr.DataArray, scale: float = 1.0) -> str:
    """A range of values with signs, and the largest error.

    Parameters
    ----------
    value, error : over the same dimensions
    scale : from their unit to the one that is written
    """
    known: Array = scale * value.values[np.isfinite(value.values)]
    if not known.size:
        return "–"
    worst = scale * float(np.nanmax(error.values))
    digits = int(np.clip(1 - np.floor(np.log10(max(worst, 1e-6))), 1, 4))
    low, high = (f"{value:+.{digits}f}" for value in (known.min(), known.max()))
    return f"{low if low == high else f'{low} to {high}'} (± {worst:.1g})"


def last_crossing(distance: Array, values: Array, level: float) -> float:
    """The distance from which on values stay below a level, NaN if beyond the last.

    Parameters
    ----------
    distance, values : (n,), by growing distance; between them logarithms are interpolated
    level : positive
    """
    above = np.flatnonzero(values > level)
    if not len(above):
        return float(distance[0])
    k = int(above[-1])
    if k + 1 == len(distance):
        return float("nan")
    share = np.log(values[k] / level) / np.log(values[k] / values[k + 1])
    return float(distance[k] * (distance[k + 1] / distance[k]) ** share)
