"""The commands; their docstrings are the help, and they return numbers for a program and lines for a person.

The numeric libraries are imported in them, once the input has been found good: a wrong scene is answered at once.
"""

import html
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ...geometry.common import InputError
from . import options
from .console import note
from .options import Answer, Flag, Models, Output, Place, ResultFile, SceneFile, Spin, Workers

if TYPE_CHECKING:
    from ...geometry.scene.contents import Scene


def _loaded(scene: Path) -> "Scene":
    from ...geometry.scene.files import load_scene

    return load_scene(scene)


def run(
    scene: Path | None = None,
    *,
    requested: Models = Models(),
    spin: float = 0.0,
    duration_s: float = 10.0,
    quick: Flag = False,
    gradient: Flag = False,
    output: Output = Output(),
) -> Answer:
    """Everything about one scene: field, equilibria and their stability, a trajectory, figures and pictures.

    Writes result.nc, summary.json and the pictures.

    Parameters
    ----------
    scene
        Scene file (left out: the one that comes with the program).
    spin
        Body spin S = Ω·m̂/ω of the floater about its own moment; a trajectory from an equilibrium begins with it.
    duration_s
        Simulated time, s.
    quick
        Field to 0.1 %, plate's response to 5 %, no mutual magnetisation: half a minute for most scenes.
    gradient
        Also the derivatives of the equilibria by all numbers of the scene file, gradient.nc.
    """
    options.positive("--duration-s", duration_s)
    options.check_between("--spin", spin, options.SPINS)
    requested = requested.checked()
    if quick:
        rtol, plate_rtol = max(requested.rtol, 1e-3), max(requested.plate_rtol, 0.05)
        requested = replace(requested, rtol=rtol, plate_rtol=plate_rtol)
        requested = replace(requested, interaction="rigid") if requested.interaction == "auto" else requested
    loaded = _loaded(scene or options.shipped_scene())
    from ...fem.cache import owned
    from ..run import main_job

    with owned(output.folder):
        values, lines = main_job(loaded, requested, spin, duration_s, output.folder, gradient)
    said = f"Quick: field to {requested.rtol:.1%}, plate's response to {requested.plate_rtol:.0%}."
    return values, [*lines, said] if quick else lines


def field(
    scene: SceneFile,
    *,
    points: Path | None = None,
    plane: Literal["xy", "xz", "yz"] | None = None,
    extent_mm: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    offset_mm: Annotated[float, Parameter(allow_leading_hyphen=True)] = 0.0,
    steps: int = 121,
    working_point: Flag = False,
    model: options.FieldModel = "auto",
    rtol: float = Models.rtol,
    output: Output = Output(),
) -> Answer:
    """B and its gradient at points in the rotor's frame at t = 0, maps of the field on a plane, or the working point.

    Points may lie in the magnets. Maps are those of every model and their differences: field-map.nc, .png and .vtu.
    The working point says whether the magnets demagnetise: working-point.nc, .json and .png.

    Parameters
    ----------
    points
        CSV file with the columns x_mm, y_mm, z_mm.
    plane
        Maps on the plane xy, xz or yz instead.
    extent_mm
        Half the width of the maps, or their ends LEFT,RIGHT,LOWER,UPPER, mm; left out: twice the rotor's.
    offset_mm
        Third coordinate of the plane, mm.
    steps
        Points along the longer side of the maps.
    working_point
        Instead the lowest μ0H along each easy axis, with the floater where it levitates, against coercivity_kA_m.
    model
        Field model at points; maps show dipole, closed form and finite elements.
    rtol
        Relative accuracy of the field wherever the floater can be; 1e-3 is enough for a figure.
    """
    requested = Models(model, rtol=rtol).checked()
    if (given := (points is not None) + (plane is not None) + working_point) != 1:
        instead = f"received {given or 'none'} of them."
        raise options.wrong("--points", "be given, or --plane, or --working-point", instead)
    if working_point:
        from ..fields import working_point_job
        from ..levitation import Levitation

        return working_point_job(Levitation(_loaded(scene), requested), output.folder)
    if plane is not None:
        extent = None if extent_mm is None else options.map_extent(extent_mm)
        options.check_between("--steps", steps, options.STEPS, whole=True)
        from ..fields import field_map_job

        offset = options.finite("--offset-mm", offset_mm) * 1e-3
        return field_map_job(_loaded(scene), plane, extent, offset, steps, output.folder)
    assert points is not None
    loaded, places = _loaded(scene), options.read_points(points)
    from ..run import field_job

    return field_job(loaded, places, requested, output.folder)


