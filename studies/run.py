"""The commands that answer one question about a scene: field, equilibria, simulate, and run, which asks for all."""

import csv
import io
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.equilibria.equilibrium import EquilibriumError, Survey
from ..dynamics.equilibria.search import free_of_bodies
from ..dynamics.flights.flight import Checkpoint, most_like_levitation, starting_point
from ..dynamics.flights.trajectory import FlightStopped, Trajectory
from ..fem.cache import program_digest
from ..fem.files import write_whole
from ..fem.rotor.near_field import NEAR_RTOL, CompleteTable, complete
from ..fem.rotor.table import FieldTable, RotorTable
from ..geometry.common import MU_0, Array
from ..geometry.scene.contents import AbsoluteStart, OffsetStart, Scene
from ..geometry.scene.files import scene_digest
from .cli.console import note, to_json
from .cli.options import COLUMNS, Models
from .demagnetising import write_working_point
from .figures.pictures import last_view
from .figures.renderer import RenderError, render
from .figures.run import field_figure, force_figure, trajectory_figure
from .figures.style import save_figures
from .levitation import Levitation
from .result import Result, axis_dataset, curve_dataset, equilibria_dataset, left_out_text, write_dataset
from .words import flight_words, headline, left_out_words, tell_details

Job = tuple[Mapping[str, Any], list[str]]  # numbers for a program, lines for a person
MODELS = ("dipole", "cuboid", "fem")
SHOWN = 20  # points whose field is printed, at most
DEEPEST = 0.05  # the field figure reaches this far below the rotor's origin, m


def field_job(scene: Scene, points: Array, asked: Models, out: Path) -> Job:
    """B and its gradient of a `scene` at `points` (n, 3) m by `asked` models; writes field.csv to `out`."""
    levitation = Levitation(scene, asked)
    table = levitation.table
    known = complete(table, max(asked.rtol, NEAR_RTOL)) if isinstance(table, RotorTable) else table
    values = _field(known, points)
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
        for (x, y, z), b, error in zip(points[:SHOWN] * 1e3, b, error, strict=False)
    ]
    lines.append(f"Model {values['model']}; {len(points)} points with gradients in {out / 'field.csv'}")
    return {**values, "tables_from_cache": levitation.from_cache}, lines


def _field(table: FieldTable, points: Array) -> dict[str, Any]:
    """B, its gradient and their estimated errors at points (n, 3) m; H and M too if the table does not reach all."""
    near: dict[str, Any] = {}
    if isinstance(table, CompleteTable) and not table.in_range(points).all():
        found, tiny = table.fields(points), np.finfo(float).tiny
        b, gradient = found.flux_density, found.gradient
        error = found.error / (np.linalg.norm(b, axis=1) + tiny)
        gradient_error = found.gradient_error / (np.linalg.norm(gradient, axis=(1, 2)) + tiny)
        near = {
            "H_A_per_m": found.field / MU_0,
            "M_A_per_m": found.magnetization / MU_0,
            "inside_magnet": (found.magnet + 1).tolist(),
        }
    else:
        b, gradient = table.evaluate(points)
        error, gradient_error = table.relative_error(points)
    return {
        "model": table.model,
        "error_estimate": float(error.max()),
        "gradient_error_estimate": float(gradient_error.max()),
        "B_T": b,
        "dB_T_per_m": gradient,
        **near,
        "B_relative_error": error,
        "dB_relative_error": gradient_error,
    }


def equilibria_job(scene: Scene, asked: Models, spin: float, out: Path) -> Job:
    """All equilibria of a `scene` with body `spin` by `asked` models, with stability; writes to `out`."""
    levitation = Levitation(scene, asked, spin)
    result = Result(levitation, levitation.survey)
    values = {**result.summary, "tables_from_cache": levitation.from_cache}
    write_whole(out / "equilibria.json", f"{to_json(values)}\n".encode())
    return values, result.text()


