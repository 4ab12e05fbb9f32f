"""The functions behind `import spinlev as sl`, which return labelled data."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..dynamics.motion.plate import PlateMemory
from ..fem.cache import owned
from ..fem.rotor.near_field import NEAR_RTOL, complete
from ..fem.rotor.table import FieldTable, RotorTable
from ..geometry.common import ComputationError, InputError
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import driven, scene_text
from .catalogue.entries import CATALOGUE
from .catalogue.runner import figures_of, question_study
from .cli import options
from .cli.console import missing_extra
from .cli.options import FieldModel, InteractionModel, Models, PlateModel, Quantity, Requested, Workers, documented
from .compare import compared, compared_dataset, field_rtol
from .fields import PLANES, field_map as plane_map, working_point_dataset
from .figures.run import scene_figure
from .figures.style import FigureWidth, figures_across
from .levitation import Levitation
from .other_motions import coils_summary, modes_of, several, several_dataset
from .plan import SceneLike, given_scene
from .question import Question
from .result import AXIS, Result, found_dataset, state_columns, variable
from .starts import drawn_starts, endings, given_starts
from .study import Point, Study
from .sweep import forget, swept

if TYPE_CHECKING:
    from .page.server import LivePage


@documented
def equilibria(
    scene: SceneLike,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """All synchronous equilibria, the stable ones first, with errors, growth rate and frequency of each mode.

    Returns
    -------
    xarray.Dataset
        Over `equilibrium`, `mode` and `axis`, SI units; attribute `left_out` names the solutions that are no equilibria
        of the scene, or are not known to be.

    Raises
    ------
    EquilibriumError
        The rotor is at rest and the floater does not spin about its moment.
    """
    levitation = Levitation(scene, Models(model, plate_model, **requested), spin)
    return Result(levitation, levitation.survey).dataset()


@documented
def compare(
    scene: SceneLike,
    frequencies_hz: Sequence[float] | None = None,
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    rtol: float | None = None,
    plate_rtol: float = Models.plate_rtol,
    progress: bool | None = None,
) -> xr.Dataset:
    """Every field model's results for one scene, under the same conditions: may the point dipole be used for it?

    Parameters
    ----------
    frequencies_hz : sequence of float, optional
        (n,) of the rotor, Hz, for the branches; left out: about the stable ones.

    Returns
    -------
    xarray.Dataset
        Over `model` (dipole; dipole of the true moment; cuboid with μr = 1; finite elements; with mutual magnetisation)
        and, for the branch on which the floater levitates, over `frequency` (Hz): distance (m), polar angle (°), growth
        rate (1/s), range of stable frequencies (Hz). NaN where a model has no such equilibrium.

    Raises
    ------
    EquilibriumError
        The rotor is at rest.

    Examples
    --------
    >>> found = sl.compare(scene, [120.0, 130.0], rtol=1e-3)
    >>> (1e3 * found.distance.sel(model=["dipole", "cuboid"])).round(2).values.tolist()
    [18.83, 19.1]
    """
    name = "frequencies_hz"
    grid = None if frequencies_hz is None else np.array(options.checked_values({name: frequencies_hz})[name])
    if grid is not None and grid.min() <= 0:
        raise InputError(f"Input frequencies_hz must be positive; instead received {grid.min():g}.")
    known = given_scene(scene)
    found = field_rtol(known) if rtol is None else rtol
    requested = Models(plate_model=plate_model, rtol=found, plate_rtol=plate_rtol).checked()
    return compared_dataset(known, compared(known, requested, spin), grid)


@documented
def stability(
    scene: SceneLike,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """The five modes of the equilibrium at which a trajectory begins, the nearest stable one if there is one.

    Returns
    -------
    xarray.Dataset
        Over `mode` ("bounce", the axial mode; "side, backward" and "side, forward", the lateral whirl modes; precession
        and nutation): growth rate (1/s; negative where it decays) and frequency (Hz, rotor's frame); `stable`,
        `growth` and `growth_error` (from round-off) of the whole.

    Raises
    ------
    EquilibriumError
        There is no equilibrium to begin at.
    """
    levitation = Levitation(scene, Models(model, plate_model, **requested), spin)
    found = found_dataset((levitation.stability,)).isel(equilibrium=0, drop=True).drop_vars("number")
    return found.assign_attrs(study="stability", **levitation.about)


@documented
def simulate(
    scene: SceneLike,
    duration_s: float,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    progress: bool | None = None,
    drive: Sequence[Mapping[str, Any]] | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """Trajectory of the floater from where the scene says.

    Parameters
    ----------
    duration_s : float
        Simulated time, s.
    drive : list of dict, optional
        Steps of the rotor's frequency in place of the scene's: "to_hz" or "stop" (True) with "in_s", or "hold_s".

    Returns
    -------
    xarray.Dataset
        Over `time`, SI units, of several floaters over `floater`, too; how it ended and the violation of the energy
        balance are attributes. With a drive also the frequency, torque, power and work of the motor, and the
        equilibria at steady frequencies.

    Raises
    ------
    EquilibriumError
        The scene starts from an equilibrium and has none.
    """
    given = given_scene(scene)
    if given.carried_by_coils:
        modes, _ = modes_of(given, requested.get("plate_rtol", 1e-3))
        return coils_summary(given, duration_s, modes)[0]
    given = given if drive is None else driven(given, drive)
    if given.companions:
        together = several(given, Models(model, plate_model, **requested).checked(), duration_s)
        return several_dataset(*together).assign_attrs(scene=scene_text(given))
    levitation = Levitation(given, Models(model, plate_model, **requested))
    return Result(levitation, flight=levitation.flight(duration_s)).dataset()


@documented
def rotor_table(
    scene: SceneLike, model: FieldModel = "auto", rtol: float = Models.rtol, progress: bool | None = None
) -> FieldTable:
    """The rotor's field as a table, accurate to `rtol` wherever the floater can be.

    Returns
    -------
    FieldTable
        Its `evaluate(points)` gives B (..., 3) T and its gradient (..., 3, 3) T/m at points (..., 3) m, rotor's frame,
        `relative_error(points)` the estimated errors. With "cuboid" and "fem" also in the magnets, in gaps and at
        faces, there to `rtol` or 1e-4 of the remanence, whichever is more; `fields(points)` has H and M, too.

    Raises
    ------
    AccuracyError
        The accuracy cannot be reached.
    InputError
        An argument or a file that cannot be used; of `evaluate`, a point on an edge of a magnet.
    """
    table = Levitation(scene, Models(model, rtol=rtol)).table
    return complete(table, max(rtol, NEAR_RTOL)) if isinstance(table, RotorTable) else table


@documented
def field_map(
    scene: SceneLike,
    plane: Literal["xy", "xz", "yz"] = "xz",
    extent_mm: Sequence[float] | None = None,
    offset_mm: float = 0.0,
    steps: int = 121,
    progress: bool | None = None,
) -> xr.Dataset:
    """B, H and M on a plane through or beside the rotor, by dipole, closed form and finite elements.

    Parameters
    ----------
    plane : {"xz", "xy", "yz"}
        Across and up, in the rotor's frame at t = 0.
    extent_mm : sequence of 4 floats, optional
        Left, right, lower and upper end, mm; left out: twice the rotor's size.
    offset_mm : float
        Third coordinate, mm.
    steps : int
        Points along the longer side, 5 to 1001.

    Returns
    -------
    xarray.Dataset
        Over `model`, the two coordinates of the plane (m) and `component`: `B` (T), `H`, `M` (A/m), the relative
        `difference` from the finite elements, their stated `error` (T), and the number of the `magnet` at a place.
    """
    if plane not in PLANES:
        raise InputError(f"Input plane must be one of {', '.join(PLANES)}; instead received {plane}.")
    options.check_between("steps", steps, options.STEPS, whole=True)
    ends = None if extent_mm is None else 1e-3 * np.array([options.finite("extent_mm", end) for end in extent_mm])
    if ends is not None and not (len(ends) == 4 and ends[0] < ends[1] and ends[2] < ends[3]):
        said = "left, right, lower and upper end in rising order, mm"
        raise InputError(f"Input extent_mm must be {said}; instead received {extent_mm}.")
    return plane_map(given_scene(scene), plane, ends, 1e-3 * options.finite("offset_mm", offset_mm), steps)


@documented
def plate_table(
    scene: SceneLike,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> PlateMemory | None:
    """The plate's currents around the place where the floater levitates.

    Returns
    -------
    PlateMemory or None
        Its `table` holds the network, `share` what the rotor drives, `error` the estimated relative error; None where
        no currents are modelled.
    """
    return Levitation(scene, Models(model, plate_model, **requested)).plate


@documented
def working_point(
    scene: SceneLike,
    model: FieldModel = "auto",
    rtol: float = Models.rtol,
    interaction: InteractionModel = "auto",
    progress: bool | None = None,
) -> xr.Dataset:
    """The lowest μ0 H along each magnet's easy axis, with the floater where it levitates, against the knee.

    Frequency-locked, the floater's field in the magnets is the same all over a turn; `lowest_turning` is the
    lowest if the floater lags by up to a whole turn. No hysteresis: parts below the knee are reported, not followed.
    The models place the floater; in the magnets the field is of finite elements, mutual magnetisation included.
    On an edge it can be infinite; `lowest` keeps 2 % of the edge of a cube of the magnet's volume off all edges.

    Returns
    -------
    xarray.Dataset
        Over `magnet` (numbered from 1), SI units: `lowest` T with `place` and `error`, `knee`, `share_below` (of the
        volume), `levels` (the field over the volume), and a `section` through each magnet.

    Raises
    ------
    InputError
        No magnet has a polarisation, or an argument or a file cannot be used.
    """
    return working_point_dataset(Levitation(scene, Models(model, rtol=rtol, interaction=interaction)))


@documented
def ensemble(
    scene: SceneLike,
    starts: Mapping[Any, Any] | None = None,
    duration_s: float = 3.0,
    n: int | None = None,
    seed: int = 0,
    spread: Mapping[str, Any] | None = None,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    rtol: float = Models.rtol,
    plate_rtol: float = Models.plate_rtol,
    interaction: InteractionModel = "auto",
    workers: int | None = 1,
    progress: bool | None = None,
) -> xr.Dataset:
    """Endings of very many trajectories of one scene, in SIMD batches.

    Parameters
    ----------
    starts : dict or xarray.Dataset, optional
        By key of the scene file's `[start]`, three numbers for each trajectory (n, 3), or three for all: "offset_mm"
        from the stable equilibrium, or "position_mm" with "velocity_mm_s", "moment", "spin_hz" and "body_x".
    duration_s : float
        Of each trajectory, s.
    n : int, optional
        Instead of `starts`: so many trajectories from about where the scene begins.
    seed : int
        Of the random numbers; the same gives the same trajectories, to the last bit, with any number of workers.
    spread : dict, optional
        Standard deviations of "offset_mm" (at rest in the turning frame), "velocity_mm_s", "moment_deg" and "spin_hz",
        each one number or three.

    Returns
    -------
    xarray.Dataset
        Over `flight` and `axis`, SI units: `levitated`, `ended_by` ("duration", "contact", "lost"), the state at
        the end and, as ``start_...``, at the beginning, in the laboratory frame as in `simulate`;
        `position_rotor_frame` is where the end is in the frame that turns with the rotor; beside a plate
        `left_plate_table` says which ended, as "lost", where its currents are not known farther on.
        Accuracy: the field errs by 1e-6 of its gradient, steps by round-off; of a body that is not round the field
        errs by 1e-5, about an equilibrium by 2e-5; a plate's currents are known to `plate_rtol`.

    Raises
    ------
    InputError
        Starts that are not allowed, with what is.
    EquilibriumError
        A trajectory shall begin near an equilibrium, and there is none.

    Examples
    --------
    >>> flights = sl.ensemble(scene, {"offset_mm": [[0, 0, 0.1], [0, 0, 9.0]]}, 0.2, model="dipole")
    >>> flights.ended_by.values.tolist()
    ['duration', 'contact']
    """
    options.positive("duration_s", duration_s)
    if (starts is None) == (n is None):
        raise InputError("Input starts must be given, or n with spread; instead received both or neither.")
    number = Workers(workers).checked().workers or os.cpu_count() or 1
    levitation = Levitation(scene, Models(model, plate_model, rtol, plate_rtol, interaction))
    if starts is not None:
        (near, begun, offset), drawn = given_starts(levitation, starts), dict[str, Any]()
    else:
        near, begun, offset = levitation, drawn_starts(levitation, n, seed, spread or {}), None
        drawn = {"seed": seed, "spread": repr(spread)}
    found, known = endings(near, begun, offset, duration_s, number)
    over = ("flight", "axis")
    last = found.last.to_lab(levitation.scene.angle(found.levitated_s))
    data = {
        "levitated": variable(("flight",), found.levitated_s, "s", "levitation time"),
        "ended_by": (("flight",), found.ended_by),
        "position_rotor_frame": variable(over, found.last.position, "m", "position, rotor's frame, at the end"),
        **state_columns(last, "flight", ", at the end"),
        **state_columns(begun, "flight", ", at t = 0", "start_"),  # where the rotor's axes are the laboratory's
    }
    if known.plate is not None:
        text = "whether it left the plate's table"
        data["left_plate_table"] = variable(("flight",), found.left_plate_table, "1", text)
    said = {"study": "ensemble", "duration_s": duration_s, **known.labels, "scene": scene_text(levitation.scene)}
    return xr.Dataset(data, {"axis": list(AXIS)}, {**said, **drawn})


@documented
def sweep(
    scene: SceneLike,
    values: Mapping[str, Sequence[float] | Sequence[str]],
    ask: Quantity = "equilibria",
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    duration_s: float = 3.0,
    place_mm: Sequence[float] = (0.0, 0.0, -20.0),
    workers: int | None = 1,
    scheduler: str | None = None,
    out: str | Path = "out",
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """Any quantity of a scene over a grid of its parameters; each key becomes a dimension, `_` for its dots.

    Models and `spin` hold at all points unless they are varied.

    Parameters
    ----------
    values : dict of str to list
        By key, numbers for keys of the scene file (`frequency_hz`, `rotor.angle_deg`, `plate.center_mm.2`) and for
        `spin`, names for `model`, `plate_model` and `interaction`.
    ask : {"equilibria", "flight", "field"}
        What is computed at each point.
    duration_s : float
        Duration of a trajectory, s.
    place_mm : sequence of 3 floats
        Where the field is computed, mm, rotor's frame.

    Returns
    -------
    xarray.Dataset
        Over the keys; points that failed are NaN and named in the attribute `failed_points`.

    Raises
    ------
    SweepError
        No point could be computed.
    """
    loaded = given_scene(scene)
    models = Models(model, plate_model, **requested).checked()
    where = tuple(1e-3 * options.finite("place_mm", coordinate) for coordinate in place_mm)
    if len(where) != 3:
        raise options.refused("place_mm", "be three numbers", place_mm)
    numbers = options.finite("spin", spin), options.finite("duration_s", duration_s)
    question = Question(loaded, "scene", ask, models, *numbers, where)
    grid = options.checked_values(values)
    return _computed(question_study(question, grid), options.combinations(grid), Workers(workers, scheduler), Path(out))


@documented
def run_study(
    name: str,
    quick: bool = True,
    workers: int | None = 1,
    scheduler: str | None = None,
    out: str | Path = "out",
    progress: bool | None = None,
) -> xr.Dataset:
    """The result of a study of the catalogue; points finished before an interruption are kept.

    Parameters
    ----------
    name : str
        Name of the study, as `spinlev study --list` has it.
    quick : bool
        Coarser, in less than a minute.

    Returns
    -------
    xarray.Dataset
        The study's result, SI units.

    Raises
    ------
    SweepError
        No point could be computed.
    """
    if name not in CATALOGUE:
        raise options.unknown_study(name, CATALOGUE)
    study = CATALOGUE[name]
    return _computed(study, study.points(quick), Workers(workers, scheduler), Path(out))


def _computed(study: Study, points: Sequence[Point], engine: Workers, out: Path) -> xr.Dataset:
    with owned(out):
        result = swept(study, points, engine.checked(), out)
        forget(study, points, out)
    return result


def draw(result: xr.Dataset | SceneLike, width: FigureWidth = "page") -> Mapping[str, Figure]:
    """The figures of a result, or of a scene before anything is computed; a notebook shows them.

    Parameters
    ----------
    result : xarray.Dataset, Scene, str or Path
        Of `equilibria`, `stability`, `simulate`, `compare`, `field_map`, `working_point`, `sweep`, `run_study`, or read
        from a file; or a scene, or the path of its file.
    width : {"page", "column"}
        Of a journal: 170 mm or 85 mm.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        By name.

    Raises
    ------
    InputError
        The result has no figure, the scene cannot be used, or the width is another.
    """
    with figures_across(width):
        return figures_of(result) if isinstance(result, xr.Dataset) else {"scene": scene_figure(given_scene(result))}


def explore(scene: SceneLike, port: int = 0) -> LivePage:
    """A page in the browser to play with a scene: sliders, equilibria at once, where it levitates, live motion.

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
    try:
        from .page.server import serve
    except ModuleNotFoundError as error:
        if needed := missing_extra(error):
            raise ComputationError(needed) from None
        raise
    source = "scene" if isinstance(scene, Scene) else str(scene)
    return serve(given_scene(scene), source, port=port, framed=True).begin()
