"""What is computed for a page, each kind of work by a process of its own: it can be stopped, and ends with the page."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import tempfile
import threading
from collections.abc import Callable, Hashable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tornado.ioloop import IOLoop

from ...dynamics.continuation.map import equilibrium_map
from ...dynamics.continuation.rotor_family import rotor_family
from ...dynamics.equilibria.search import survey
from ...dynamics.flights.live import LiveFlight, Piece
from ...geometry.common import Array, ComputationError, SpinlevError
from ...geometry.scene.files import canonical_keys, scene_text
from ..cli.console import to_json
from ..cli.options import Models
from ..figures.pictures import drawn_field
from ..figures.style import PAGE, PALETTE, figure_bytes, panels, styled
from ..figures.view import field_lines
from ..levitation import Levitation
from ..processes import safe_path
from ..result import Result, write_dataset
from ..words import equilibria_rows, headline, left_out_words, worth_a_row
from .state import MEASURES, PageState

if TYPE_CHECKING:
    from bokeh.document import Document
    from matplotlib.figure import Figure

MEMORY = 4 * 2**30  # Bytes that a process may take
PATIENCE = 10  # By how much a process is nicer than others that does not hurry
SIGHT = np.array([[-0.045], [0.045]]) * np.ones(3)  # The box in which field lines are drawn, m
ENDS = {
    "beyond": "left the region for which the plate's response was computed",
    "contact": "touched the rotor or the plate",
    "lost": "lost: it is too far away to come back",
}
MODEL_WORDS = {
    "dipole": "point dipole",
    "cuboid": "closed form of the cuboids",
    "fem": "finite elements",
    "map": "map of the field",
}
PLATE_WORDS = {"none": "without the plate's currents", "slab": "plate as an infinite slab"}
PLATE_WORDS |= dict.fromkeys(("reduced", "fem"), "finite plate")
MODE_COLUMNS = ("small motion", "frequency (Hz)", "growth (1/s)")
FILES = {
    "toml": ("scene.toml", "text/plain"),
    "json": ("equilibria.json", "application/json"),
    "nc": ("equilibria.nc", "application/x-netcdf"),
    "png": ("explore.png", "image/png"),
}  # What can be taken home: a file's name and its type


@cache
def context() -> ForkServerContext:
    """Processes are copies of one that loads the numeric libraries from now on, and begin in hundredths of a second."""
    found = multiprocessing.get_context("forkserver")
    found.set_forkserver_preload([__name__])
    with safe_path():
        resource_tracker.ensure_running()
        forkserver.ensure_running()
    return found


class Worker:
    """A process that does one kind of work for a page, one thing after the other.

    Parameters
    ----------
    document : of the page, in whose turn answers are received
    words, seconds : what the work is, and after how long it is cut off; what takes longer is for the command line
    failed : is told in a sentence why there is no answer
    patience : by how much others go first
    """

    def __init__(
        self, document: Document, words: str, seconds: float, failed: Callable[[str], None], patience: int = 0
    ) -> None:
        self.document, self.words, self.seconds, self.failed, self.patience = document, words, seconds, failed, patience
        self.process: ForkServerProcess | None = None
        self._waiting: dict[Hashable, tuple[Callable[[], tuple[Any, ...]], Callable[[Any], None]]] = {}
        self._receive: Callable[[Any], None] | None = None
        self._limit: Any = None

    @property
    def busy(self) -> bool:
        """Whether an answer is still to come."""
        return self._receive is not None

    @property
    def waits(self) -> bool:
        """Whether a question still waits for its turn."""
        return bool(self._waiting)

    def ask(self, key: Hashable, call: Callable[[], tuple[Any, ...]], receive: Callable[[Any], None]) -> None:
        """Compute something when its turn comes.

        Parameters
        ----------
        key : an older question with this key that still waits is left out
        call : gives the function and its arguments when the turn has come
        receive : gets the answer
        """
        self._waiting.pop(key, None)
        self._waiting[key] = call, receive
        self._go_on()

    def stop(self) -> None:
        """End the process, whatever it is doing, and forget all questions."""
        self._waiting.clear()
        self._rest()
        # First of all: a signal may come in between, and who stops everything then must not find half of it.
        process, self.process = self.process, None
        if process is not None:
            self._loop.remove_handler(self._connection.fileno())
            self._connection.close()
            process.kill()
            process.join()
            process.close()

    def _go_on(self) -> None:
        if self.busy or not self._waiting:
            return
        if self.process is None:
            self._begin()
        call, self._receive = self._waiting.pop(next(iter(self._waiting)))
        self._limit = self._loop.call_later(self.seconds, self._say, self.process, self._cut_off)
        with suppress(BrokenPipeError, ConnectionResetError):  # it has ended, as `_listen` will find
            self._connection.send(call())

    def _begin(self) -> None:
        self._loop = IOLoop.current()
        self._connection, other = context().Pipe()
        process = context().Process(target=_serve, args=(other, self.patience), daemon=True)
        # A signal stops the main thread anywhere; a process that begins and is not told its task says so at length.
        with ThreadPoolExecutor(1) as beside:
            beside.submit(process.start).result()
        other.close()
        self.process = process
        self._loop.add_handler(self._connection.fileno(), partial(self._listen, process), IOLoop.READ)

    def _listen(self, process: ForkServerProcess, *_: object) -> None:
        try:
            answer, problem = self._connection.recv()
        except (EOFError, ConnectionError):
            self.stop()
            why = "A computation was ended from outside; memory may be short."
            self.document.add_next_tick_callback(lambda: self.failed(why))
            return
        self._say(process, lambda: self._answered(answer, problem))

    def _say(self, process: ForkServerProcess | None, what: Callable[[], None]) -> None:
        """In the document's turn, if the process is still the same."""
        self.document.add_next_tick_callback(lambda: what() if self.process is process else None)

    def _answered(self, answer: Any, problem: str) -> None:
        receive = self._rest()
        if problem:
            self.failed(problem)
        elif receive is not None:
            receive(answer)
        self._go_on()
        if self.patience and not self.busy:  # gives its memory back; another one begins in hundredths of a second
            self.stop()

    def _rest(self) -> Callable[[Any], None] | None:
        if self._limit is not None:
            self._loop.remove_timeout(self._limit)
        receive, self._receive, self._limit = self._receive, None, None
        return receive

    def _cut_off(self) -> None:
        self.stop()
        self.failed(f"{self.words} took longer than {self.seconds:g} s and was cut off.")


