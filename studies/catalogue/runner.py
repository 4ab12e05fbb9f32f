"""The figures of any result, from its file alone."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...dynamics.equilibria.equilibrium import CRITERION
from ...dynamics.motion.state import State
from ...fem.cache import owned, read_checked
from ...geometry.common import InputError
from ...geometry.files import write_whole
from ...geometry.scene.contents import Scene
from ...geometry.scene.files import check_files, parse_scene
from ...geometry.solids import moved
from .. import compare, design, fields, fit, other_motions
from ..cli.console import note, progress
from ..cli.options import NAMES, Answer, Models, Workers, combinations, wrong
from ..figures import run as drawing
from ..figures.pictures import flight_frames, last_view, plate_currents
from ..figures.renderer import render, rendered, turnable_page
from ..figures.style import save_figures
from ..figures.view import SEEN, Currents, current_places, near_plate, unit
from ..levitation import Levitation
from ..plan import sources
from ..question import Question
from ..result import write_dataset
from ..study import Point, Study
from ..sweep import forget, swept
from .entries import CATALOGUE

QUESTION = "question"  # What the result of one's own question is called
DRAWN = {
    "first_number": ("design", design.design_figure),
    "estimate": ("fit", fit.fit_figure),
    "branch_distance": ("compare", compare.compare_figure),
    "outside": ("field-map", fields.field_map_figure),
    "easy_axis": ("working-point", drawing.working_point_figure),
    "axis_field": ("field", drawing.field_figure),
    "heat": ("trajectory", other_motions.coils_figure),
    "curve_force": ("force", drawing.force_figure),
    "position_rotor_frame": ("trajectory", drawing.trajectory_figure),
    "motor_torque": ("drive", drawing.drive_figure),
    "mode_growth": ("modes", drawing.modes_figure),
}  # By variable of a result that is no study: name of the figure and who draws it


def draw_result(path: Path, out: Path) -> list[str]:
    """Draw a result file anew; returns the files. Raises InputError where it is no result of this program."""
    return save_figures(figures_of(read_result(path)), out)


def read_result(path: Path) -> xr.Dataset:
    """The whole of a result file. Raises InputError if it cannot be read, or is no result of this program."""
    if path.suffix == ".toml":
        raise wrong(str(path), "be a result", f"it is a scene. Its result is made by: spinlev run {path}")
    result = read_checked(path)
    if "study" not in result.attrs:
        raise InputError(f"Input {path} must be a result of spinlev; instead it has no attribute 'study'.")
    return result


def figures_of(result: xr.Dataset) -> Mapping[str, Figure]:
    """Figures of a study's or a command's result by name. Raises InputError: it is of none that is known."""
    kind = str(result.attrs["study"])
    if kind in CATALOGUE:
        return {name: draw(result) for name, draw in CATALOGUE[kind].figures.items()}
    if kind == QUESTION:
        return {QUESTION: drawing.question_figure(result)} if drawing.drawable(result) else {}
    found = {name: draw(result) for key, (name, draw) in DRAWN.items() if key in result}
    if not found:
        raise InputError(f"Input study must be one that this version knows; instead the result is of '{kind}'.")
    return found


FOR_A_FIGURE = 1e-3  # relative error of the field that no figure shows


def study_job(name: str, quick: bool, engine: Workers, out: Path) -> Answer:
    """Compute a study of the catalogue; writes NAME.nc and its figures. Errors: those of `swept`."""
    study = CATALOGUE[name]
    values, lines = _studied(study, study.points(quick), engine, out)
    return values, [*lines, f"Left out by --quick: {study.quick}."] if quick and study.quick else lines


def question_job(question: Question, values: dict[str, list[Any]], engine: Workers, out: Path) -> Answer:
    """Compute a question over a grid; writes question.nc and its figure. Raises SceneError for the first value."""
    models = {question.models.model, *values.get("model", ())}
    if question.models.rtol < FOR_A_FIGURE and models & {"auto", "fem", "surface"}:
        note(f"Field to {question.models.rtol:g}; for a figure --rtol {FOR_A_FIGURE:g} is enough, and takes less time.")
    return _studied(question_study(question, values), combinations(values), engine, out)


def question_study(question: Question, values: Mapping[str, Sequence[Any]]) -> Study:
    """One's own question over a grid as a study. Raises InputError where the first point or a model cannot be."""
    points = combinations(values)
    for key in NAMES:
        for value in values.get(key, ()):
            question.levitation({**points[0], key: value})
    question.levitation(points[0])
    return Study(
        QUESTION,
        f"{question.ask} over {', '.join(values)}",
        lambda quick: points,
        question,
        {QUESTION: drawing.question_figure},
        drawing.question_lines,
        partial(question.gather, values=values),
        prepared=question.prepared,
        batches=question.batches,
        settings=question.settings,
        check=partial(check_files, question.scene, question.source),
    )


