"""Motions that are not of one floater below a rotor: of several floaters, and of a conductor that coils carry."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..dynamics.flights import conductor
from ..dynamics.flights.several import JointFlight, Together
from ..dynamics.flights.trajectory import DURATION, STOPPED, Checkpoint, FlightStopped
from ..dynamics.motion.events import CONTACT
from ..fem.plate.floating import FloatingModes, FreeModes, Levitated, cached_floating_modes
from ..fem.rotor_metal import pieces_of
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import scene_text
from .cli.console import note, progress
from .cli.options import Answer, Models, positive, wrong
from .effects import PLATE_NEGLECTED
from .figures.run import trajectory_figure
from .figures.style import PALETTE, drawn, panels, save_figures
from .levitation import Levitation
from .plan import check_drive
from .result import DRIVE, Columns, columns, trajectory_dataset, variable, write_dataset

AMONG = "where there are several floaters"
LEFT_OUT = "Between the floaters: rigid magnetisation. What they induce in each other and in the rotor is left out."


def several(
    scene: Scene, requested: Models, duration: float, checkpoint: Checkpoint | None = None
) -> tuple[Together, Levitation]:
    """Trajectories of a `scene`'s floaters for a `duration` (s), kept in `checkpoint`, and the models of the first.

    Raises InputError for what is `requested` or in the scene and not computed for several, or as `JointFlight` does.
    """
    positive("duration", duration)
    check_drive(scene, duration)
    for number, one in enumerate(scene.each):
        if one.floater.conductivity:
            rule = f"be left out {AMONG}, whose currents by each other are not computed"
            name = f"floater[{number}].conductivity_S_m"
            raise wrong(name, rule, f"received {one.floater.conductivity:.3g}.")
    if pieces_of(scene.rotor, scene.conductors):
        rule = f"have no conductivity_S_m {AMONG}, as they share its currents, which is not computed"
        raise wrong("rotor", rule, "it has. Leave it out.")
    if scene.moving:
        raise wrong("drive", f"have no center_mm and no axis {AMONG}", "it has.")
    if requested.interaction == "mutual":
        raise wrong("--interaction", f"be rigid or auto {AMONG}", "received mutual.")
    if scene.plate and requested.plate_model not in ("auto", "none"):
        rule = f"be none or auto {AMONG}, whose common currents in a plate are not computed"
        raise wrong("--plate-model", rule, f"received {requested.plate_model}.")
    models = replace(requested, interaction="rigid", plate_model="none")
    first, *others = scene.each
    levitations = [Levitation(first, models)]
    levitations += [levitations[0].elsewhere(floater=o.floater, drag=o.drag, start=o.start) for o in others]
    flight = JointFlight(scene, [one.interaction for one in levitations], duration)
    note("Motion ...")
    with progress("Motion") as bar:
        return flight.fly(bar, checkpoint), levitations[0]


def several_dataset(found: Together, levitation: Levitation) -> xr.Dataset:
    """The trajectories over `floater` and `time`, SI units; with a drive also what the motor gave to all."""
    each = [trajectory_dataset(one) for one in found.trajectories]
    data = xr.concat(each, "floater", combine_attrs="override").assign_coords(floater=np.arange(len(each)))
    flight = found.trajectories[0]
    if flight.given is not None:
        motor = flight.rate / (2 * np.pi), *flight.motor.T, *flight.given.T
        data = data.assign(columns(dict(list(DRIVE.items())[: len(motor)]), motor))
    said = {**levitation.labels, "headline": outcome(found), "ended_by_floaters": list(found.which)}
    return data.transpose("floater", "time", ...).assign_attrs(said)


def outcome(found: Together) -> str:
    time, several = f"{found.trajectories[0].levitated_s:.4g} s", len(found.which) > 1
    if found.ended_by in (DURATION, STOPPED):
        return f"Simulated {time}: all {len(found.trajectories)} floaters still levitating."
    which = " and ".join(f"floater {number}" for number in found.which)
    if found.ended_by != CONTACT:
        return f"Simulated {time}, then {which} lost."
    return f"Simulated {time}, then contact of {which}{'' if several else ' with rotor or plate'}."


def several_job(scene: Scene, requested: Models, duration: float, out: Path, checkpoint: Checkpoint) -> Answer:
    """`simulate` of a `scene` with several floaters by `requested` models for `duration` (s); writes to `out`.

    A `checkpoint` is kept while it lasts. Raises FlightStopped after writing what is finished, and what `several`
    raises.
    """
    found, levitation = several(scene, requested, duration, checkpoint)
    path, data = out / "trajectory.nc", several_dataset(found, levitation).assign_attrs(scene=scene_text(scene))
    write_dataset(data, path)
    names = [f"trajectory-{k}" for k in range(len(found.trajectories))]
    save_figures({name: trajectory_figure(data.isel(floater=k)) for k, name in enumerate(names)}, out)
    if found.ended_by == STOPPED:
        note(f"It is in {path}; --resume goes on from there.")
        raise FlightStopped(found.trajectories[0])
    checkpoint.remove()
    flight, table = found.trajectories[0], levitation.table
    places = np.concatenate([one.rotor.position[:: max(1, len(one.time) // 500)] for one in found.trajectories])
    left_out = [LEFT_OUT, *([PLATE_NEGLECTED] if levitation.scene.plate else [])]
    return {
        **levitation.labels,
        "error_estimate": float(table.relative_error(places[table.in_range(places)])[0].max()),
        "levitated_s": flight.levitated_s,
        "ended_by": found.ended_by,
        "ended_by_floaters": list(found.which),
        "ended_at_hz": float(flight.rate[-1]) / (2 * np.pi),
        "energy_error": flight.energy_error,
        "field_changes": vars(flight.field_changes),
        "realtime_factor": flight.realtime_factor,
        "not_modelled": left_out,
        "trajectory": str(path),
        "tables_from_cache": levitation.from_cache,
    }, [outcome(found), *left_out, f"Trajectories in {path}, figures in {out / names[0]}.png and so on"]


# A conductor over coils

OVER_COILS: Columns = {
    "position": (("time", "axis"), "m", "position of the centre"),
    "velocity": (("time", "axis"), "m/s", "velocity"),
    "body_axes": (("time", "axis", "body_axis"), "1", "axes of the body as columns"),
    "spin": (("time", "axis"), "rad/s", "angular velocity"),
    "heat": (("time",), "J", "Joule heat in the floater"),
    "current": (("time", "coil"), "A", "current of a turn"),
}


def modes_of(scene: Scene, rtol: float = 1e-3) -> tuple[FloatingModes | FreeModes, bool]:
    """The modes of a scene's floater over its coils, and whether they were cached. Raises what `heights_over` does."""
    heights, supply = conductor.heights_over(scene), conductor.Supply(scene.coils)
    region = heights if conductor.on_axis(scene) else conductor.room_over(scene)
    frequency = max(conductor.LOWEST, *(coil.frequency for coil in scene.coils))
    assert scene.floater.conductivity is not None
    floater = scene.floater.bodies[0], scene.floater.conductivity
    return cached_floating_modes(Levitated(*floater, scene.coils, supply.shares, frequency), region, rtol, note)


