"""Equilibria that follow a slider: carried from a scene in which all were searched for to one nearby.

A rotor of the article is a family with frequency and displacement or tilt left open, compiled once. Its size is left
open by similarity.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...dynamics.equilibria.balance import DUPLICATE_DISTANCE, Balance
from ...dynamics.equilibria.curves import SearchRange
from ...dynamics.equilibria.equilibrium import Survey
from ...dynamics.equilibria.path import carried
from ...dynamics.equilibria.search import Found as FoundSearch, field_doubts, told
from ...dynamics.flights.live import LiveFlight, Piece
from ...dynamics.maps.family import RotorFamily, article_measure, rotor_family
from ...dynamics.maps.map import EquilibriumMap, equilibrium_map
from ...dynamics.motion.equations import has_likes, like, parameters
from ...dynamics.motion.floater_currents import check_floater_metal
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.state import Parameter, Scales
from ...fem.rotor.table import ROUND_OFF, RotorTable
from ...fem.rotor_metal import check_slow_enough, pieces_of
from ...geometry.common import Array, SpinlevError
from ...geometry.scene.files import canonical_keys
from ..levitation import Levitation
from .state import MEASURES, QUICK, ROTOR_SIZES, PageState, Shown, content, field_lines, shown


class Nearby:
    """What is known around a scene: its equilibria, and compiled equations that hold for its neighbours.

    Parameters
    ----------
    state : of the page; its plate's currents are left out
    """

    def __init__(self, state: PageState) -> None:
        self.state = state
        self.levitation = _without_plate(state)
        self._family = _family(state)
        self._known: Survey | None = None

    def searched(self) -> Levitation:
        """The scene with all its equilibria, searched for once."""
        if self._known is not None:
            self.levitation.adopt(self._known)
        self._known = self.levitation.without_plate
        return self.levitation

    def learn(self, known: Survey) -> None:
        """Equilibria of the scene that were searched for elsewhere."""
        self._known = known

    def at(self, state: PageState) -> Levitation | None:
        """The scene of another state with equilibria carried to it, or None where they cannot be.

        Raises EquilibriumError for a rotor at rest, as a search does, and InputError where it turns too fast for metal.
        """
        if state.model != self.state.model or not state.scene.frequency or not self.state.scene.frequency:
            return None
        check_floater_metal(state.scene)  # equations are shared, their limits are not
        check_slow_enough(pieces_of(state.scene.rotor, state.scene.conductors), state.scene.frequency)
        levitation = _without_plate(state)
        levitation.share(self.levitation)
        problem, before = self._problem(levitation, state), self._problem(self.levitation, self.state)
        if problem is None or before is None or np.any(state.scene.gravity[:2]):
            return None
        known = self.searched().without_plate.equilibria
        size = self.state.scene.floater.radius
        position = np.reshape([e.position / size for e in known], (-1, 3))
        moment = np.reshape([e.state.moment for e in known], (-1, 3))
        where = SearchRange(state.scene, 0.1)
        which, arrived, position, moment = carried(before.balance, problem.balance, position, moment, where.bound)
        points = np.concatenate([position, moment], axis=1)[np.argsort(which)]
        apart = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(len(points))
        if len(points) < len(known) or not arrived.all() or (apart < DUPLICATE_DISTANCE).any():
            return None
        points = points[where.holds(points[:, :3])]
        there, doubts = self._doubts(levitation, problem, points[:, :3] * state.scene.floater.radius)
        found = FoundSearch.at(problem.balance, points[there], doubts)
        levitation.adopt(told(state.scene, problem.balance, found), searched=False)
        return levitation

    def _doubts(self, levitation: Levitation, problem: _Problem, places: Array) -> tuple[NDArray[np.bool_], Array]:
        """Which places (n, 3) m the table knows, and its doubts there, see `field_doubts`, of the field as compiled."""
        family, measure = problem.family, float(problem.values[Parameter.MEASURE])
        if family is None:
            return field_doubts(levitation.table, places)
        alike = self.levitation.elsewhere(**vars(family.at(levitation.scene.frequency, measure)))
        table, places = alike.table, places * problem.likeness
        there = table.in_range(places)
        assert isinstance(table, RotorTable)  # QUICK ones are
        field, slope = family.field.evaluate(places[there], measure)
        sizes = np.linalg.norm(field, axis=1), np.linalg.norm(slope, axis=(1, 2))
        unsigned, left_out = table.without_left_out.absolute_error(places[there]), table.left_out(places[there])
        errors = np.column_stack(unsigned) + ROUND_OFF * np.column_stack(sizes)
        return there, np.concatenate([errors, left_out.reshape(len(left_out), -1)], axis=1)

    def _problem(self, levitation: Levitation, state: PageState) -> _Problem | None:
        """The balance of a scene in the equations that are compiled here; None where it needs others."""
        scene, spin = levitation.scene, levitation.spin
        if self._family is None:
            if levitation.equations_key != self.levitation.equations_key:
                return None
            values = parameters(scene, Scales.of(scene), frozen_spin=True)
            return _Problem(self.levitation.rates, values, spin, 1.0)
        return self._family.problem(state)


@dataclass(frozen=True, eq=False)
class _Problem:
    """Rates, their parameters, the body spin, how many times larger their scene is than the true one, its family."""

    rates: Rates
    values: Array
    spin: float
    likeness: float
    family: RotorFamily | None = None

    @property
    def balance(self) -> Balance:
        return Balance(self.rates, self.values, self.spin)


@dataclass(frozen=True, eq=False)
class _Family:
    """A family of rotors, and of what else is the same in all scenes for which its equations hold."""

    family: RotorFamily
    configuration: str
    sizes: Array
    rest: str

    def problem(self, state: PageState) -> _Problem | None:
        rotor, scene = state.keys["rotor"], state.scene
        found = article_measure(rotor)
        if found is None or found[0] != self.configuration or _rest(state) != self.rest:
            return None
        ratios = self.sizes / _sizes(rotor)
        likeness = float(ratios[0])
        if likeness != 1 and not (np.allclose(ratios, likeness, rtol=ROUND_OFF, atol=0.0) and has_likes(scene)):
            return None
        measure = found[1] if self.configuration == "tilt" else likeness * found[1]
        family = replace(self.family, scene=like(scene, likeness))
        return _Problem(self.family.rates, family.values(scene.frequency, measure)[0], state.spin, likeness, family)


def _family(state: PageState) -> _Family | None:
    rotor = state.keys["rotor"]
    configuration = rotor.get("configuration")
    round_floater = state.scene.floater.body is None  # of another one, size and shape are compiled
    if configuration not in MEASURES or state.model not in QUICK or not round_floater:
        return None
    try:
        family = rotor_family(replace(state.scene, plate=None), configuration, state.model)
    except SpinlevError:  # conductors that do not move with the magnets
        return None
    return _Family(family, configuration, _sizes(rotor), _rest(state))


def _sizes(rotor: Mapping[str, Any]) -> Array:
    """What makes a body of the rotor as large as it is, mm."""
    return np.array([rotor[key] for key in ROTOR_SIZES if key in rotor])


def _rest(state: PageState) -> str:
    """What no parameter of a family's equations can change."""
    open_ones = (*ROTOR_SIZES, "displacement_mm", "angle_deg")
    rotor = {key: value for key, value in state.keys["rotor"].items() if key not in open_ones}
    return f"{rotor} {state.scene.floater.shape} {bool(state.scene.floater.conductivity)} {state.scene.drag.air}"