def simulate_job(scene: Scene, asked: Models, duration: float, out: Path, resume: bool) -> Job:
    """Trajectory of a `scene` for `duration` (s) by `asked` models; writes trajectory.nc and its figure to `out`.

    A checkpoint is kept while it lasts; `resume` goes on from there.
    """
    asked_of = {"scene": scene_digest(scene), "duration_s": duration, **vars(asked)}
    identity = to_json({**asked_of, "program": program_digest()})
    checkpoint = Checkpoint(out / "checkpoint.npz", identity)
    if not resume:
        checkpoint.remove()
    elif checkpoint.read() is None:
        note(f"No checkpoint in {out}: the trajectory begins at t = 0.")
    levitation = Levitation(scene, asked)
    if isinstance(scene.start, OffsetStart):
        for line in left_out_words(levitation, levitation.survey.unknown):
            note(line)
        begin = starting_point(levitation.equilibria)
        if begin is not None and not begin.stable:
            note(f"The simulation begins at an unstable equilibrium, e-folding time {1 / begin.growth_per_s:.2g} s.")
    path = out / "trajectory.nc"

    def kept(flight: Trajectory) -> Result:
        result = Result(levitation, flight=flight)
        flown = result.dataset().assign_attrs(headline=flight_words(levitation, flight))
        write_dataset(flown, path, scene)
        save_figures({"trajectory": trajectory_figure(flown)}, out)
        return result

    try:
        flight = levitation.flight(duration, checkpoint)
    except FlightStopped as stop:
        kept(stop.flown)
        note(f"{stop} It is in {path}; --resume goes on from there.")
        raise
    result = kept(flight)
    checkpoint.remove()
    tell_details(flight)
    values = {**result.summary, "trajectory": str(path), "tables_from_cache": levitation.from_cache}
    return values, [*result.text(), f"Trajectory in {path}, figure in {out / 'trajectory.png'}"]


def main_job(scene: Scene, asked: Models, spin: float, duration: float, out: Path) -> Job:
    """Compute everything of a `scene` by `asked` models for a body `spin` and a trajectory of `duration` (s).

    Writes result.nc, summary.json and the figures to `out`.

    What is finished before a failure is kept: a scene without a stable equilibrium still leaves its fields and force
    curves, a trajectory that the user stops its beginning; then the error goes on to the caller.
    """
    levitation = Levitation(scene, asked, spin)
    exact = "cuboid" if all(magnet.contrast == 0 for magnet in scene.rotor) else "fem"
    chosen = levitation.table.model
    failure: EquilibriumError | FlightStopped | None = None
    survey = Survey((), ())
    try:
        if scene.plate is not None:  # in seconds; the plate's currents can take minutes
            said = headline(levitation, levitation.without_plate.equilibria)
            note(f"Without the plate: {said[0].lower()}{said[1:]}")
        best = levitation.field(exact).model
        alone = {
            model: levitation.without_plate if model == chosen else levitation.survey_in(model)
            for model in dict.fromkeys(("dipole", best, chosen))
        }
        survey = levitation.survey
    except EquilibriumError as error:
        failure = error
        best = levitation.field(exact).model
        alone = dict.fromkeys(("dipole", best, chosen), survey)
    compared = compared_models(alone["dipole"], alone[best], best)
    result, flight = Result(levitation, survey, comparison=compared, failed=str(failure or "")), None
    if failure is None or isinstance(scene.start, AbsoluteStart):
        try:
            flight = levitation.flight(duration)
            result = replace(result, flight=flight)
            tell_details(flight)
        except EquilibriumError as error:
            failure = error
        except FlightStopped as stop:
            flight = (failure := stop).flown
    values: dict[str, Any] = {
        "headline": result.failed or headline(levitation, survey.equilibria, survey.left_out),
        **result.summary,
        "comparison": compared,
        "tables_from_cache": levitation.from_cache,
    }
    lines = result.text()
    if any(magnet.coercivity is not None and magnet.polarization.any() for magnet in scene.rotor):
        worked, told, _ = write_working_point(levitation, out)
        values |= worked
        lines += told
    if failure:
        values["failed"] = str(failure)
        lines += [] if str(failure) in lines else [str(failure)]
    dataset = _static_dataset(levitation, survey, alone, best).assign_attrs(
        levitation.labels, body_spin=spin, left_out=left_out_text(survey.left_out)
    )
    if flight:
        flown = Result(levitation, flight=flight).dataset().assign_attrs(study="run")
        dataset = xr.merge([dataset, flown], combine_attrs="no_conflicts")
    _write(levitation, dataset, values, flight, out)
    if failure and (flight is None or isinstance(failure, FlightStopped)):
        raise failure
    return values, [*lines, f"Results and figures in {out}/"]


