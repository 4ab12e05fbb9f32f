"""Several floaters: what `simulate` computes of a scene that has more than one."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.flights.several import JointFlight, Together
from ..dynamics.flights.trajectory import DURATION, STOPPED, Checkpoint, FlightStopped
from ..dynamics.motion.events import CONTACT
from ..fem.rotor_metal import pieces_of
from ..geometry.common import InputError
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import scene_text
from .cli.console import note, progress
from .cli.options import Answer, Models, positive
from .effects import PLATE_NEGLECTED
from .figures.run import trajectory_figure
from .figures.style import save_figures
from .levitation import Levitation
from .plan import check_drive
from .result import DRIVE, columns, trajectory_dataset, write_dataset

LEFT_OUT = "Between the floaters: rigid magnetisation. What they induce in each other and in the rotor is left out."


def several(
    scene: Scene, requested: Models, duration: float, checkpoint: Checkpoint | None = None
) -> tuple[Together, Levitation]:
    """Trajectories of a scene's floaters for `duration` (s), and the models of the first.

    Raises InputError for an effect or a model that is not computed for several floaters, or what `JointFlight` raises.
    """
    positive("duration", duration)
    check_drive(scene, duration)
    for number, one in enumerate(scene.each):
        if one.floater.conductivity:
            raise InputError(
                f"Input floater[{number}].conductivity_S_m must be left out where there are several floaters, whose "
                f"currents by each other are not computed; instead received {one.floater.conductivity:.3g}."
            )
    if pieces_of(scene.rotor, scene.conductors):
        raise InputError(
            "Input rotor must have no conductivity_S_m where there are several floaters, as they share its currents, "
            "which is not computed; instead it has. Leave it out."
        )
    if scene.moving:
        raise InputError(
            "Input drive must have no center_mm and no axis where there are several floaters; instead it has."
        )
    if requested.interaction == "mutual":
        raise InputError(
            "Input --interaction must be rigid or auto where there are several floaters; instead received mutual."
        )
    if scene.plate and requested.plate_model not in ("auto", "none"):
        raise InputError(
            "Input --plate-model must be none or auto where there are several floaters, whose common currents in a "
            f"plate are not computed; instead received {requested.plate_model}."
        )
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
    """How the trajectories ended, in one sentence."""
    time, several = f"{found.trajectories[0].levitated_s:.4g} s", len(found.which) > 1
    if found.ended_by in (DURATION, STOPPED):
        return f"Simulated {time}: all {len(found.trajectories)} floaters still levitating."
    which = " and ".join(f"floater {number}" for number in found.which)
    if found.ended_by != CONTACT:
        return f"Simulated {time}, then {which} lost."
    return f"Simulated {time}, then contact of {which}{'' if several else ' with rotor or plate'}."


def several_summary(found: Together, levitation: Levitation) -> dict[str, Any]:
    flight, table = found.trajectories[0], levitation.table
    places = np.concatenate([one.rotor.position[:: max(1, len(one.time) // 500)] for one in found.trajectories])
    return {
        **levitation.labels,
        "error_estimate": float(table.relative_error(places[table.in_range(places)])[0].max()),
        "levitated_s": flight.levitated_s,
        "ended_by": found.ended_by,
        "ended_by_floaters": list(found.which),
        "ended_at_hz": float(flight.rate[-1]) / (2 * math.pi),
        "energy_error": flight.energy_error,
        "field_changes": vars(flight.field_changes),
        "realtime_factor": flight.realtime_factor,
        "not_modelled": [LEFT_OUT, *([PLATE_NEGLECTED] if levitation.scene.plate else [])],
    }


def several_job(scene: Scene, requested: Models, duration: float, out: Path, checkpoint: Checkpoint) -> Answer:
    """`simulate` of a `scene` with several floaters for `duration` (s); writes trajectory.nc and figures to `out`.

    The trajectories are kept in `checkpoint` while they last. Raises FlightStopped where the user stopped it, after
    what is finished was written, and what `several` raises.
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
    values = several_summary(found, levitation)
    lines = [outcome(found), *values["not_modelled"]]
    values |= {"trajectory": str(path), "tables_from_cache": levitation.from_cache}
    return values, [*lines, f"Trajectories in {path}, figures in {out / names[0]}.png and so on"]
