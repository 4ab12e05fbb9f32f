"""Studies and sweeps of one's own from Python."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from ...fem.storage import owned
from ...geometry.basics import InputError
from ...geometry.scenes import Scene
from ..catalogue import CATALOGUE, QUESTION, figures_of, question_study
from ..one_scene import Question, given_scene
from ..results import Study
from ..sweeps import forget, swept
from ..terminal import (
    FieldModel,
    InteractionModel,
    Models,
    PlateModel,
    Quantity,
    Workers,
    checked_values,
    combinations,
    finite,
    heard,
)

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