def equilibria(
    scene: SceneFile,
    *,
    requested: Models = Models(),
    spin: Spin = 0.0,
    gradient: Flag = False,
    output: Output = Output(),
) -> Answer:
    """All equilibria of the floater, frequency-locked to the rotor, with their modes and stability.

    Parameters
    ----------
    gradient
        Also their derivatives by all numbers of the scene file, gradient.nc.
    """
    options.check_between("--spin", spin, options.SPINS)
    loaded = _loaded(scene)
    from ..run import equilibria_job

    return equilibria_job(loaded, requested.checked(), spin, output.folder, gradient)


def compare(
    scene: SceneFile,
    *,
    frequency_hz: str | None = None,
    plate_model: options.PlateModel = "auto",
    rtol: float | None = None,
    plate_rtol: float = Models.plate_rtol,
    spin: Spin = 0.0,
    output: Output = Output(),
) -> Answer:
    """May the point dipole be used? Every field model's results for one scene, under the same conditions.

    Dipole, dipole of the true moment, cuboid (μr = 1), finite elements, and those with mutual magnetisation: a table,
    a figure over the frequency, compare.nc and compare.json.

    Parameters
    ----------
    frequency_hz
        Frequencies of the figure, FIRST:LAST:STEP or VALUE,VALUE,... in Hz; left out: about the stable ones.
    plate_model
        none, slab, fem or reduced, or auto, of all field models alike.
    rtol
        Relative accuracy of the field wherever the floater can be; left out: 3e-6, and 1e-4 for parts of STEP files.
    plate_rtol
        Relative accuracy of the plate's response.
    """
    options.check_between("--spin", spin, options.SPINS)
    frequencies = None if frequency_hz is None else options.frequency_grid(frequency_hz)
    loaded = _loaded(scene)
    from ..compare import compare_job, field_rtol

    found = field_rtol(loaded) if rtol is None else rtol
    requested = Models(plate_model=plate_model, rtol=found, plate_rtol=plate_rtol).checked()
    return compare_job(loaded, requested, spin, frequencies, output.folder)


def simulate(
    scene: SceneFile,
    *,
    duration_s: float | None = None,
    ramp: str | None = None,
    requested: Models = Models(),
    resume: Flag = False,
    output: Output = Output(),
) -> Answer:
    """Trajectory of the floater and how it ended; writes trajectory.nc and its figure.

    Parameters
    ----------
    duration_s
        Simulated time, s; with a ramp, or a drive in the scene, until it is over where left out.
    ramp
        Turn the rotor from one frequency to another, FROM:TO:RATE in Hz and Hz/s, such as 160:80:0.2, until the floater
        is lost: at which frequency, and the way there against the equilibria.
    resume
        Go on from the checkpoint of the same trajectory in --out, if one is there.
    """
    step = None if ramp is None else options.ramp(ramp)
    if duration_s is not None:
        options.positive("--duration-s", duration_s)
    loaded = _loaded(scene)
    if step:
        from ...geometry.scene.files import driven

        loaded = driven(loaded, [step[1]], str(scene), frequency_hz=step[0])
    if not (duration := float(loaded.knots[0, -1]) if duration_s is None else duration_s):
        raise InputError("Input --duration-s must be given, or --ramp, or [[drive]] in the scene; instead none is.")
    from ...fem.cache import owned
    from ..run import simulate_job

    with owned(output.folder):
        return simulate_job(loaded, requested.checked(), duration, output.folder, resume)


