"""One's own question: any quantity of a scene over any of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr

from ...dynamics.flights import flight_kind
from ...dynamics.motion import PlateMemory
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene, parse_scene
from ..results import AXIS, Point, found_dataset, variable
from ..terminal import Quantity, Tables
from .answers import flight_answer
from .shelf import Shelf
from .single import fly, surveyed


@dataclass(frozen=True)
class Question:
    """What is asked at every point.

    Parameters
    ----------
    text, source : the scene file's content and name
    ask : the quantity
    tables : which tables are asked for
    spin : body spin of the equilibria
    duration : of a flight, s
    place : of the field, m, rotor's frame
    """

    text: str
    source: str
    ask: Quantity
    tables: Tables
    spin: float
    duration: float
    place: tuple[float, ...]

    @property
    def settings(self) -> Point:
        """The same in types that JSON knows."""
        return asdict(self)

    def scene(self, point: Point) -> Scene:
        """The scene of a point. Raises SceneError."""
        return parse_scene(self.text, self.source, point)

    def __call__(self, point: Point) -> xr.Dataset:
        """The answer at a point: a dataset over `case`, whose coordinates are the values varied."""
        scene = self.scene(point)
        answer = ANSWERS[self.ask](self, scene, Shelf(scene, self.tables))
        return answer.expand_dims("case").assign_coords({key: ("case", [value]) for key, value in point.items()})

    def gather(self, parts: Sequence[xr.Dataset], values: Mapping[str, Sequence[float]]) -> xr.Dataset:
        """The points on the grid of the values; NaN where a point failed or has fewer equilibria than another."""
        joined = xr.concat(parts, "case", data_vars="all", coords="different", compat="equals", join="outer")
        grid = joined.set_index(case=list(values))
        grid = grid.unstack("case") if len(values) > 1 else grid.rename(case=next(iter(values)))
        joined = grid.reindex({key: list(chosen) for key, chosen in values.items()})
        for name, column in joined.data_vars.items():
            if column.dtype == object:
                joined[name] = column.fillna("").astype(str)
        for key in values:
            joined[key].attrs["long_name"] = key
        return joined.assign_attrs(scene=self.text, ask=self.ask, varied=list(values), **_asked(self.tables))


def _asked(tables: Tables) -> dict[str, str | float]:
    return {f"asked_{name}": value for name, value in asdict(tables).items()}


def _equilibria(question: Question, scene: Scene, shelf: Shelf) -> xr.Dataset:
    table = shelf.table()
    found, memory = surveyed(shelf, table, question.spin)
    return found_dataset(found.equilibria).assign_attrs(_models(table, memory))


def _flight(question: Question, scene: Scene, shelf: Shelf) -> xr.Dataset:
    table = shelf.table()
    found, memory = surveyed(shelf, table)
    table = shelf.in_flight(table, memory, found.equilibria)
    flight = fly(scene, table, question.duration, found.equilibria, memory)
    answer = flight_answer(table, flight, memory)
    height = flight.lab.position[:, 2]
    return xr.Dataset(
        {
            "levitated": variable((), answer["levitated_s"], "s", "levitation time"),
            "ended_by": ((), answer["ended_by"]),
            "kind": ((), flight_kind(flight)),
            "mean_height": variable((), height.mean(), "m", "mean height"),
            "height_spread": variable((), np.ptp(height), "m", "highest less lowest height"),
            "energy_error": variable((), answer["energy_error"], "1", "violation of the energy ledger"),
        },
        attrs=_models(table, memory),
    )


def _models(table: FieldTable, memory: PlateMemory | None) -> dict[str, str]:
    return {"model": table.model, "plate_model": memory.model if memory else "none"}


def _field(question: Question, scene: Scene, shelf: Shelf) -> xr.Dataset:
    table, place = shelf.table(), np.array(question.place)[None]
    b, gradient = (values[0] for values in table.evaluate(place))
    errors: list[Array] = [values[0] for values in table.relative_error(place)]
    return xr.Dataset(
        {
            "B": variable(("axis",), b, "T", "flux density"),
            "dB": variable(("axis", "along"), gradient, "T/m", "its derivatives"),
            "B_error": variable((), errors[0], "1", "estimated relative error of B"),
            "dB_error": variable((), errors[1], "1", "estimated relative error of its derivatives"),
        },
        {"axis": list(AXIS), "along": list(AXIS)},
        {"model": table.model},
    )


ANSWERS: Mapping[Quantity, Callable[[Question, Scene, Shelf], xr.Dataset]] = {
    "equilibria": _equilibria,
    "flight": _flight,
    "field": _field,
}
