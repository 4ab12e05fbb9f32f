"""The commands about many scenes and about results: study, figure, show, report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from ..geometry import InputError
from .engine import Engine
from .output import Answer, Output


def add_result_commands(app: App) -> None:
    """Let the command line know these commands."""
    for command in (study, figure):
        app.command(command)


def study(
    name: str | None = None,
    *,
    list: Annotated[bool, Parameter(negative="")] = False,
    quick: Annotated[bool, Parameter(negative="")] = False,
    engine: Engine = Engine(),
    output: Output = Output(),
) -> Answer:
    """One study of the catalogue: NAME.nc, its figure as NAME.png and NAME.pdf, and what it says.

    A study that was stopped goes on where it was.

    Parameters
    ----------
    name
        Name of the study.
    list
        Show the catalogue.
    quick
        Coarser, in less than a minute.
    """
    from .catalogue import CATALOGUE

    if list:
        summaries = {key: entry.summary for key, entry in CATALOGUE.items()}
        return Answer({"studies": summaries}, tuple(f"{k:22} {v}" for k, v in summaries.items()), output.json)
    if name not in CATALOGUE:
        raise InputError(f"Input name must be one of {', '.join(CATALOGUE)}; instead received {name}.")
    from .study_job import study_job

    values, lines = study_job(name, quick, engine.checked(), output.out)
    return Answer(values, tuple(lines), output.json)


def figure(result: Path, *, output: Output = Output()) -> Answer:
    """The figures of a result as PNG and PDF, from its file alone.

    Parameters
    ----------
    result
        A netCDF file that spinlev has written.
    """
    from .drawings import draw_result

    files = draw_result(result, output.out)
    return Answer({"figures": files}, tuple(f"Figure in {file}" for file in files), output.json)
