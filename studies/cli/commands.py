"""The commands about one scene: run, field, equilibria, simulate, plate.

The numeric libraries are imported once the input has been found good: a wrong scene is answered at once.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, Parameter

from ...geometry.basics import InputError
from ..terminal import (
    Answer,
    FieldModel,
    Models,
    Output,
    default_scene,
    map_extent,
    positive,
    read_points,
    three_numbers,
)

if TYPE_CHECKING:
    from ...geometry.scenes import Scene

ReactionModel = Literal["slab", "fem", "reduced", "auto"]
Plane = Literal["xy", "xz", "yz"]


def add_scene_commands(app: App) -> None:
    """Let the command line know these commands."""
    for command in (run, field, plate, equilibria, simulate):
        app.command(command)


def _loaded(scene: Path) -> "Scene":
    from ...geometry.scenes import load_scene

    return load_scene(scene)


def _check_spin(spin: float) -> None:
    if not -1e3 <= spin <= 1e3:
        raise InputError(f"Input --spin must be between -1000 and 1000; instead received {spin}.")


def run(
    scene: Path | None = None,
    *,
    asked: Models = Models(),
    spin: float = 0.0,
    duration_s: float = 10.0,
    output: Output = Output(),
) -> Answer:
    """Everything about one scene: its field, where the floater levitates, a flight, figures and pictures.

    Writes result.nc, summary.json and the pictures.

    Parameters
    ----------
    scene
        Scene file (left out: the one that comes with the program).
    spin
        Body spin S = Ω·m̂/ω of the floater about its own moment; a flight from an equilibrium begins with it.
    duration_s
        Simulated time, s.
    """
    positive("--duration-s", duration_s)
    _check_spin(spin)
    loaded = _loaded(scene or default_scene())
    from ...fem.storage import owned
    from ..one_scene import main_job
    from ..rendering import copied

    with copied() as drawing, owned(output.out):
        return Answer(*main_job(loaded, asked.checked(), spin, duration_s, output.out, drawing), output.json)


def field(
    scene: Path,
    *,
    points: Path | None = None,
    plane: Plane | None = None,
    extent_mm: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    offset_mm: Annotated[float, Parameter(allow_leading_hyphen=True)] = 0.0,
    steps: int = 121,
    working_point: Annotated[bool, Parameter(negative="")] = False,
    model: FieldModel = "auto",
    rtol: float = 3e-6,
    output: Output = Output(),
) -> Answer:
    """B and its gradient at points in the rotor's frame at t = 0, maps of the field on a plane, or the working point.

    Points may lie in the magnets. Maps are those of every model and their differences: field-map.nc, .png and .vtu.
    The working point says whether the magnets demagnetise: working-point.nc, .json and .png.

    Parameters
    ----------
    scene
        Scene file.
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
        The lowest μ0H along each magnet's easy axis instead, the floater where it levitates, against coercivity_kA_m.
    model
        Field model at points; maps show dipole, closed form and finite elements.
    rtol
        Relative accuracy asked of the field wherever the floater can be.
    """
    asked = Models(model, rtol=rtol).checked()
    if (given := (points is not None) + (plane is not None) + working_point) != 1:
        raise InputError(
            f"Input --points must be given, or --plane, or --working-point; instead received {given or 'none'} of them."
        )
    if working_point:
        from ..one_scene import Levitation, working_point_job

        return Answer(*working_point_job(Levitation(_loaded(scene), asked), output.out), output.json)
    if plane is not None:
        extent = None if extent_mm is None else map_extent(extent_mm)
        if not 5 <= steps <= 1001:
            raise InputError(f"Input --steps must be between 5 and 1001; instead received {steps}.")
        from ..exchange import field_map_job

        return Answer(*field_map_job(_loaded(scene), plane, extent, offset_mm * 1e-3, steps, output.out), output.json)
    assert points is not None
    loaded, places = _loaded(scene), read_points(points)
    from ..one_scene import field_job

    return Answer(*field_job(loaded, places, asked, output.out), output.json)


def equilibria(
    scene: Path,
    *,
    asked: Models = Models(),
    spin: float = 0.0,
    output: Output = Output(),
) -> Answer:
    """Every place where the floater can hang in step with the rotor, and whether it stays there.

    Parameters
    ----------
    scene
        Scene file.
    spin
        Body spin S = Ω·m̂/ω of the floater about its own moment.
    """
    _check_spin(spin)
    loaded = _loaded(scene)
    from ..one_scene import equilibria_job

    return Answer(*equilibria_job(loaded, asked.checked(), spin, output.out), output.json)


def simulate(
    scene: Path,
    *,
    duration_s: float,
    asked: Models = Models(),
    resume: Annotated[bool, Parameter(negative="")] = False,
    output: Output = Output(),
) -> Answer:
    """The floater's motion and how it ended; writes trajectory.nc and its figure.

    Parameters
    ----------
    scene
        Scene file.
    duration_s
        Simulated time, s.
    resume
        Go on from the checkpoint of the same flight in --out, if one is there.
    """
    positive("--duration-s", duration_s)
    loaded = _loaded(scene)
    from ..one_scene import simulate_job

    return Answer(*simulate_job(loaded, asked.checked(), duration_s, output.out, resume), output.json)


def plate(
    scene: Path,
    *,
    at: Annotated[str, Parameter(allow_leading_hyphen=True)],
    frequency_hz: float,
    model: ReactionModel = "auto",
    rtol: float = 1e-3,
    output: Output = Output(),
) -> Answer:
    """What the plate's eddy currents answer to a dipole: G in B = G m at its own place, phasors e^(+iωt).

    Parameters
    ----------
    scene
        Scene file with a plate.
    at
        Place X,Y,Z of the dipole in the laboratory frame, mm.
    frequency_hz
        Frequency of the dipole, Hz.
    model
        slab (infinite, exact), fem, reduced (a table around the place), or auto.
    rtol
        Relative accuracy asked of the tensor.
    """
    positive("--rtol", rtol)
    place = three_numbers("--at", at)
    loaded = _loaded(scene)
    from ..one_scene import plate_job

    return Answer(*plate_job(loaded, place * 1e-3, frequency_hz, model, rtol, output.out), output.json)
