"""The commands that answer one question: field, equilibria, simulate."""

import csv
import io
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.equilibria.equilibrium import EquilibriumError, Survey
from ..dynamics.equilibria.search import free_of_bodies
from ..dynamics.flights.flight import starting_point
from ..dynamics.flights.pieces import Checkpoint
from ..dynamics.flights.trajectory import FlightStopped, Trajectory
from ..dynamics.motion.plate import PlateMemory
from ..fem.cache import owned, program_digest
from ..fem.files import write_whole
from ..fem.rotor.near_field import NEAR_RTOL, complete
from ..fem.rotor.table import FieldTable, RotorTable
from ..geometry.common import Array
from ..geometry.scene.contents import AbsoluteStart, OffsetStart, Scene
from ..geometry.scene.files import scene_digest
from .answers import (
    bracketed,
    effects_words,
    equilibria_answer,
    equilibria_words,
    field_answer,
    flight_answer,
    flight_words,
    headline,
    left_out_text,
    left_out_words,
    plate_words,
    tell_details,
)
from .cli.console import note, to_json
from .cli.options import COLUMNS, Models
from .demagnetising import write_working_point
from .figures.pictures import last_view
from .figures.renderer import RenderError, render
from .figures.run import field_figure, force_figure, trajectory_figure
from .figures.style import NAMES, save_figures
from .levitation import Levitation
from .result import axis_dataset, curve_dataset, equilibria_dataset, lowering_times, trajectory_dataset, write_dataset

Job = tuple[Mapping[str, Any], list[str]]
"""Numbers for a program, lines for a person."""


def field_job(scene: Scene, points: Array, asked: Models, out: Path) -> Job:
    """B and its gradient at points (n, 3) m; writes field.csv."""
    levitation = Levitation(scene, asked)
    table = levitation.table
    known = complete(table, max(asked.rtol, NEAR_RTOL)) if isinstance(table, RotorTable) else table
    values = field_answer(known, points)
    b, gradient, error = values["B_T"], values["dB_T_per_m"].reshape(-1, 9), values["B_relative_error"]
    slopes = (f"dB{i}_d{j}_T_per_m" for i in "xyz" for j in "xyz")
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow([*COLUMNS, "Bx_T", "By_T", "Bz_T", *slopes, "B_relative_error"])
    writer.writerows(np.column_stack([points * 1e3, b, gradient, error]))
    write_whole(out / "field.csv", stream.getvalue().encode())
    lines = [f"{'x':>9} {'y':>9} {'z':>9} mm {'Bx':>14} {'By':>14} {'Bz':>14} T   relative error"]
    lines += [
        f"{x:9.3f} {y:9.3f} {z:9.3f}    {b[0]:14.6e} {b[1]:14.6e} {b[2]:14.6e}     {error:.1e}"
        for (x, y, z), b, error in zip(points[:20] * 1e3, b, error, strict=False)
    ]
    lines.append(f"Model {values['model']}; {len(points)} points with gradients in {out / 'field.csv'}")
    return {**values, "tables_from_cache": levitation.from_cache}, lines


def equilibria_job(scene: Scene, asked: Models, spin: float, out: Path) -> Job:
    """All synchronous equilibria and their stability; writes equilibria.json."""
    levitation = Levitation(scene, asked, spin)
    values = {**equilibria_answer(levitation), "tables_from_cache": levitation.from_cache}
    write_whole(out / "equilibria.json", f"{to_json(values)}\n".encode())
    return values, [*equilibria_words(levitation), *plate_words(levitation), *effects_words(values)]


def simulate_job(scene: Scene, asked: Models, duration: float, out: Path, resume: bool) -> Job:
    """The motion; writes trajectory.nc and its figure, and keeps a checkpoint while it lasts."""
    with owned(out):
        return _simulated(scene, asked, duration, out, resume)