def compared_models(dipole: Survey, best: Survey, name: str) -> dict[str, Any] | None:
    """Levitation distances (mm) by the point `dipole` and the `best` model, of this `name`, both without the plate.

    Of the dipole's equilibria the one nearest to where the floater levitates; None where one of both has none.
    """
    true = most_like_levitation(best.equilibria)
    if true is None or not dipole.equilibria:
        return None
    rough = min(dipole.equilibria, key=lambda e: float(np.linalg.norm(e.position - true.position)))
    distances = [-float(e.position[2]) * 1e3 for e in (rough, true)]
    return {
        "true_model": name,
        "dipole_stability": rough.stability,
        "true_stability": true.stability,
        "dipole_distance_mm": distances[0],
        "true_distance_mm": distances[1],
        "difference_mm": distances[0] - distances[1],
        # The dipole's own position error says how wrong its field is, which is what is measured here.
        "difference_error_mm": true.position_error * 1e3,
    }


def _static_dataset(levitation: Levitation, survey: Survey, alone: Mapping[str, Survey], best: str) -> xr.Dataset:
    """Field, force and equilibria free of the bodies: with the plate's currents where they act, and all without."""
    scene, chosen = levitation.scene, levitation.table.model
    lowest = min(float(corner[2]) for magnet in scene.rotor for corner in magnet.box.corners)
    heights = np.linspace(min(lowest - scene.floater.radius, -1e-3), min(lowest - 1e-3, -DEEPEST), 200)
    surveys = {**alone, chosen: survey}
    equilibria = {
        model: [
            *(e for e in surveys[model].equilibria if e.currents is not None),
            *free_of_bodies(scene, found).equilibria,
        ]
        for model, found in alone.items()
    }
    parts = [
        axis_dataset({name: levitation.field(name) for name in MODELS}, heights),
        curve_dataset({name: found.curves for name, found in surveys.items()}),
        equilibria_dataset(equilibria),
    ]
    weight = scene.floater.mass * float(scene.gravity[2])
    return xr.merge(parts).assign_attrs(study="run", best_model=best, weight_N=weight)


def _write(
    levitation: Levitation,
    result: xr.Dataset,
    values: dict[str, Any],
    flight: Trajectory | None,
    out: Path,
) -> None:
    """The result and its summary first, then what is drawn of them."""
    note("Files and figures ...")
    scene = levitation.scene
    (out / "summary.json").unlink(missing_ok=True)  # an older one must not stand beside the new result
    write_dataset(result, out / "result.nc", scene)
    write_whole(out / "summary.json", f"{to_json(values)}\n".encode())
    figures = {"field": field_figure(result), "force": force_figure(result)}
    if flight is None:
        save_figures(figures, out)
        return
    with ThreadPoolExecutor(1) as beside:  # in three dimensions another process draws, meanwhile
        view = {out / "scene.png": last_view(scene, levitation.table, flight.time, flight.rotor)}
        in_space = beside.submit(render, view)
        save_figures(figures | {"trajectory": trajectory_figure(result)}, out)
        try:
            in_space.result()
        except RenderError as error:
            note(str(error))