def _serve(connection: Connection, patience: int) -> None:
    os.nice(patience)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            function, *arguments = connection.recv()
            answer, problem = None, ""
            try:
                answer = function(*arguments)
            except SpinlevError as error:
                problem = str(error)
            except Exception as error:  # the last resort: the page says it
                problem = f"The computation failed: {type(error).__name__}: {error}."
            connection.send((answer, problem))
        except (EOFError, BrokenPipeError, ConnectionResetError):  # the page has gone
            return


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def build(state: PageState, method: str, arguments: tuple[Any, ...]) -> PageState:
    """Another state, by a method of `PageState`."""
    made: PageState = getattr(state, method)(*arguments)
    made.keys  # noqa: B018  # travels with it: the page's own process does not look for overlaps
    return made


@dataclass(frozen=True)
class Shown:
    """The numbers of a scene by some models."""

    headline: str  # where the floater floats and whether it stays there
    rows: list[tuple[str, ...]]  # of the table of equilibria, the head first; as the command line prints them
    modes: list[tuple[str, ...]]  # of the eigenvalues of the first equilibrium, the head first
    sign: str  # by which models
    places: list[tuple[list[float], list[float]]]  # position mm and direction of the moment at t = 0 of each
    left_out: list[str]  # which solutions are no equilibria, or not known to be, in sentences
    lines: list[Array] = field(default_factory=list)  # of the field, m, where they were asked for


def preview(state: PageState) -> Shown:
    """All equilibria by what can be told while a slider moves: the point dipole without the plate's currents."""
    models = Models("map" if state.model == "map" else "dipole", "none")
    levitation = Levitation(state.scene, models, state.spin)
    # Not from the cache, which would get a file for every step of a slider.
    levitation.adopt(survey(state.scene, levitation.interaction, state.spin, rates=levitation.rates))
    return _shown(levitation)