def _without_plate(state: PageState) -> Levitation:
    return Levitation(state.scene, replace(state.models, plate_model="none"), state.spin)


FRAME = 1 / 12
"""Seconds between two pictures, if the page draws so fast."""
SLOWEST = 0.25
"""Most seconds that are flown for a picture."""
ENDS = {
    "beyond": "left the region for which the plate's response was computed",
    "contact": "touched the rotor or the plate",
    "lost": "lost: it is too far away to come back",
}


@dataclass(frozen=True)
class Frame:
    """A moment of a flight and what was flown since the last.

    Parameters
    ----------
    time : (n,) s
    height, tilt : (n,) mm and degrees from +z
    position, moment : (3,) now, mm and direction, along the laboratory's axes
    seen : (3,) mm, the same position along the rotor's axes
    angle : of the rotor, rad
    ended : how the flight has ended, in words; empty while it lasts
    message : what was wrong with a wish
    """

    time: Array
    height: Array
    tilt: Array
    position: list[float]
    moment: list[float]
    seen: list[float]
    angle: float
    ended: str = ""
    message: str = ""


def fly(connection: Connection, state: PageState) -> None:
    """Fly a scene's floater by what the page says: ("play", speed), ("pause",), ("drawn",), ("push", m/s), ("put", m).

    After a frame the next one waits until the page has drawn it. A flight or a page that is too slow for its speed
    falls behind; what is shown is always what was flown.
    """
    try:
        flight = Levitation(state.scene, state.models, state.spin).live_flight()
    except SpinlevError as error:
        connection.send(str(error))
        return
    connection.send(_frame(flight, _still(flight)))
    speed, due, drawn = 0.0, time.monotonic(), False
    while True:
        going = speed > 0 and drawn
        if connection.poll(max(0.0, due - time.monotonic()) if going else None):
            message = connection.recv()
            if message[0] == "drawn":
                drawn = True
            elif message[0] == "pause":
                speed = 0.0
            elif message[0] == "play":
                speed, due = message[1], max(due, time.monotonic())
            else:
                connection.send(_wished(flight, *message))
                drawn = False
        elif going:
            now = time.monotonic()
            frame = _flown(flight, speed * min(FRAME + now - due, SLOWEST))
            due, drawn = now + FRAME, False
            speed = 0.0 if frame.ended else speed
            connection.send(frame)


