"""What the processes of a page compute, each function in one of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from ...dynamics.maps import EquilibriumMap, equilibrium_map, rotor_family
from ...dynamics.steady import Survey
from ...geometry.basics import Array, SpinlevError
from ...geometry.scenes import scene_keys
from ..one_scene import Levitation
from .downloads import content
from .field_lines import field_lines
from .nearby import Nearby
from .shown import Shown, shown
from .sliders import MEASURES
from .state import QUICK, PageState

POINTS = (13, 41)
"""Of a map along each axis: first, and then."""


@dataclass(frozen=True)
class Found:
    """An answer to a state of a page.

    Parameters
    ----------
    number : of the question
    shown : what the page shows; None where nothing could be found
    message : why not
    lines : field lines, m, where they were asked for
    survey : the equilibria without the plate, all searched for, for neighbours to begin with
    """

    number: int
    shown: Shown | None
    message: str = ""
    lines: tuple[Array, ...] = ()
    survey: Survey | None = None


@dataclass(frozen=True)
class Regions:
    """Where something levitates: 0 nothing, 1 only unstably, 2 stably, (n, m) over frequencies Hz and measures.

    `last`: no finer one follows; with a `message` there is none.
    """

    model: str
    frequencies: Array
    measures: Array
    kind: Array
    message: str = ""
    last: bool = False


def build(connection: Connection, state: PageState) -> None:
    """Make the states that the page's reader asks for, each of the last: (name of a method of `PageState`, arguments).

    To each comes (that name, state or None, message).
    """
    while True:
        method, arguments = connection.recv()
        try:
            state = getattr(state, method)(*arguments)
            state.keys  # noqa: B018  # travels with it: the page's own process does not look for overlaps
            connection.send((method, state, ""))
        except SpinlevError as error:
            connection.send((method, None, str(error)))


def follow(connection: Connection) -> None:
    """Answer to states of the page, as soon as can be; (number, state, survey): None where a survey is learnt."""
    nearby: Nearby | None = None
    while True:
        number, state, known = connection.recv()
        if known is not None:
            nearby = Nearby(state)
            nearby.learn(known)
            nearby.at(state)  # what is compiled later would be waited for
            connection.send(None)
            continue
        try:
            there = None if nearby is None else nearby.at(state)
            if there is None:
                nearby = Nearby(state)
                there = nearby.searched()
            connection.send(Found(number, shown(there)))
        except SpinlevError as error:
            connection.send(Found(number, None, str(error)))


def complete(connection: Connection, number: int, state: PageState) -> None:
    """All equilibria by the models asked for, as the command line finds them, and the field's lines."""
    try:
        levitation = Levitation(state.scene, state.models, state.spin)
        without = levitation.without_plate
        found = shown(levitation)
    except SpinlevError as error:
        connection.send(Found(number, None, str(error)))
        return
    lines = field_lines(state.scene, _field(levitation))
    connection.send(Found(number, found, lines=tuple(lines), survey=without))


def _field(levitation: Levitation) -> Callable[[Array], Array]:
    """The field at points (n, 3) m, zero inside the magnets, for lines as thick as they are drawn.

    Tables by finite elements and maps do not reach to the magnets: there the closed form does, which is off by 2 %.
    """
    table = levitation.table if levitation.table.model in QUICK else levitation.field("cuboid")

    def field(points: Array) -> Array:
        b, known = np.zeros((len(points), 3)), table.in_range(points)
        if known.any():
            b[known] = table.evaluate(points[known])[0]
        return b

    return field


def regions(connection: Connection, state: PageState, spans: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """Maps of where something levitates, first by a dipole and coarse; spans in Hz, and mm or degrees."""
    configuration = state.keys["rotor"]["configuration"]
    unit = np.radians(1.0) if configuration == "tilt" else 1e-3
    models = ["dipole", *(["cuboid"] if state.model == "cuboid" else [])]
    for model in models:
        for points in POINTS:
            axes = np.linspace(*spans[0], points), np.linspace(*spans[1], points)
            try:
                family = rotor_family(state.scene, configuration, model)
                found = equilibrium_map(family, axes[0], axes[1] * unit, state.spin)
            except (SpinlevError, ValueError) as error:
                connection.send(Regions(model, *axes, np.zeros((points, points), np.uint8), str(error), last=True))
                return
            last = (model, points) == (models[-1], POINTS[-1])
            connection.send(Regions(model, *axes, _kind(found), last=last))


def _kind(found: EquilibriumMap) -> Array:
    every, stable = found.number
    return np.asarray((every > 0).astype(np.uint8) + (stable > 0))


def has_map(state: PageState) -> bool:
    """Whether a scene's rotor has a measure for a map's second axis, and its equilibria are fixed points."""
    known = state.keys["rotor"].get("configuration") in MEASURES
    return known and not np.any(state.scene.gravity[:2])


def map_key(state: PageState) -> str:
    """All that a map depends on: neither its own axes, nor the plate, nor where a flight begins."""
    whole = scene_keys(replace(state.scene, text=""))  # with every key, whatever the scene's file left out
    keys = {key: value for key, value in whole.items() if key not in ("frequency_hz", "plate", "start")}
    open_ones = ("displacement_mm", "angle_deg")
    keys["rotor"] = {key: value for key, value in keys["rotor"].items() if key not in open_ones}
    return f"{keys} {state.spin} {state.model == 'cuboid'}"


def download(connection: Connection, kind: str, state: PageState, extra: Any) -> None:
    """The content of a file, or why there is none."""
    try:
        connection.send((kind, content(kind, state, extra), ""))
    except SpinlevError as error:
        connection.send((kind, b"", str(error)))
