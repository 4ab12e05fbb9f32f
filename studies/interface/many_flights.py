"""Very many flights of one scene from Python."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...dynamics.ensembles import Endings, ensemble as flown
from ...dynamics.motion import State
from ...geometry.basics import InputError
from ...geometry.scenes import Scene, scene_text
from ..one_scene import Levitation
from ..results import AXIS, variable
from ..sweeps import mapped
from ..terminal import FieldModel, InteractionModel, Models, Workers, heard, positive
from .starts import drawn_starts, given_starts

TOGETHER = 512
"""Flights that a worker gets at once, at most."""
COLUMNS = {
    "position": ("m", "position, laboratory frame,"),
    "velocity": ("m/s", "velocity, laboratory frame,"),
    "moment": ("1", "direction of the moment, laboratory frame,"),
    "spin": ("rad/s", "angular velocity, laboratory frame,"),
}


def ensemble(
    scene: Scene | str | Path,
    starts: Mapping[Any, Any] | None = None,
    duration: float = 3.0,
    n: int | None = None,
    seed: int = 0,
    spread: Mapping[str, Any] | None = None,
    model: FieldModel = "auto",
    rtol: float = Models.rtol,
    interaction: InteractionModel = "auto",
    workers: int | None = 1,
    progress: bool = False,
) -> xr.Dataset:
    """How very many flights of one scene end, flown side by side; a plate is an obstacle, its currents are left out.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the path of its file.
    starts : dict or xarray.Dataset, optional
        By key of the scene file's `[start]`, three numbers for each flight (n, 3), or three for all: "offset_mm" from
        the stable equilibrium, or "position_mm" with "velocity_mm_s", "moment" and "spin_hz".
    duration : float
        Of each flight, s.
    n : int, optional
        Instead of `starts`: so many flights from about where the scene begins.
    seed : int
        Of the random numbers; the same gives the same flights, to the last bit, with any number of workers.
    spread : dict, optional
        Standard deviations of "offset_mm" (at rest in the turning frame), "velocity_mm_s", "moment_deg" and "spin_hz",
        each one number or three.
    model : {"auto", "dipole", "cuboid", "fem", "map"}
        Model of the rotor's field.
    rtol : float
        Relative accuracy asked of the field.
    interaction : {"auto", "rigid", "mutual"}
        Whether rotor and floater magnetise each other.
    workers : int or None
        Processes, None for one a core.
    progress : bool
        Whether messages go to standard error.

    Returns
    -------
    xarray.Dataset
        Over `flight` and `axis`, SI units: `levitated`, `ended_by` ("duration", "contact", "lost"), the state at
        the end and, as ``start_...``, at the beginning, in the laboratory frame as in `simulate`;
        `position_rotor_frame` is where the end is in the frame that turns with the rotor.
        Accuracy: the field errs by 1e-6 of its gradient, steps by round-off.

    Raises
    ------
    InputError
        Starts that are not allowed, with what is.
    EquilibriumError
        A flight shall begin near an equilibrium, and there is none.

    Examples
    --------
    >>> import spinlev as sl
    >>> cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    >>> ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    >>> scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=ball)
    >>> flights = sl.ensemble(scene, {"offset_mm": [[0, 0, 0.1], [0, 0, 9.0]]}, 0.2, model="dipole")
    >>> flights.ended_by.values.tolist()
    ['duration', 'contact']
    """
    positive("duration", duration)
    number = Workers(workers).checked().workers or os.cpu_count() or 1
    with heard(progress):
        levitation = Levitation(scene, Models(model, "none", rtol, interaction=interaction))
        begun = _begun(levitation, starts, n, seed, spread)
        count = len(begun.position)
        together = min(TOGETHER, -(-count // number))
        asked = levitation.scene, levitation.interaction, begun, duration
        found = flown(*asked, map if number == 1 else mapped(number), together)
        drawn = {} if starts is not None else {"seed": seed, "spread": repr(spread)}
        labels = {**levitation.labels, "scene": scene_text(levitation.scene), "duration_s": duration, **drawn}
    return _dataset(begun, found, levitation.scene.angular_velocity).assign_attrs(study="ensemble", **labels)


def _begun(
    levitation: Levitation, starts: Mapping[Any, Any] | None, n: int | None, seed: int, spread: Mapping[str, Any] | None
) -> State:
    if (starts is None) == (n is None):
        raise InputError("Input starts must be given, or n with spread; instead received both or neither.")
    if starts is not None:
        return given_starts(levitation, starts)
    for name, value, least in (("n", n, 1), ("seed", seed, 0)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
            raise InputError(f"Input {name} must be a whole number, {least} at least; instead received {value!r}.")
    return drawn_starts(levitation, int(n or 0), int(seed), spread or {})


def _dataset(begun: State, found: Endings, angular_velocity: float) -> xr.Dataset:
    """Ends in the laboratory, whose axes are the rotor's at t = 0; angular velocity of the rotor, rad/s."""
    dims = ("flight", "axis")
    label = "position, rotor's frame, at the end"
    states = {"position_rotor_frame": variable(dims, found.last.position, "m", label)}
    last = found.last.to_lab(angular_velocity * found.levitated_s)
    for prefix, when, state in (("", " at the end", last), ("start_", " at t = 0", begun)):
        for (name, (unit, label)), values in zip(COLUMNS.items(), state.vectors, strict=True):
            states[prefix + name] = variable(dims, values, unit, label + when)
    ends = {
        "levitated": variable(("flight",), found.levitated_s, "s", "levitation time"),
        "ended_by": (("flight",), found.ended_by),
    }
    return xr.Dataset({**ends, **states}, {"axis": list(AXIS)})