def _flown(flight: LiveFlight, seconds: float) -> Frame:
    try:
        return _frame(flight, flight.onward(seconds))
    except SpinlevError as error:
        return _frame(flight, _still(flight), str(error), ended="stopped: the motion could not be computed")


def _wished(flight: LiveFlight, what: str, vector: list[float]) -> Frame:
    message = ""
    try:
        if what == "push":
            flight.push(np.array(vector))
        else:
            flight.put(np.array(vector))
    except SpinlevError as error:
        message = str(error)
    return _frame(flight, _still(flight), message)


def _still(flight: LiveFlight) -> Piece:
    turned = flight.scene.angular_velocity * flight.time
    lab = flight.now
    row = type(lab)(*(vector[None] for vector in lab.vectors))
    return Piece(np.array([flight.time]), row, turned, flight.log.ended_by)


def _frame(flight: LiveFlight, piece: Piece, message: str = "", ended: str = "") -> Frame:
    places, moments = piece.lab.position, piece.lab.moment
    tilt = np.degrees(np.arctan2(np.hypot(moments[:, 0], moments[:, 1]), moments[:, 2]))
    now = piece.lab.to_rotor(flight.scene.angular_velocity * piece.time)
    words = ENDS.get(piece.ended_by, "")
    said = f"After {flight.time:.3g} s {words}." if words else ended
    return Frame(
        time=piece.time,
        height=1e3 * places[:, 2],
        tilt=tilt,
        position=(1e3 * places[-1]).tolist(),
        moment=moments[-1].tolist(),
        seen=(1e3 * now.position[-1]).tolist(),
        angle=float(np.fmod(piece.angle, 2 * np.pi)),
        ended=said,
        message=message,
    )


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
    whole = canonical_keys(state.scene)
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