def _simulated(scene: Scene, asked: Models, duration: float, out: Path, resume: bool) -> Job:
    asked_of = {"scene": scene_digest(scene), "duration_s": duration, **vars(asked)}
    identity = to_json({**asked_of, "program": program_digest()})
    checkpoint = Checkpoint(out / "checkpoint.npz", identity)
    if not resume:
        checkpoint.remove()
    elif checkpoint.read() is None:
        note(f"No checkpoint in {out}: the flight begins at t = 0.")
    levitation = Levitation(scene, asked)
    if isinstance(scene.start, OffsetStart):
        for line in left_out_words(levitation, levitation.survey.unknown):
            note(line)
    begin = starting_point(levitation.equilibria) if isinstance(scene.start, OffsetStart) else None
    if begin is not None and not begin.stable:
        note(f"The flight begins at an unstable equilibrium: e-fold in {1 / begin.growth_per_s:.2g} s.")

    def keep(flight: Trajectory) -> None:
        labels = {**levitation.labels, **lowering_times(scene), "headline": flight_words(levitation, flight)}
        flown = trajectory_dataset(flight, levitation.flight_plate).assign_attrs(labels)
        write_dataset(flown, out / "trajectory.nc", scene)
        save_figures({"trajectory": trajectory_figure(flown)}, out)

    try:
        flight = levitation.flight(duration, checkpoint)
    except FlightStopped as stop:
        keep(stop.flown)
        note(f"{stop} It is in {out / 'trajectory.nc'}; --resume goes on from there.")
        raise
    keep(flight)
    checkpoint.remove()
    values = {
        **flight_answer(levitation, flight),
        "trajectory": str(out / "trajectory.nc"),
        "tables_from_cache": levitation.from_cache,
    }
    tell_details(flight)
    told = [flight_words(levitation, flight), *plate_words(levitation), *effects_words(values)]
    return values, [*told, f"Trajectory in {values['trajectory']}, figure in {out / 'trajectory.png'}"]


MODELS = ("dipole", "cuboid", "fem")
SAME = 1e-6
"""Difference of two levitation distances that is none whatever their errors, mm: round-off and stopped iterations."""
DEEPEST = 0.05
"""The field figure reaches this far below the rotor's origin, m."""


def main_job(scene: Scene, asked: Models, spin: float, duration: float, out: Path) -> Job:
    """Compute everything of a scene for a body spin; writes result.nc, summary.json and the figures.

    What is finished before a failure is kept: a scene without a stable equilibrium still leaves its fields and force
    curves, a flight that the user stops its beginning; then the error goes on to the caller.
    """
    levitation = Levitation(scene, asked, spin)
    exact = "cuboid" if all(magnet.contrast == 0 for magnet in scene.rotor) else "fem"
    chosen = levitation.table
    failure: EquilibriumError | FlightStopped | None = None
    surveys: dict[str, Survey] = {}
    try:
        _tell_first(levitation)
        best = levitation.field(exact)
        alone = {
            model: levitation.without_plate if model == chosen.model else levitation.survey_in(model)
            for model in dict.fromkeys(("dipole", best.model, chosen.model))
        }
        surveys = alone | {chosen.model: levitation.survey}
    except EquilibriumError as error:
        failure = error
        best = levitation.field(exact)
        surveys = alone = {name: Survey((), ()) for name in ("dipole", best.model, chosen.model)}
    known = surveys[chosen.model]
    compared = comparison(alone["dipole"], alone[best.model], best.model)
    values: dict[str, Any] = {
        "headline": str(failure) if failure else headline(levitation, known.equilibria, known.left_out),
        **equilibria_answer(levitation, known),
        "comparison": compared,
        "tables_from_cache": levitation.from_cache,
    }
    lines = [str(failure)] if failure else equilibria_words(levitation, known)
    lines += comparison_lines(compared)
    flight = None
    if failure is None or isinstance(scene.start, AbsoluteStart):
        try:
            flight = levitation.flight(duration)
            values |= flight_answer(levitation, flight)
            lines += [flight_words(levitation, flight), *plate_words(levitation)]
            tell_details(flight)
        except EquilibriumError as error:
            failure = error
        except FlightStopped as stop:
            flight = (failure := stop).flown
    lines += effects_words(values)
    if any(magnet.coercivity is not None and magnet.polarization.any() for magnet in scene.rotor):
        worked, told, _ = write_working_point(levitation, out)
        values |= worked
        lines += told
    if failure:
        values["failed"] = str(failure)
        lines += [] if str(failure) in lines else [str(failure)]
    tables = {name: levitation.field(name) for name in MODELS}
    result = _static_dataset(scene, tables, surveys, alone, best.model).assign_attrs(
        levitation.labels, body_spin=spin, left_out=left_out_text(known.left_out)
    )
    memory = levitation.flight_plate if flight else None
    _write(scene, chosen, result, values, flight, memory, out)
    if failure and (flight is None or isinstance(failure, FlightStopped)):
        raise failure
    return values, [*lines, f"Results and figures in {out}/"]


