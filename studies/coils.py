"""A conductor over coils: what `simulate` computes of a scene with coils."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..dynamics.flights.conductor import (
    ConductorMotion,
    Supply,
    conductor_motion,
    heights_over,
    levitation_height,
    sources_of,
)
from ..fem.plate.floating import FloatingModes, cached_floating_modes
from ..geometry.scene.contents import Scene
from .cli.console import note
from .cli.options import Answer
from .figures.style import PALETTE, panels, save_figures
from .result import Columns, columns, variable, write_dataset

LOWEST = 50.0  # Frequency (Hz) for which modes are made at least: of steady coils the motion alone drives currents
COLUMNS: Columns = {
    "position": (("time", "axis"), "m", "position of the centre"),
    "velocity": (("time", "axis"), "m/s", "velocity"),
    "heat": (("time",), "J", "Joule heat in the floater"),
    "current": (("time", "coil"), "A", "current of a turn"),
}


def modes_of(scene: Scene, rtol: float = 1e-3) -> tuple[FloatingModes, bool]:
    """The modes of a scene's floater over its coils, and whether they were cached. Raises what `heights_over` does."""
    heights, supply = heights_over(scene), Supply(scene.coils, sources_of(scene.coils))
    frequency = max(LOWEST, *(coil.frequency for coil in scene.coils))
    assert scene.floater.conductivity is not None
    return cached_floating_modes(
        scene.floater.bodies[0], scene.floater.conductivity, scene.coils, supply.shares, heights, frequency, rtol, note
    )


def motion_dataset(scene: Scene, motion: ConductorMotion) -> xr.Dataset:
    """A trajectory over `time`, SI units."""
    along = np.array([0.0, 0.0, 1.0])
    place = np.array([*scene.coils[0].center[:2], 0.0]) + motion.height[:, None] * along
    currents = np.stack([coil.amperes(motion.time) for coil in scene.coils], axis=1)
    found = columns(COLUMNS, (place, motion.speed[:, None] * along, motion.heat, currents))
    axes = {"time": variable(("time",), motion.time, "s", "time"), "axis": list("xyz")}
    said = {"study": "coils", "ended_by": motion.ended_by, "energy_error": motion.energy_error}
    return xr.Dataset(found, axes, said)


def coils_summary(scene: Scene, duration: float, modes: FloatingModes) -> tuple[xr.Dataset, dict[str, Any]]:
    """The trajectory of a scene with coils, and its numbers for JSON.

    Parameters
    ----------
    scene, modes : as of `conductor_motion`
    duration : s
    """
    motion = conductor_motion(scene, modes, duration)
    mean = float("nan")
    if all(isinstance(coil.current, float) for coil in scene.coils):  # no table of time
        supply = Supply(scene.coils, sources_of(scene.coils))
        mean = levitation_height(modes, supply, -scene.floater.mass * float(scene.gravity[2]))
    levitated = float(motion.time[-1])
    values = {
        "model": "fem",
        "error_estimate": modes.error,
        "levitated_s": levitated,
        "ended_by": motion.ended_by,
        "energy_error": motion.energy_error,
        "realtime_factor": levitated / motion.seconds if motion.seconds else float("nan"),
        "levitation_position_mm": None if np.isnan(mean) else [*(1e3 * scene.coils[0].center[:2]).tolist(), 1e3 * mean],
    }
    return motion_dataset(scene, motion), values


def coils_job(scene: Scene, duration: float, rtol: float, out: Path) -> Answer:
    """`simulate` of a scene with coils; writes trajectory.nc and its figure.

    Parameters
    ----------
    scene : without rotor and plate
    duration : s
    rtol : relative accuracy asked of the mean force
    out : folder of the files

    Raises
    ------
    InputError : as of `heights_over`
    """
    modes, cached = modes_of(scene, rtol)
    result, values = coils_summary(scene, duration, modes)
    path = out / "trajectory.nc"
    write_dataset(result, path, scene)
    save_figures({"trajectory": coils_figure(result)}, out)
    values |= {"trajectory": str(path), "tables_from_cache": ["floating"] if cached else []}
    mean = values["levitation_position_mm"]
    ended = {"duration": "still levitating", "contact": "it touches the coils", "lost": "it left the known heights"}
    lines = [f"Simulated {values['levitated_s']:.4g} s: {ended[values['ended_by']]}."]
    lines += [f"Mean forces balance with the centre at {mean[2]:.4g} mm."] if mean else []
    return values, [*lines, f"Trajectory in {path}, figure in {out / 'trajectory.png'}"]


def coils_figure(result: xr.Dataset) -> Figure:
    """Height and heat against time."""
    figure, ((height, heat),) = panels(1, 2, 2.6)
    time = result["time"].values
    height.plot(time, 1e3 * result["position"].sel(axis="z"), color=PALETTE[0], lw=0.8)
    height.set(xlabel="time (s)", ylabel="height of the centre (mm)")
    heat.plot(time, result["heat"], color=PALETTE[1], lw=0.8)
    heat.set(xlabel="time (s)", ylabel="Joule heat (J)")
    return figure
