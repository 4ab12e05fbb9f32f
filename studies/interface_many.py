"""Very many flights of one scene from Python."""

from __future__ import annotations

import asyncio
import html
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..dynamics.flights.batch import Endings, ensemble as flown
from ..dynamics.motion.state import State
from ..fem.cache import owned
from ..geometry.common import ComputationError, InputError, SpinlevError
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import scene_text
from .catalogue.entries import CATALOGUE
from .catalogue.runner import QUESTION, figures_of, question_study
from .cli.console import heard
from .cli.options import (
    FieldModel,
    InteractionModel,
    Models,
    PlateModel,
    Quantity,
    Workers,
    checked_values,
    combinations,
    finite,
    positive,
)
from .interface import drawn_starts, given_starts
from .levitation import Levitation, given_scene
from .processes import mapped
from .question import Question
from .result import AXIS, variable
from .study import Study
from .sweep import forget, swept

if TYPE_CHECKING:
    from .page.server import Pages

TOGETHER = 512
"""Flights that a worker gets at once, at most."""
COLUMNS = {
    "position": ("m", "position, laboratory frame,"),
    "velocity": ("m/s", "velocity, laboratory frame,"),
    "moment": ("1", "direction of the moment, laboratory frame,"),
    "spin": ("rad/s", "angular velocity, laboratory frame,"),
}


