"""What a plate does to levitation: damping of each small motion, drag, lift and loss against its place and material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache

import numpy as np
import xarray as xr

from ..dynamics import Equilibrium, Rates, Survey, starting_point, survey, with_plate
from ..dynamics.plate_action import plate_action
from ..fem.cache import cached_rotor_table
from ..fem.table import RotorTable
from ..geometry import InputError, load_scene
from ..geometry.box import Array, Box, rotation_matrix
from ..geometry.scene import Plate, Scene
from .console import note
from .plate_shelf import plate_memory
from .results import AXIS, MODES, variable
from .shipped_scenes import shipped_scene
from .study import Point

SIZE = (0.1, 0.24, 0.03)
"""Edges of the article's plate, m."""
CONDUCTIVITY, DISTANCE = 3.5e7, 0.018
"""Defaults of the sweeps: aluminium, S/m; face below or beside the floater's centre, m."""
RTOL = 3e-3


@dataclass(frozen=True)
class Case:
    """One plate.

    Parameters
    ----------
    sweep : what is varied
    value : of that, SI
    model : slab or reduced
    upright : beside the floater instead of below it
    distance : of the face from the floater's centre, m
    thickness : m
    conductivity : S/m
    """

    sweep: str
    value: float
    model: str = "slab"
    upright: bool = False
    distance: float = DISTANCE
    thickness: float = SIZE[2]
    conductivity: float = CONDUCTIVITY

    def plate(self, place: Array) -> Plate:
        """The plate for a floater at `place` (3,) m."""
        size = np.array([SIZE[0], SIZE[1], self.thickness])
        away = self.distance + self.thickness / 2
        if self.upright:
            center = np.array([away, 0.0, place[2]])
            return Plate(Box(size, center, rotation_matrix((0.0, 90.0, 0.0))), self.conductivity)
        return Plate(Box(size, np.array([0.0, 0.0, place[2] - away])), self.conductivity)


def cases(quick: bool) -> list[Case]:
    """The plates of the study."""
    few = 5 if quick else 11
    found = [Case("below", d, distance=d) for d in np.geomspace(0.0085, 0.06, few).tolist()]
    found += [Case("beside", d, upright=True, distance=d) for d in np.geomspace(0.01, 0.06, few).tolist()]
    found += [Case("conductivity", s, conductivity=s) for s in np.geomspace(1e6, 6e7, few).tolist()]
    found += [Case("thickness", t, thickness=t) for t in np.geomspace(1e-3, 5e-2, few).tolist()]
    if not quick:
        found += [Case("below, real plate", d, "reduced", distance=d) for d in (0.012, 0.018, 0.03)]
        found += [Case("beside, real plate", d, "reduced", True, d) for d in (0.012, 0.018, 0.03)]
    return found


def damping_points(quick: bool) -> list[Point]:
    """The plates as points of the study."""
    return [asdict(case) for case in cases(quick)]


def plate_damping(point: Point) -> xr.Dataset:
    """Levitation of the scene `tilt-over-plate` with another plate in place of its own.

    Returns
    -------
    Dataset over `case`: growth and frequency of each mode, displacement, mean force, torque and loss; NaN where the
    plate undoes the equilibrium.  Plates are infinite slabs but for those called real.
    """
    case = Case(**point)
    scene, table, rates, start = _without_plate()
    row = _row(replace(scene, plate=case.plate(start.position)), case, table, rates, start)
    without = np.array([mode.growth_per_s for mode in start.modes])
    return xr.Dataset(
        {
            **{n: variable(("case", *dims), np.array([row[n]]), *UNITS[n]) for n, dims in COLUMNS.items()},
            "sweep": (("case",), [case.sweep]),
            "value": variable(("case",), [case.value], "SI", "distance, conductivity or thickness"),
            "growth_without": variable(("mode",), without, "1/s", "growth rate without a plate"),
        },
        {"mode": list(MODES), "axis": list(AXIS)},
        {"weight_N": scene.floater.mass * 9.81, "frequency_hz": scene.frequency, "plate_rtol": RTOL},
    )


def gather_damping(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """The plates one after the other."""
    return xr.concat(parts, "case", data_vars="minimal", coords="minimal", compat="override", join="exact")


@cache
def _without_plate() -> tuple[Scene, RotorTable, Rates, Equilibrium]:
    """The scene, its rotor's field and its stable equilibrium, once for all points that a process computes."""
    scene = replace(load_scene(shipped_scene("tilt-over-plate")), plate=None)
    table, _ = cached_rotor_table(scene.rotor, "fem", 1e-5, note, scene.floater.radius)
    rates = Rates.of(scene, table)
    start = starting_point(survey(scene, table, rates=rates).equilibria)
    if start is None:
        raise InputError("Input scene must have a stable equilibrium without a plate; instead it has none.")
    return scene, table, rates, start


COLUMNS: dict[str, tuple[str, ...]] = {
    "growth": ("mode",),
    "frequency": ("mode",),
    "shift": ("axis",),
    "force": ("axis",),
    "torque": ("axis",),
    "loss": (),
    "error": (),
}
UNITS = {
    "growth": ("1/s", "growth rate of a small motion"),
    "frequency": ("Hz", "frequency of a small motion, rotor's frame"),
    "shift": ("m", "displacement of the equilibrium by the plate"),
    "force": ("N", "mean force of the plate on the floater"),
    "torque": ("N m", "mean torque of the plate on the floater"),
    "loss": ("W", "heat in the plate, by floater and rotor"),
    "error": ("1", "estimated relative error of the plate's table"),
}


def _row(scene: Scene, case: Case, table: RotorTable, rates: Rates, start: Equilibrium) -> dict[str, Array]:
    assert scene.plate is not None
    memory, _ = plate_memory(scene, scene.plate, case.model, table, start.position, RTOL)
    found = with_plate(scene, table, Survey((start,), ()), memory, rates).equilibria
    if not found or found[0].currents is None:
        sizes = {"mode": 5, "axis": 3}
        return {name: np.full([sizes[d] for d in dims], np.nan) for name, dims in COLUMNS.items()}
    action = plate_action(scene, memory, found[0])
    return {
        "growth": np.array([mode.growth_per_s for mode in found[0].modes]),
        "frequency": np.array([mode.frequency_hz for mode in found[0].modes]),
        "shift": found[0].position - start.position,
        "force": action.force,
        "torque": action.torque,
        "loss": np.array(action.loss),
        "error": np.array(max(memory.table.errors.total, memory.share.error)),
    }