def complete(state: PageState) -> Shown:
    """All equilibria by the models asked for, as the command line finds them, and the field's lines."""
    levitation = Levitation(state.scene, state.models, state.spin)
    found = _shown(levitation)
    known = drawn_field(state.scene, levitation.table)
    lines = field_lines(state.scene, lambda points: np.nan_to_num(known(points)), *SIGHT)
    return replace(found, lines=[line[::2] for line in lines])


def _shown(levitation: Levitation) -> Shown:
    found, left_out = levitation.equilibria, levitation.survey.left_out
    useful = worth_a_row(found)
    felt = levitation.plate.model if levitation.plate is not None else "none"
    plate = f", {PLATE_WORDS[felt]}" if levitation.scene.plate is not None else ""
    mutual = ", rotor and floater magnetise each other" if levitation.interaction_model == "mutual" else ""
    modes = [(m.name, f"{m.frequency_hz:.6g}", f"{m.growth_per_s:.6g}") for m in useful[0].modes] if useful else []
    return Shown(
        headline=headline(levitation, found, left_out),
        rows=equilibria_rows(levitation, found),
        modes=[MODE_COLUMNS, *modes] if useful else [],
        sign=f"{MODEL_WORDS.get(levitation.table.model, levitation.table.model)}{mutual}{plate}",
        places=[((1e3 * e.start.position).tolist(), e.start.moment.tolist()) for e in useful],
        left_out=left_out_words(levitation, left_out),
    )


@dataclass(frozen=True)
class Regions:
    """Where something levitates: 0 nothing, 1 only unstably, 2 stably, (n, m) over frequencies Hz and measures."""

    model: str
    frequencies: Array
    measures: Array
    kind: Array


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


def regions(
    state: PageState, spans: tuple[tuple[float, float], tuple[float, float]], model: str, points: int
) -> Regions:
    """A map of where something levitates.

    Parameters
    ----------
    state : gives all but frequency and measure of the rotor
    spans : of the frequency, Hz, and of the measure, mm or degrees
    model, points : of the field, and along each axis
    """
    configuration = state.keys["rotor"]["configuration"]
    frequencies, measures = (np.linspace(*span, points) for span in spans)
    unit = np.radians(1.0) if configuration == "tilt" else 1e-3
    try:
        family = rotor_family(state.scene, configuration, model)
        every, stable = equilibrium_map(family, frequencies, measures * unit, state.spin).number
    except ValueError as error:
        raise ComputationError(str(error)) from None
    return Regions(model, frequencies, measures, np.asarray((every > 0).astype(np.uint8) + (stable > 0)))


@dataclass(frozen=True)
class Frame:
    """A moment of a flight and what was simulated since the last."""

    time: Array  # (n,) s
    height: Array  # (n,) mm
    tilt: Array  # (n,) degrees from +z
    position: list[float]  # (3,) now, mm, along the laboratory's axes
    moment: list[float]  # (3,) now, its direction
    seen: list[float]  # (3,) mm, the same position along the rotor's axes
    angle: float  # of the rotor, rad
    ended: str = ""  # how the flight has ended, in words; empty while it lasts
    message: str = ""  # what was wrong with a wish


_flights: list[LiveFlight] = []  # The one of this process


def begin_flight(state: PageState) -> Frame:
    """The first frame of a flight."""
    _flights[:] = [Levitation(state.scene, state.models, state.spin).live_flight()]
    return _frame(_still())


def fly(seconds: float) -> Frame:
    """The flight, so much later."""
    try:
        return _frame(_flights[0].onward(seconds))
    except SpinlevError as error:
        return replace(_frame(_still()), message=str(error), ended="stopped: the motion could not be computed")


def wish(what: str, vector: list[float]) -> Frame:
    """The flight after its floater got a "push", m/s, or was "put" elsewhere, m."""
    try:
        getattr(_flights[0], what)(np.array(vector))
    except SpinlevError as error:
        return replace(_frame(_still()), message=str(error))
    return _frame(_still())