def ensemble(
    scene: Scene | str | Path,
    starts: Mapping[Any, Any] | None = None,
    duration: float = 3.0,
    n: int | None = None,
    seed: int = 0,
    spread: Mapping[str, Any] | None = None,
    model: FieldModel = "auto",
    rtol: float = Models.rtol,
    interaction: InteractionModel = "auto",
    workers: int | None = 1,
    progress: bool = False,
) -> xr.Dataset:
    """How very many flights of one scene end, flown side by side; a plate is an obstacle, its currents are left out.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    starts : dict or xarray.Dataset, optional
        By key of the scene file's `[start]`, three numbers for each flight (n, 3), or three for all: "offset_mm" from
        the stable equilibrium, or "position_mm" with "velocity_mm_s", "moment" and "spin_hz".
    duration : float
        Of each flight, s.
    n : int, optional
        Instead of `starts`: so many flights from about where the scene begins.
    seed : int
        Of the random numbers; the same gives the same flights, to the last bit, with any number of workers.
    spread : dict, optional
        Standard deviations of "offset_mm" (at rest in the turning frame), "velocity_mm_s", "moment_deg" and "spin_hz",
        each one number or three.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field.
    rtol : float
        Relative accuracy asked of the field.
    interaction : {"auto", "rigid", "mutual"}
        Whether rotor and floater magnetise each other.
    workers : int or None
        Processes, None for one a core.
    progress : bool
        Whether messages go to standard error.

    Returns
    -------
    xarray.Dataset
        Over `flight` and `axis`, SI units: `levitated`, `ended_by` ("duration", "contact", "lost"), the state at
        the end and, as ``start_...``, at the beginning, in the laboratory frame as in `simulate`;
        `position_rotor_frame` is where the end is in the frame that turns with the rotor.
        Accuracy: the field errs by 1e-6 of its gradient, steps by round-off.

    Raises
    ------
    InputError
        Starts that are not allowed, with what is.
    EquilibriumError
        A flight shall begin near an equilibrium, and there is none.

    Examples
    --------
    >>> import spinlev as sl
    >>> cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    >>> ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    >>> scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=ball)
    >>> flights = sl.ensemble(scene, {"offset_mm": [[0, 0, 0.1], [0, 0, 9.0]]}, 0.2, model="dipole")
    >>> flights.ended_by.values.tolist()
    ['duration', 'contact']
    """
    positive("duration", duration)
    number = Workers(workers).checked().workers or os.cpu_count() or 1
    with heard(progress):
        levitation = Levitation(scene, Models(model, "none", rtol, interaction=interaction))
        begun = _begun(levitation, starts, n, seed, spread)
        count = len(begun.position)
        together = min(TOGETHER, -(-count // number))
        asked = levitation.scene, levitation.interaction, begun, duration
        found = flown(*asked, map if number == 1 else mapped(number), together)
        drawn = {} if starts is not None else {"seed": seed, "spread": repr(spread)}
        labels = {**levitation.labels, "scene": scene_text(levitation.scene), "duration_s": duration, **drawn}
    return _dataset(begun, found, levitation.scene.angular_velocity).assign_attrs(study="ensemble", **labels)


def _begun(
    levitation: Levitation, starts: Mapping[Any, Any] | None, n: int | None, seed: int, spread: Mapping[str, Any] | None
) -> State:
    if (starts is None) == (n is None):
        raise InputError("Input starts must be given, or n with spread; instead received both or neither.")
    if starts is not None:
        return given_starts(levitation, starts)
    for name, value, least in (("n", n, 1), ("seed", seed, 0)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
            raise InputError(f"Input {name} must be a whole number, {least} at least; instead received {value!r}.")
    return drawn_starts(levitation, int(n or 0), int(seed), spread or {})


def _dataset(begun: State, found: Endings, angular_velocity: float) -> xr.Dataset:
    """Ends in the laboratory, whose axes are the rotor's at t = 0; angular velocity of the rotor, rad/s."""
    dims = ("flight", "axis")
    label = "position, rotor's frame, at the end"
    states = {"position_rotor_frame": variable(dims, found.last.position, "m", label)}
    last = found.last.to_lab(angular_velocity * found.levitated_s)
    for prefix, when, state in (("", " at the end", last), ("start_", " at t = 0", begun)):
        for (name, (unit, label)), values in zip(COLUMNS.items(), state.vectors, strict=True):
            states[prefix + name] = variable(dims, values, unit, label + when)
    ends = {
        "levitated": variable(("flight",), found.levitated_s, "s", "levitation time"),
        "ended_by": (("flight",), found.ended_by),
    }
    return xr.Dataset({**ends, **states}, {"axis": list(AXIS)})


Values = Mapping[str, Sequence[float] | Sequence[str]]


def sweep(
    scene: Scene | str | Path,
    values: Values,
    ask: Quantity = "equilibria",
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    duration: float = 3.0,
    place: Sequence[float] = (0.0, 0.0, -0.02),
    rtol: float = Models.rtol,
    plate_rtol: float = Models.plate_rtol,
    interaction: InteractionModel = "auto",
    workers: int | None = 1,
    scheduler: str | None = None,
    out: str | Path = "out",
    progress: bool = False,
) -> xr.Dataset:
    """Any quantity of a scene over a grid of its parameters; each key becomes a dimension.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    values : dict of str to list
        By key, numbers for keys of the scene file (`frequency_hz`, `rotor.angle_deg`, `plate.center_mm.2`) and for
        `spin`, names for `model`, `plate_model` and `interaction`.
    ask : {"equilibria", "flight", "field"}
        What is computed at each point.
    model, plate_model : str
        Models of the rotor's field and of the plate at all points, unless they are varied.
    spin : float
        Body spin S = Ω·m̂/ω, likewise.
    duration : float
        Simulated time of a flight, s.
    place : sequence of 3 floats
        Where the field is asked for, m, rotor's frame.
    rtol, plate_rtol : float
        Relative accuracy asked of the field and of the plate's reaction.
    interaction : {"auto", "rigid", "mutual"}
        Whether rotor and floater magnetise each other, unless it is varied.
    workers : int or None
        Processes here, None for one a core.
    scheduler : str or None
        Address of a dask scheduler that computes instead.
    out : str or Path
        Folder in which finished points are kept until all are done; the same sweep goes on there.
    progress : bool
        Whether messages and a progress bar go to standard error.

    Returns
    -------
    xarray.Dataset
        Over the keys; points that failed are NaN and named in the attribute `failed_points`.

    Raises
    ------
    InputError
        A key, a value or a model that is not allowed.
    SweepError
        No point could be computed.
    """
    loaded = given_scene(scene)
    models = Models(model, plate_model, rtol, plate_rtol, interaction).checked()
    where = tuple(finite("place", coordinate) for coordinate in place)
    if len(where) != 3:
        raise InputError(f"Input place must be three numbers, m; instead received {place!r}.")
    question = Question(loaded, "scene", ask, models, finite("spin", spin), finite("duration", duration), where)
    grid = checked_values(values)
    with heard(progress):
        return _computed(QUESTION, question_study(question, grid), combinations(grid), (workers, scheduler), out)


def run_study(
    name: str,
    quick: bool = True,
    workers: int | None = 1,
    scheduler: str | None = None,
    out: str | Path = "out",
    progress: bool = False,
) -> xr.Dataset:
    """The result of a study of the catalogue; points finished before an interruption are kept.

    Parameters
    ----------
    name : str
        Name of the study, as `spinlev study --list` has it.
    quick : bool
        Coarser, in less than a minute.
    workers : int or None
        Processes here, None for one a core.
    scheduler : str or None
        Address of a dask scheduler that computes instead.
    out : str or Path
        Folder in which finished points are kept until all are done.
    progress : bool
        Whether messages and a progress bar go to standard error.

    Returns
    -------
    xarray.Dataset
        The study's result, SI units.

    Raises
    ------
    InputError
        The name is unknown.
    SweepError
        No point could be computed.
    """
    if name not in CATALOGUE:
        raise InputError(f"Input name must be one of {', '.join(CATALOGUE)}; instead received {name}.")
    study = CATALOGUE[name]
    with heard(progress):
        return _computed(name, study, study.points(quick), (workers, scheduler), out)


def draw(result: xr.Dataset) -> Mapping[str, Figure]:
    """The figures of a result; a notebook shows them.

    Parameters
    ----------
    result : xarray.Dataset
        Of `equilibria`, `stability`, `simulate`, `sweep`, `run_study`, or read from a file.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        By name.

    Raises
    ------
    InputError
        The result has no figure.
    """
    return figures_of(result)


def _computed(
    name: str, study: Study, points: Sequence[Mapping[str, object]], by: tuple[int | None, str | None], out: str | Path
) -> xr.Dataset:
    with owned(Path(out)):
        result = swept(name, study, dict(enumerate(points)), Workers(*by).checked(), Path(out))
        forget(name, Path(out))
    return result


HEIGHT = 900
"""Of the page in a notebook, pixels."""


class LivePage:
    """A page that is served in the background; in a notebook it shows itself.

    Parameters
    ----------
    pages : the server
    thread : in which it runs
    loop : on which it runs
    """

    def __init__(self, pages: Pages, thread: threading.Thread, loop: asyncio.AbstractEventLoop) -> None:
        self._pages, self._thread, self._loop = pages, thread, loop

    @property
    def address(self) -> str:
        """For a browser on this machine."""
        return self._pages.address

    def stop(self) -> None:
        """Close the page and end its work."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()

    def __repr__(self) -> str:
        return f"LivePage at {self.address}"

    def _repr_html_(self) -> str:
        return f'<iframe src="{html.escape(self.address)}" width="100%" height="{HEIGHT}" style="border:0"></iframe>'


def explore(scene: Scene | str | Path, port: int = 0) -> LivePage:
    """A page in the browser to play with a scene: sliders, equilibria at once, where it levitates, a live flight.

    Parameters
    ----------
    scene : Scene, str or Path
        Where the page begins, or the path of its file.
    port : int
        Port on 127.0.0.1; 0 takes one that is free.

    Returns
    -------
    LivePage
        Shows itself in a notebook; has an `address` for a browser, and `stop`.

    Raises
    ------
    SceneError
        The scene cannot be used.
    ComputationError
        The libraries of the page are missing, or the port is taken.
    """
    loaded, serve = given_scene(scene), page_server()
    source = "scene" if isinstance(scene, Scene) else str(scene)
    begun: Future[tuple[Pages, asyncio.AbstractEventLoop]] = Future()

    def work() -> None:
        loop = asyncio.new_event_loop()
        asyncio.set_event_loop(loop)
        try:
            pages = serve(loaded, source, port=port, framed=True)
        except SpinlevError as error:
            begun.set_exception(error)
        else:
            begun.set_result((pages, loop))
            pages.run()
        loop.close()

    thread = threading.Thread(target=work, name="spinlev explore", daemon=True)
    thread.start()
    pages, loop = begun.result()
    return LivePage(pages, thread, loop)


def page_server() -> Callable[..., Pages]:
    """The function that serves pages.

    Raises
    ------
    ComputationError : its libraries are missing
    """
    try:
        from .page.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("bokeh", "plotly", "tornado"):
            raise
        raise ComputationError(
            f"The page needs {error.name}, which is not installed. Write pip install 'spinlev[explore]' and try again."
        ) from None
    return serve
