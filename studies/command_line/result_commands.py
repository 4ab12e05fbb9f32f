"""The commands about many scenes and about results: study, figure, show, report, cite."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from ...geometry.basics import InputError
from ..terminal import Answer, Beside, Models, Output, Quantity, Workers, parse_vary, positive, three_numbers


def add_result_commands(app: App) -> None:
    """Let the command line know these commands."""
    for command in (study, figure, show, report, cite):
        app.command(command)


def study(
    name: str | None = None,
    *,
    list: Annotated[bool, Parameter(negative="")] = False,
    quick: Annotated[bool, Parameter(negative="")] = False,
    vary: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    ask: Quantity = "equilibria",
    at: Annotated[str, Parameter(allow_leading_hyphen=True)] = "0,0,-20",
    spin: float = 0.0,
    duration_s: float = 3.0,
    asked: Models = Models(),
    engine: Workers = Workers(),
    output: Output = Output(),
) -> Answer:
    """One study of the catalogue, or any quantity of a scene over any of its parameters.

    Writes NAME.nc (question.nc for your own), its figures as PNG and PDF, and says what it found. A study that was
    stopped goes on where it was.

    Parameters
    ----------
    name
        Name of the study; with --vary a scene file.
    list
        Show the catalogue.
    quick
        Coarser, in less than a minute.
    vary
        A parameter of the scene and its values, KEY=FIRST:LAST:STEP or KEY=VALUE,VALUE,...; may be given again.
    ask
        What is computed with --vary.
    at
        Place X,Y,Z of the field asked for, mm, rotor's frame.
    spin
        Body spin S = Ω·m̂/ω of the equilibria asked for.
    duration_s
        Duration of the flights asked for, s.
    """
    if vary:
        return _own_question(name, vary, (ask, at, spin, duration_s), asked, engine, output)
    from ..catalogue import CATALOGUE

    if list:
        summaries = {key: entry.summary for key, entry in CATALOGUE.items()}
        return Answer({"studies": summaries}, [f"{k:22} {v}" for k, v in summaries.items()], output.json)
    if name not in CATALOGUE:
        scene = " A scene needs --vary." if name and name.endswith(".toml") else ""
        raise InputError(f"Input name must be one of {', '.join(CATALOGUE)}; instead received {name}.{scene}")
    from ..catalogue import study_job

    return Answer(*study_job(name, quick, engine.checked(), output.out), output.json)


def _own_question(
    scene: str | None,
    vary: tuple[str, ...],
    what: tuple[Quantity, str, float, float],
    asked: Models,
    engine: Workers,
    output: Output,
) -> Answer:
    if scene is None:
        raise InputError("Input name must be a scene file where --vary is given; instead it is missing.")
    values, place = parse_vary(vary), three_numbers("--at", what[1])
    positive("--duration-s", what[3])
    from ...geometry.scenes import load_scene

    loaded = load_scene(scene)
    from ..catalogue import question_job
    from ..one_scene import Question

    question = Question(loaded, scene, what[0], asked.checked(), what[2], what[3], tuple(1e-3 * place))
    return Answer(*question_job(question, values, engine.checked(), output.out), output.json)


def figure(result: Path, *, output: Beside = Beside()) -> Answer:
    """The figures of a result as PNG and PDF, from its file alone; beside it, unless --out is given.

    Parameters
    ----------
    result
        A netCDF file that spinlev has written.
    """
    from ..catalogue import draw_result

    files = draw_result(result, output.out or result.parent)
    return Answer({"figures": files}, [f"Figure in {file}" for file in files], output.json)


def show(result: Path, *, html: Annotated[bool, Parameter(negative="")] = False, output: Beside = Beside()) -> Answer:
    """Three-dimensional pictures of a flight, beside its file: scene and currents in the plate, animation, page.

    Parameters
    ----------
    result
        result.nc of `run` or trajectory.nc of `simulate`.
    html
        Also write a page in which the scene can be turned with the mouse.
    """
    from ..catalogue import show_job

    files = show_job(result, output.out or result.parent, html)
    return Answer({"pictures": files}, [f"Picture in {file}" for file in files], output.json)


def report(folder: Path, *, output: Beside = Beside()) -> Answer:
    """One page, report.html, about all results in a folder: figures, numbers, errors and where they come from.

    Parameters
    ----------
    folder
        Where `run` and `study` have written.
    """
    from ..catalogue import report_job

    page, names = report_job(folder, output.out or folder)
    return Answer({"report": str(page), "results": names}, [f"Report in {page}"], output.json)


def cite(result: Path, *, output: Output = Output()) -> Answer:
    """The papers behind what a result used.

    Parameters
    ----------
    result
        A netCDF file that spinlev has written.
    """
    from ..catalogue import cite_job

    references = cite_job(result)
    return Answer({"references": references}, references, output.json)
