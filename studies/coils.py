"""Coils: their field at t = 0, and what `simulate` computes of a conductor that they carry."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..dynamics.flights import conductor
from ..fem.closed_forms.coil import coils_field
from ..fem.plate.floating import FloatingModes, FreeModes, Levitated, cached_floating_modes
from ..geometry.common import Array
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import scene_text
from .cli.console import note
from .cli.options import Answer
from .figures.style import PALETTE, drawn, panels, save_figures
from .result import Columns, columns, variable, write_dataset

COLUMNS: Columns = {
    "position": (("time", "axis"), "m", "position of the centre"),
    "velocity": (("time", "axis"), "m/s", "velocity"),
    "body_axes": (("time", "axis", "body_axis"), "1", "axes of the body as columns"),
    "spin": (("time", "axis"), "rad/s", "angular velocity"),
    "heat": (("time",), "J", "Joule heat in the floater"),
    "current": (("time", "coil"), "A", "current of a turn"),
}


def coils_at_start(scene: Scene, points: Array) -> tuple[Array, Array]:
    """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m of a scene's coils at points (n, 3) m at t = 0, also in their windings."""
    return coils_field(scene.coils, np.array([float(coil.amperes(0.0)) for coil in scene.coils]), points)


def modes_of(scene: Scene, rtol: float = 1e-3) -> tuple[FloatingModes | FreeModes, bool]:
    """The modes of a scene's floater over its coils, and whether they were cached. Raises what `heights_over` does."""
    heights, supply = conductor.heights_over(scene), conductor.Supply(scene.coils, conductor.sources_of(scene.coils))
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
            supply = conductor.Supply(scene.coils, conductor.sources_of(scene.coils))
            height = conductor.levitation_height(modes, supply, -scene.floater.mass * float(scene.gravity[2]))
    currents = np.stack([coil.amperes(motion.time) for coil in scene.coils], axis=1)
    spin = np.einsum("nab,nb->na", motion.axes, motion.spin)
    found = columns(COLUMNS, (motion.position, motion.velocity, motion.axes, spin, motion.heat, currents))
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
    """`simulate` of a `scene` with coils, without rotor and plate, for a `duration` (s); writes trajectory.nc to `out`.

    The mean force is accurate to `rtol`. Raises InputError as `heights_over` does.
    """
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