def _studied(study: Study, points: Sequence[Point], engine: Workers, out: Path) -> Answer:
    name = study.name
    path = out / f"{name}.nc"
    with owned(out):
        result = swept(study, points, engine, out)
        write_dataset(result, path)
        forget(study, points, out)
        note("Figures ...")
        figures = save_figures(figures_of(result), out)
    lines = [*study.report(result), *failure_lines(result)]
    text = "\n".join(lines)
    if ("stable" in text or "highest (Hz)" in text) and CRITERION not in text:  # one definition for all of them
        lines.append(f"Stable: {CRITERION}.")
    values = {"study": name, "report": lines, "failed_points": failed_points(result), "result": str(path)}
    values |= {"figures": figures, **(study.numbers(result) if study.numbers else {})}
    return values, [*lines, f"Written: {', '.join([str(path), *figures])}"]


def failed_points(result: xr.Dataset) -> Any:
    return json.loads(result.attrs["failed_points"])["failed"]


def failure_lines(result: xr.Dataset) -> list[str]:
    return [f"No value at {json.dumps(f['point'], ensure_ascii=False)}: {f['reason']}" for f in failed_points(result)]


def show_job(path: Path, out: Path, html: bool = False) -> list[str]:
    """Write NAME-scene.png, NAME-flight.gif and, if `html`, NAME-view.html of a trajectory to `out`; returns the files.

    Raises InputError where `path` holds no single scene's trajectory; RenderError where pictures cannot be drawn.
    """
    result = read_result(path)
    if "scene" not in result.attrs or "position_rotor_frame" not in result:
        rule = "hold a trajectory (result.nc of `run`, trajectory.nc of `simulate`)"
        raise wrong(str(path), rule, f"it is of '{result.attrs['study']}'. Its figures: spinlev figure {path}")
    scene, motion = flight_of(result, str(path))
    table = Levitation(scene, Models(result.attrs.get("model", "auto"))).table
    time = result["time"].values
    view = last_view(scene, table, time, motion)
    if scene.plate is not None:
        note("Currents in the plate ...")
        places = current_places(near_plate(scene.plate.body, SEEN * unit(scene)), view.position)
        floater = replace(State(*(vector[-1] for vector in motion.vectors)), position=view.position)
        density = plate_currents(scene, scene.plate, sources(table), floater, places)
        view = replace(view, currents=Currents(places, density))
    picture, animation = (out / f"{path.stem}-{name}" for name in ("scene.png", "flight.gif"))
    with progress("Pictures") as advance:
        render({picture: view, animation: flight_frames(scene, time, motion)}, advance)
    files = [str(picture), str(animation)]
    if html:
        turned = out / f"{path.stem}-view.html"
        write_whole(turned, turnable_page(rendered(replace(view, turnable=True))))
        files.append(str(turned))
    return files


def flight_of(result: xr.Dataset, source: str) -> tuple[Scene, State]:
    """The scene at the end of the trajectory that a result holds, and its motion along the rotor's axes."""
    scene = parse_scene(str(result.attrs["scene"]), source)
    if (plate := scene.plate) is not None and plate.lowering is not None:
        down = np.array([0.0, 0.0, float(plate.lowering.depth(result["time"].values[-1]))])
        scene = replace(scene, plate=replace(plate, body=moved(plate.body, plate.body.center - down), lowering=None))
    vectors = (result[name].values for name in ("position", "velocity", "moment", "spin"))
    laboratory = replace(State(*vectors), axes=result["body_axes"].values if "body_axes" in result else None)
    return scene, laboratory.to_rotor(scene.angle(result["time"].values))
