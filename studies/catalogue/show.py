"""The command `show`: three-dimensional pictures and an animation of a result."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from ...dynamics.motion import State
from ...fem.storage import write_whole
from ...geometry.basics import InputError
from ...geometry.scenes import Scene, parse_scene
from ..one_scene import Levitation, sources
from ..pictures import flight_frames, last_view, plate_currents
from ..rendering import Currents, Turnable, current_places, drawn, page, render
from ..terminal import Models, note, progress
from .drawings import read_result


def show_job(path: Path, out: Path, html: bool = False) -> list[str]:
    """Write NAME-scene.png, NAME-flight.gif and, if `html`, NAME-view.html of a flight; returns the files.

    Raises
    ------
    InputError : the file is no result of this program, or of a study, in which there is no single scene to be seen
    RenderError : no picture can be drawn, or not all; those that could be are written
    """
    result = read_result(path)
    if "scene" not in result.attrs or "position_rotor_frame" not in result:
        raise InputError(
            f"Input {path} must hold a flight (result.nc of `run`, trajectory.nc of `simulate`); instead it is of "
            f"'{result.attrs['study']}'. Its figures: spinlev figure {path}"
        )
    scene, motion = flight_of(result, str(path))
    table = Levitation(scene, Models(result.attrs.get("model", "auto"))).table
    time = result["time"].values
    view = last_view(scene, table, time, motion)
    if scene.plate is not None:
        note("Currents in the plate ...")
        places = current_places(scene.plate.box, view.position)
        floater = replace(State(*(vector[-1] for vector in motion.vectors)), position=view.position)
        density = plate_currents(scene, scene.plate, sources(table), floater, places)
        view = replace(view, currents=Currents(places, density))
    picture, animation = (out / f"{path.stem}-{name}" for name in ("scene.png", "flight.gif"))
    with progress("Pictures") as advance:
        render({picture: view, animation: flight_frames(scene, time, motion)}, advance)
    files = [str(picture), str(animation)]
    if html:
        turned = out / f"{path.stem}-view.html"
        write_whole(turned, page(drawn(Turnable(view))))
        files.append(str(turned))
    return files


def flight_of(result: xr.Dataset, source: str) -> tuple[Scene, State]:
    """The scene at the end of the flight that a result holds, and its motion along the rotor's axes."""
    scene = _at_end(parse_scene(str(result.attrs["scene"]), source), float(result["time"][-1]))
    names = ("position", "velocity", "moment", "spin")
    laboratory = State(*(result[name].values for name in names))
    return scene, laboratory.to_rotor(scene.angular_velocity * result["time"].values)


def _at_end(scene: Scene, time: float) -> Scene:
    """The scene with its plate where the lowering has brought it."""
    plate = scene.plate
    if plate is None or plate.lowering is None:
        return scene
    center = plate.box.center - np.array([0.0, 0.0, plate.lowering.depth(time)])
    return replace(scene, plate=replace(plate, box=replace(plate.box, center=center), lowering=None))