def _still() -> Piece:
    flight = _flights[0]
    lab = type(flight.now)(*(vector[None] for vector in flight.now.vectors))
    return Piece(np.array([flight.time]), lab, flight.scene.angular_velocity * flight.time, flight.ended_by)


def _frame(piece: Piece) -> Frame:
    flight = _flights[0]
    places, moments = piece.lab.position, piece.lab.moment
    now = piece.lab.to_rotor(flight.scene.angular_velocity * piece.time)
    words = ENDS.get(piece.ended_by, "")
    return Frame(
        time=piece.time,
        height=1e3 * places[:, 2],
        tilt=np.degrees(np.arctan2(np.hypot(moments[:, 0], moments[:, 1]), moments[:, 2])),
        position=(1e3 * places[-1]).tolist(),
        moment=moments[-1].tolist(),
        seen=(1e3 * now.position[-1]).tolist(),
        angle=float(np.fmod(piece.angle, 2 * np.pi)),
        ended=f"After {flight.time:.3g} s {words}." if words else "",
    )


@dataclass(frozen=True)
class Screen:
    """What is on a page's screen."""

    shown: Shown | None
    regions: Regions | None
    axes: tuple[str, str]  # names of frequency and measure
    point: tuple[float, float]  # what they are now
    time: Array  # of the flight so far, s
    height: Array  # mm
    tilt: Array  # degrees


def content(kind: str, state: PageState, screen: Screen | None = None) -> bytes:
    """The content of a file of `FILES`, which the command line computes alike; `screen` for a picture of it.

    Raises
    ------
    SpinlevError : the scene has no answer
    """
    if kind == "toml":
        return scene_text(state.scene).encode()
    if kind == "png":
        assert screen is not None
        return figure_bytes(screen_figure(screen, state), "png")
    levitation = Levitation(state.scene, state.models, state.spin)
    result = Result(levitation, levitation.survey)
    if kind == "json":
        answer: dict[str, Any] = {**result.summary, "tables_from_cache": levitation.from_cache}
        return f"{to_json(answer)}\n".encode()
    dataset = result.dataset().assign_attrs(study="equilibria")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "equilibria.nc"
        write_dataset(dataset, path, state.scene)
        return path.read_bytes()


@styled
def screen_figure(screen: Screen, state: PageState) -> Figure:
    """Map, running plots and the headline."""
    from matplotlib.colors import ListedColormap

    figure, ((chart, height), (words, tilt)) = panels(2, 2, (PAGE, 4.6))
    words.set_title("")
    said, lines = "No equilibrium is known.", []
    if (known := screen.shown) is not None:
        said, lines = known.headline, [f"By: {known.sign}", f"spinlev equilibria scene.toml {state.command}"]
        for table in (known.rows, known.modes):
            widths = [max(map(len, column)) for column in zip(*table, strict=False)]
            lines += ["", *(" ".join(map(str.rjust, row[:4], widths)) for row in table)]
    figure.suptitle(said, fontsize=8, x=0.01, ha="left", wrap=True)
    words.text(0, 1, "\n".join(lines), va="top", fontsize=6, family="monospace")
    words.set_axis_off()
    if (mapped := screen.regions) is None:
        chart.set_axis_off()
    else:
        look: dict[str, Any] = {"cmap": ListedColormap(["white", "#D8DEE9", PALETTE[5]]), "vmin": 0, "vmax": 2}
        chart.pcolormesh(mapped.frequencies, mapped.measures, mapped.kind.T, rasterized=True, **look)
        chart.plot(*screen.point, "o", color=PALETTE[1])
        chart.set(xlabel=screen.axes[0], ylabel=screen.axes[1], title=f"(a) stable regions ({mapped.model})")
    for axes, values, label in ((height, screen.height, "Height (mm)"), (tilt, screen.tilt, "Tilt of the moment (°)")):
        axes.plot(screen.time, values)
        axes.set(xlabel="Time (s)", ylabel=label)
        if not len(values):
            axes.text(0.5, 0.5, "no flight yet", transform=axes.transAxes, ha="center", color="grey")
    return figure