def coils_summary(scene: Scene, duration: float, modes: FloatingModes | FreeModes) -> tuple[xr.Dataset, dict[str, Any]]:
    """Trajectory of a `scene` with coils for a `duration` (s) by `modes` of its conductor, and numbers for JSON."""
    height = np.nan
    if isinstance(modes, FreeModes):
        motion = conductor.free_motion(scene, modes, duration)
    else:
        motion = conductor.conductor_motion(scene, modes, duration)
        if all(isinstance(coil.current, float) for coil in scene.coils):  # no table of time
            height = conductor.levitation_height(scene, modes)
    currents = np.stack([coil.amperes(motion.time) for coil in scene.coils], axis=1)
    spin = np.einsum("nab,nb->na", motion.axes, motion.spin)
    found = columns(OVER_COILS, (motion.position, motion.velocity, motion.axes, spin, motion.heat, currents))
    axes = {"time": variable(("time",), motion.time, "s", "time"), "axis": list("xyz")}
    said = {"ended_by": motion.ended_by, "energy_error": motion.energy_error}
    levitated = float(motion.time[-1])
    place = [*(1e3 * scene.coils[0].center[:2]).tolist(), 1e3 * height]
    return xr.Dataset(found, axes, {"study": "coils", "scene": scene_text(scene), **said}), {
        "model": "fem",
        "error_estimate": modes.error,
        "levitated_s": levitated,
        **said,
        "realtime_factor": levitated / motion.seconds if motion.seconds else np.nan,
        "levitation_position_mm": None if np.isnan(height) else place,
    }


def coils_job(scene: Scene, duration: float, rtol: float, out: Path) -> Answer:
    """`simulate` of a `scene` with coils alone for a `duration` (s), mean force to `rtol`; writes to `out`."""
    modes, cached = modes_of(scene, rtol)
    result, values = coils_summary(scene, duration, modes)
    path = out / "trajectory.nc"
    write_dataset(result, path)
    save_figures({"trajectory": coils_figure(result)}, out)
    values |= {"trajectory": str(path), "tables_from_cache": ["floating"] if cached else []}
    mean = values["levitation_position_mm"]
    ended = {
        "duration": "still levitating",
        "contact": "it comes nearer to the coils than half of its height at the start",
        "lost": "it left the known heights",
    }
    lines = [f"Simulated {values['levitated_s']:.4g} s: {ended[values['ended_by']]}."]
    lines += [f"Mean forces balance with the centre at {mean[2]:.4g} mm."] if mean else []
    return values, [*lines, f"Trajectory in {path}, figure in {out / 'trajectory.png'}"]


@drawn
def coils_figure(result: xr.Dataset) -> Figure:
    """Height and heat against time."""
    figure, ((height, heat),) = panels(1, 2, 2.6)
    time = result["time"].values
    height.plot(time, 1e3 * result["position"].sel(axis="z"), color=PALETTE[0], lw=0.8)
    height.set(xlabel="time (s)", ylabel="height of the centre (mm)")
    across = result["position"].sel(axis=["x", "y"])
    if float(np.ptp(across.values, axis=0).max()) > 1e-6:
        for name, color in zip("xy", PALETTE[2:], strict=False):
            height.plot(time, 1e3 * across.sel(axis=name), color=color, lw=0.8, label=name)
        height.lines[0].set_label("z")
        height.set_ylabel("place of the centre (mm)")
    heat.plot(time, result["heat"], color=PALETTE[1], lw=0.8)
    heat.set(xlabel="time (s)", ylabel="Joule heat (J)")
    return figure