def _tell_first(levitation: Levitation) -> None:
    """The answer without the plate, which is there in seconds; the plate's currents can take minutes."""
    found = levitation.without_plate.equilibria
    if levitation.scene.plate is not None:
        said = headline(levitation, found)
        note(f"Without the plate: {said[0].lower()}{said[1:]}")


def comparison(dipole: Survey, best: Survey, name: str) -> Mapping[str, Any] | None:
    """Levitation distance by the point dipole against the true field, mm; None if either has no stable equilibrium."""
    pair = [next((e for e in found.equilibria if e.stable), None) for found in (dipole, best)]
    if pair[0] is None or pair[1] is None:
        return None
    distances = [-float(e.position[2]) * 1e3 for e in pair if e]
    return {
        "true_model": name,
        "dipole_distance_mm": distances[0],
        "true_distance_mm": distances[1],
        "difference_mm": distances[0] - distances[1],
        # The dipole's own position error says how wrong its field is, which is what is measured here.
        "difference_error_mm": pair[1].position_error * 1e3,
    }


def comparison_lines(compared: Mapping[str, Any] | None) -> list[str]:
    """The same for a person."""
    if compared is None:
        return []
    apart, error = compared["difference_mm"], compared["difference_error_mm"]
    said = f"Point-dipole model, same conditions: levitation distance {compared['dipole_distance_mm']:.2f} mm, "
    if abs(apart) <= max(error, SAME):
        return [f"{said}no difference beyond its error of {max(error, SAME):.0e} mm."]
    more = "more" if apart > 0 else "less"
    return [f"{said}{bracketed(abs(apart), error, 2)} mm {more} than with {NAMES[compared['true_model']]}."]


def _static_dataset(
    scene: Scene,
    tables: Mapping[str, FieldTable],
    surveys: Mapping[str, Survey],
    alone: Mapping[str, Survey],
    best: str,
) -> xr.Dataset:
    """Field, force and equilibria free of the bodies: with the plate's currents where they act, and all without."""
    lowest = min(float(corner[2]) for magnet in scene.rotor for corner in magnet.box.corners)
    heights = np.linspace(min(lowest - scene.floater.radius, -1e-3), min(lowest - 1e-3, -DEEPEST), 200)
    parts = [
        axis_dataset(tables, heights),
        curve_dataset({name: found.curves for name, found in surveys.items()}),
        equilibria_dataset(
            {
                name: [
                    *(e for e in surveys[name].equilibria if e.currents is not None),
                    *free_of_bodies(scene, found).equilibria,
                ]
                for name, found in alone.items()
            }
        ),
    ]
    return xr.merge(parts).assign_attrs(
        study="run", best_model=best, weight_N=scene.floater.mass * float(scene.gravity[2])
    )


def _write(
    scene: Scene,
    table: FieldTable,
    result: xr.Dataset,
    values: dict[str, Any],
    flight: Trajectory | None,
    memory: PlateMemory | None,
    out: Path,
) -> None:
    """The result and its summary first, then what is drawn of them."""
    note("Files and figures ...")
    (out / "summary.json").unlink(missing_ok=True)  # an older one must not stand beside the new result
    if flight:
        flown = trajectory_dataset(flight, memory).assign_attrs(study="run", **lowering_times(scene))
        result = xr.merge([result, flown], combine_attrs="no_conflicts")
    write_dataset(result, out / "result.nc", scene)
    write_whole(out / "summary.json", f"{to_json(values)}\n".encode())
    figures = {"field": field_figure(result), "force": force_figure(result)}
    if flight is None:
        save_figures(figures, out)
        return
    with ThreadPoolExecutor(1) as beside:  # in three dimensions another process draws, meanwhile
        view = {out / "scene.png": last_view(scene, table, flight.time, flight.rotor)}
        in_space = beside.submit(render, view)
        save_figures(figures | {"trajectory": trajectory_figure(result)}, out)
        try:
            in_space.result()
        except RenderError as error:
            note(str(error))
