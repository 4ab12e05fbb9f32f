"""Studies: a pure function of one point, and the points at which it is computed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from .result import Columns, Found, columns

Point = Mapping[str, Any]  # what distinguishes one point of a study, in types that JSON knows
Compute = Callable[[Point], xr.Dataset]  # one point's labelled result, the same whoever computes it
Batch = Mapping[int, Point]  # numbered points that are computed together
# How to compute each of several points that help each other.
Prepared = Callable[[Sequence[Point]], Sequence[Callable[[], xr.Dataset]]]


def by_case(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """The points' results one after the other along `case`; dimensions of unlike length are filled with NaN."""
    return xr.concat(parts, "case", data_vars="all", coords="different", compat="equals", join="outer")


# What may tell a point from the others, with units.
LABELS = {
    "configuration": {},
    "value": {},
    "measure": {"units": "mm or °", "long_name": "displacement or tilt"},
    "model": {},
}


def recorded(point: Point, table: Columns, found: Found, axes: Mapping[str, Any], **sizes: int) -> xr.Dataset:
    """A `point`'s result with its `LABELS`, joined along `case`: `table`, `found`, `sizes` of `columns`, and `axes`."""
    labels = {name: xr.Variable((), point[name], attrs) for name, attrs in LABELS.items() if name in point}
    return xr.Dataset(columns(table, found, **sizes), axes).assign(labels).expand_dims("case")


def cases_with(result: xr.Dataset, **labels: object) -> xr.Dataset:
    chosen = np.all([result[name].values == wanted for name, wanted in labels.items()], axis=0)
    return result.isel(case=np.flatnonzero(chosen))


def case_with(result: xr.Dataset, **labels: object) -> xr.Dataset:
    """The first case of a joined result with the given labels; IndexError where there is none."""
    return cases_with(result, **labels).isel(case=0)


def each_case(result: xr.Dataset) -> list[xr.Dataset]:
    """The cases of a joined result one by one, without the dimension `case`."""
    return [result.isel(case=k) for k in range(result.sizes["case"])]


@dataclass(frozen=True)
class Study:
    """One question to the program."""

    name: str  # by which it is asked for, and which its files have
    summary: str  # what it gives, in a line
    points: Callable[[bool], Sequence[Point]]  # takes `quick` and returns the points
    compute: Compute
    # By the name of its files, what draws each figure from the joined result alone; one message a figure
    figures: Mapping[str, Callable[[xr.Dataset], Figure]]
    report: Callable[[xr.Dataset], list[str]]  # what it says, in lines, from the joined result alone
    gather: Callable[[Sequence[xr.Dataset]], xr.Dataset] = by_case  # joins the results of the points into one
    # How to compute each of several points that help each other; None where they do not
    prepared: Prepared | None = None
    # Which of the numbered points are computed together, with `prepared`
    batches: Callable[[Batch], Sequence[Sequence[int]]] | None = None
    quick: str = ""  # what `--quick` leaves out of it, in words
    timed: bool = False  # whether it measures times, for which its points must have the machine for themselves
    settings: Point = field(default_factory=dict)  # what all points have in common, if they do not say it themselves
    # What else `--json` prints, by key, from the joined result alone
    numbers: Callable[[xr.Dataset], Mapping[str, Any]] | None = None
    # Raises InputError where a file that the points are of was replaced; None where they are of none
    check: Callable[[], None] | None = None


def study_of_one(compute: Callable[[bool], xr.Dataset], **more: Any) -> Study:
    """A study that is computed as a whole: its only point says whether it is quick; `more` as of a `Study`."""
    how: Any = {"compute": partial(_whole, compute), "gather": itemgetter(0), **more}
    return Study(points=lambda quick: [{"quick": quick}], **how)


def _whole(compute: Callable[[bool], xr.Dataset], point: Point) -> xr.Dataset:
    return compute(point["quick"])
