"""The command `study`: computes, writes, draws and tells."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import xarray as xr

from ...fem.storage import owned
from ...geometry.scenes import check_files
from ..one_scene import Job, Question
from ..pictures import question_figure, question_lines
from ..results import Point, Study, save_figures, write_dataset
from ..sweeps import forget, swept
from ..terminal import Workers, combinations
from .drawings import QUESTION, figures_of
from .entries import CATALOGUE


def study_job(name: str, quick: bool, engine: Workers, out: Path) -> Job:
    """Compute a study of the catalogue; writes NAME.nc and its figures. Errors: those of `swept`."""
    study = CATALOGUE[name]
    return _studied(study, study.points(quick), engine, out)


def question_job(question: Question, values: dict[str, list[Any]], engine: Workers, out: Path) -> Job:
    """Answer one's own question over a grid; writes question.nc and its figure.

    Raises
    ------
    SceneError : the scene does not take the first of the values
    """
    return _studied(question_study(question, values), combinations(values), engine, out)


def question_study(question: Question, values: Mapping[str, Sequence[Any]]) -> Study:
    """One's own question over a grid as a study. Raises InputError where the first point or a model cannot be."""
    points = combinations(values)
    for key in ("plate_model", "interaction", "model"):
        for value in values.get(key, ()):
            question.levitation({**points[0], key: value})
    question.levitation(points[0])
    return Study(
        QUESTION,
        f"{question.ask} over {', '.join(values)}",
        lambda quick: points,
        question,
        partial(question.gather, values=values),
        {QUESTION: question_figure},
        question_lines,
        prepared=question.prepared,
        batches=question.batches,
        settings=question.settings,
        check=partial(check_files, question.scene, question.source),
    )


def _studied(study: Study, points: Sequence[Point], engine: Workers, out: Path) -> Job:
    name = study.name
    path = out / f"{name}.nc"
    with owned(out):
        result = swept(name, study, dict(enumerate(points)), engine, out)
        write_dataset(result, path)
        forget(name, out)
        figures = save_figures(figures_of(result), out)
    lines = [*study.report(result), *failure_lines(result)]
    values = {
        "study": name,
        "report": lines,
        "failed_points": failed_points(result),
        "result": str(path),
        "figures": figures,
        **(study.numbers(result) if study.numbers else {}),
    }
    return values, [*lines, f"Written: {', '.join([str(path), *figures])}"]


def failed_points(result: xr.Dataset) -> list[dict[str, Any]]:
    """The points of a result that have no value, each with the reason."""
    failed: list[dict[str, Any]] = json.loads(result.attrs["failed_points"])["failed"]
    return failed


def failure_lines(result: xr.Dataset) -> list[str]:
    """The same for a person."""
    return [f"No value at {json.dumps(f['point'], ensure_ascii=False)}: {f['reason']}" for f in failed_points(result)]