def plate(
    scene: SceneFile,
    *,
    at: Place,
    frequency_hz: float,
    model: options.PlateModel = "auto",
    rtol: float = 1e-3,
    output: Output = Output(),
) -> Answer:
    """Response tensor of the plate: eddy-current field B = G m at the position of an oscillating dipole m.

    Phasors are e^(+iωt).

    Parameters
    ----------
    scene
        Scene file with a plate.
    at
        Place X,Y,Z of the dipole in the laboratory frame, mm.
    frequency_hz
        Frequency of the dipole, Hz.
    model
        slab (infinite, exact), fem, reduced (a table around the place), none (no currents, G = 0), or auto.
    rtol
        Relative accuracy of the tensor.
    """
    options.positive("--rtol", rtol)
    place = options.three_numbers("--at", at)
    loaded = _loaded(scene)
    from ..run import plate_job

    return plate_job(loaded, place * 1e-3, frequency_hz, model, rtol, output.folder)


def study(
    name: str | None = None,
    scene: Path | None = None,
    *,
    list: Flag = False,
    quick: Flag = False,
    vary: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    ask: options.Quantity = "equilibria",
    at: Place = "0,0,-20",
    spin: Spin = 0.0,
    duration_s: float = 3.0,
    requested: Models = Models(),
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
    scene
        Left out: studies are of the article's scenes; for your own there are `compare` and --vary.
    list
        Show the catalogue.
    quick
        Coarser, in less than a minute.
    vary
        A parameter of the scene and its values, KEY=FIRST:LAST:STEP or KEY=VALUE,VALUE,...; may be given again.
    ask
        What is computed with --vary.
    at
        Place X,Y,Z of the field, mm, rotor's frame.
    duration_s
        Duration of the trajectories, s.
    """
    if scene is not None:
        ways = f"spinlev compare {scene} (dipole against finite elements), or spinlev study {scene} --vary"
        instead = f"received {scene}. For a scene of your own: {ways} KEY=FIRST:LAST:STEP."
        raise options.wrong("scene", "be left out, as studies are of the article's scenes", instead)
    if vary:
        if name is None:
            raise InputError("Input name must be a scene file where --vary is given; instead it is missing.")
        values, place = options.parse_vary(vary), options.three_numbers("--at", at)
        options.positive("--duration-s", duration_s)
        loaded = _loaded(Path(name))
        from ..catalogue.runner import question_job
        from ..question import Question

        question = Question(loaded, name, ask, requested.checked(), spin, duration_s, tuple(1e-3 * place))
        return question_job(question, values, engine.checked(), output.folder)
    from ..catalogue.entries import CATALOGUE

    if list:
        summaries = {key: entry.summary for key, entry in CATALOGUE.items()}
        return {"studies": summaries}, [f"{k:22} {v}" for k, v in summaries.items()]
    if name not in CATALOGUE:
        raise options.unknown_study(name, CATALOGUE)
    from ..catalogue.runner import study_job

    return study_job(name, quick, engine.checked(), output.folder)


def design(goals: Path, *, requested: Models = Models(), output: Output = Output()) -> Answer:
    """The scene that meets a goal best within bounds and limits; of two goals the curve between (Pareto).

    Writes design.toml, the scene, with design.nc, design.json and a figure.

    Parameters
    ----------
    goals
        TOML file: `scene` (a scene file), `goals` (one or two of "largest margin", "shortest damping time", "lowest
        frequency", "heaviest floater", "lightest rotor"), `[free]` with bounds by key of the scene file, as
        "rotor.edge_mm" = [8.0, 12.0], and `[limits]` with a number, or least and most, as decay_per_s = [1.0, inf].
    """
    from ..design import design_job

    return design_job(goals, requested.checked(), output.folder)


def figure(result: ResultFile, *, output: Output = Output()) -> Answer:
    """The figures of a result as PNG and PDF, from its file alone; beside it, unless --out is given."""
    from ..catalogue.runner import draw_result

    files = draw_result(result, output.out or result.parent)
    return {"figures": files}, [f"Figure in {file}" for file in files]


def show(result: Path, *, html: Flag = False, output: Output = Output()) -> Answer:
    """Three-dimensional pictures of a trajectory, beside its file: scene and currents in the plate, animation, page.

    Parameters
    ----------
    result
        result.nc of `run` or trajectory.nc of `simulate`.
    html
        Also write a page in which the scene can be turned with the mouse.
    """
    from ..catalogue.runner import show_job

    files = show_job(result, output.out or result.parent, html)
    return {"pictures": files}, [f"Picture in {file}" for file in files]


def report(folder: Path, *, output: Output = Output()) -> Answer:
    """One page, report.html, about all results in a folder: figures, numbers, errors and where they come from.

    Parameters
    ----------
    folder
        Where `run` and `study` have written.
    """
    from ..catalogue.report import report_job

    page, names = report_job(folder, output.out or folder)
    return {"report": str(page), "results": names}, [f"Report in {page}"]


def cite(result: ResultFile, *, output: Output = Output()) -> Answer:
    """The papers behind what a result used, as BibTeX."""
    from ..catalogue.report import cite_job

    references = cite_job(result)
    return {"references": references}, references


def new(name: str, file: Path, *, output: Output = Output()) -> Answer:
    """A commented scene file to start from.

    Parameters
    ----------
    name
        Kind of rotor: tilt, horizontal, vertical or magnets.
    file
        Where to write it; an existing file is left alone.
    """
    path = options.new_scene(name, file)
    return {"file": str(path)}, [f"Written: {path}. Next: spinlev run {path}"]


def export(scene: SceneFile, file: Path, *, requested: Models = Models(), output: Output = Output()) -> Answer:
    """B, H and M inside and around the bodies, and J in the plate, for ParaView.

    Parameters
    ----------
    file
        File to write, OUT.vtu.
    """
    loaded = _loaded(scene)
    from ..fields import export_job

    return export_job(loaded, requested.checked(), file)


# A page that leads to another.
LEADING = """<!DOCTYPE html><meta charset="utf-8"><title>spinlev</title><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}"><a href="{address}">spinlev</a>
"""


def explore(
    scene: Path | None = None,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    no_browser: Flag = False,
    output: Output = Output(),
) -> tuple[Mapping[str, Any], list[str], Callable[[], None]]:
    """A page in the browser to play with a scene: sliders, equilibria at once, where it levitates, live motion.

    It serves until Ctrl-C. The address is the first line of standard output; only who has its token sees the page.

    Parameters
    ----------
    scene
        Scene file (left out: the one that comes with the program).
    host
        Address of this machine on which the page is served; any other than 127.0.0.1 lets other machines in, and
        nothing is encrypted.
    port
        Port; 0 takes one that is free.
    no_browser
        Only print the address.
    """
    options.check_between("--port", port, options.PORTS)
    source = scene or options.shipped_scene()
    loaded = _loaded(source)
    from ..page.server import serve

    pages = serve(loaded, str(source), host, port)
    if not pages.local:
        note(
            f"Other machines can open this page (--host {host}). What it sends, the token in its address included, is "
            "not encrypted: whoever sees the network's traffic can read it. Without --host it stays on this machine."
        )

    def serving() -> None:
        if no_browser:
            pages.run()
            return
        import webbrowser

        # Any user of the machine can read the command line of a browser, but this file only its owner.
        with tempfile.NamedTemporaryFile("w", prefix="spinlev-", suffix=".html", encoding="utf-8") as leading:
            leading.write(LEADING.format(address=html.escape(pages.address)))
            leading.flush()
            webbrowser.open(Path(leading.name).as_uri())
            pages.run()

    return {"address": pages.address}, [pages.address], serving
