"""The program from Python: what the command line does, with labelled results instead of files.

As in a notebook::

    from spinlev.studies.api import draw, equilibria, load_scene, simulate, stability

    scene = load_scene("scenes/horizontal.toml")
    found = equilibria(scene, plate_model="none")    # an xarray.Dataset with units and error estimates
    small = stability(scene, plate_model="none")     # the small motions about the one at which a flight begins
    flight = simulate(scene, 3.0, plate_model="none")
    draw(flight)["trajectory"]                       # a matplotlib figure
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from ...dynamics.flights import starting_point
from ...dynamics.motion import PlateMemory
from ...dynamics.steady import Equilibrium, EquilibriumError
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import InputError
from ...geometry.scenes import OffsetStart, Scene, load_scene, parse_scene
from ..catalogue import CATALOGUE, figures_of
from ..one_scene import Shelf, fly, surveyed
from ..results import found_dataset, trajectory_dataset, variable
from ..sweeps import Engine, forget, swept
from ..terminal import FieldModel, PlateModel, Tables

__all__ = [
    "EquilibriumError",
    "InputError",
    "Scene",
    "draw",
    "equilibria",
    "load_scene",
    "parse_scene",
    "plate_table",
    "rotor_table",
    "run_study",
    "simulate",
    "stability",
]


def rotor_table(scene: Scene, model: FieldModel = "auto", rtol: float = Tables.rtol) -> FieldTable:
    """The rotor's field: `evaluate(points)` gives B (n, 3) T and its gradient (n, 3, 3) T/m at points (n, 3) m.

    Accurate to `rtol` wherever the floater can be; `relative_error(points)` is the estimate. Raises InputError for a
    tolerance out of range and AccuracyError where it cannot be reached.
    """
    return Shelf(scene, Tables(model, rtol=rtol).checked()).table()


def plate_table(
    scene: Scene,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    rtol: float = Tables.rtol,
    plate_rtol: float = Tables.plate_rtol,
) -> PlateMemory | None:
    """The plate's currents around the place where the floater levitates, or None where none are modelled.

    Its `table` holds the network, its `share` what the rotor drives, its `error` the estimated relative error.
    """
    shelf = Shelf(scene, Tables(model, plate_model, rtol, plate_rtol).checked())
    return surveyed(shelf, shelf.table())[1]


def equilibria(
    scene: Scene,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    rtol: float = Tables.rtol,
    plate_rtol: float = Tables.plate_rtol,
) -> xr.Dataset:
    """All synchronous equilibria, the stable ones first, with errors, growth and frequency of each small motion.

    Parameters
    ----------
    spin : body spin S = Ω·m̂/ω

    Returns
    -------
    Dataset over `equilibrium`, `mode` and `axis`, SI units. Raises EquilibriumError for a rotor at rest.
    """
    shelf = Shelf(scene, Tables(model, plate_model, rtol, plate_rtol).checked())
    found, _, labels = _surveyed(shelf, spin)
    return found_dataset(found).assign_attrs(study="equilibria", **labels)


def stability(
    scene: Scene,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    rtol: float = Tables.rtol,
    plate_rtol: float = Tables.plate_rtol,
) -> xr.Dataset:
    """The five small motions about the equilibrium at which a flight begins, the nearest stable one if there is one.

    Parameters
    ----------
    spin : body spin S = Ω·m̂/ω

    Returns
    -------
    Dataset over `mode` (bounce, two side motions, precession, nutation): growth (1/s; negative where it dies out) and
    frequency (Hz, rotor's frame); `stable`, `growth` and `growth_error` (what round-off may do to it) of the whole.
    Raises EquilibriumError where there is no equilibrium to begin at.
    """
    shelf = Shelf(scene, Tables(model, plate_model, rtol, plate_rtol).checked())
    found, _, labels = _surveyed(shelf, spin)
    chosen = starting_point(found) or next(iter(found), None)
    if chosen is None:
        raise EquilibriumError(f"At {scene.frequency:g} Hz the floater has no equilibrium with body spin {spin:g}.")
    dataset = found_dataset((chosen,)).isel(equilibrium=0, drop=True).drop_vars("number")
    error = variable((), chosen.growth_error_per_s, "1/s", "what round-off may do to the growth")
    return dataset.assign(growth_error=error).assign_attrs(study="stability", **labels)


def _surveyed(shelf: Shelf, spin: float) -> tuple[tuple[Equilibrium, ...], PlateMemory | None, dict[str, str]]:
    """Equilibria, the plate, and what a result says of both models."""
    table = shelf.table()
    found, memory = surveyed(shelf, table, spin)
    labels = {"model": table.model, "plate_model": memory.model if memory else "none", "scene": shelf.scene.text}
    return found.equilibria, memory, labels


def simulate(
    scene: Scene,
    duration: float,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    rtol: float = Tables.rtol,
    plate_rtol: float = Tables.plate_rtol,
) -> xr.Dataset:
    """The floater's motion for `duration` (s) from where the scene says.

    Returns
    -------
    Dataset over `time`, SI units; how it ended and the violation of the energy ledger are attributes. Raises
    EquilibriumError where the scene starts from an equilibrium and has none.
    """
    shelf = Shelf(scene, Tables(model, plate_model, rtol, plate_rtol).checked())
    table = shelf.table()
    found: tuple[Equilibrium, ...] = ()
    if isinstance(scene.start, OffsetStart):
        found, memory, _ = _surveyed(shelf, 0.0)
    else:
        memory = shelf.memory(table, ())
    flight = fly(scene, shelf.in_flight(table, memory, found), duration, found, memory)
    labels = {"model": table.model, "plate_model": memory.model if memory else "none", "scene": scene.text}
    return trajectory_dataset(flight).assign_attrs(labels)


def run_study(
    name: str,
    quick: bool = True,
    workers: int | None = 1,
    scheduler: str | None = None,
    out: str | Path = "out",
) -> xr.Dataset:
    """The result of a study of the catalogue; points finished before an interruption are kept in `out`.

    More than one worker needs the caller's script to be guarded by `if __name__ == "__main__":`. Raises InputError for
    an unknown name.
    """
    if name not in CATALOGUE:
        raise InputError(f"Input name must be one of {', '.join(CATALOGUE)}; instead received {name}.")
    study = CATALOGUE[name]
    engine = Engine(workers, scheduler).checked()
    result = swept(name, study, dict(enumerate(study.points(quick))), engine, Path(out))
    forget(name, Path(out))
    return result


def draw(result: xr.Dataset) -> Mapping[str, Figure]:
    """The figures of a result by name; a notebook shows them. Raises InputError where the result has no figure."""
    return figures_of(result)
