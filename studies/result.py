"""What is told of an equilibrium: listed once, for labelled data and for JSON."""

import math
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.equilibria.equilibrium import Equilibrium, ForceCurve
from ..dynamics.equilibria.modes import SIDE, TILT
from ..dynamics.flights.trajectory import Trajectory
from ..dynamics.motion.plate import PlateMemory
from ..fem.cache import write_checked
from ..fem.rotor.table import FieldTable
from ..geometry.common import Array
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import scene_text


@dataclass(frozen=True)
class Field:
    """One quantity of an equilibrium.

    Parameters
    ----------
    name, unit, label : in labelled data, SI units
    read : takes the equilibrium
    dims : beside `equilibrium`; over "extreme" the smallest value in a turn, then the largest
    key, scale : its name in JSON, and the unit there in units of `unit`; None where JSON does not tell it
    kind : float or bool
    """

    name: str
    unit: str
    label: str
    read: Callable[[Equilibrium], Any]
    dims: tuple[str, ...] = ()
    key: str | None = None
    scale: float = 1.0
    kind: type = float

    def shown(self, equilibrium: Equilibrium) -> Any:
        """The value in the unit of JSON."""
        value = self.read(equilibrium)
        return value if self.scale == 1 else value / self.scale


MILLI = 1e-3
SWING = ("extreme",)
EQUILIBRIUM_FIELDS = (
    Field("position", "m", "mean position, rotor's frame", lambda e: e.position, ("axis",), "position_mm", MILLI),
    Field(
        "laboratory_position", "m", "mean position over a turn, laboratory frame", lambda e: e.laboratory_position,
        ("axis",), "laboratory_position_mm", MILLI,
    ),
    Field("position_error", "m", "its estimated error", lambda e: e.position_error, (), "position_error_mm", MILLI),
    Field(
        "distance", "m", "distance from the rotor's origin, mean over a turn", lambda e: e.distance,
        (), "distance_mm", MILLI,
    ),
    Field(
        "distance_swing", "m", "smallest and largest distance in a turn", lambda e: e.distance_swing,
        SWING, "distance_swing_mm", MILLI,
    ),
    Field(
        "lateral_offset", "m", "distance from the axis of rotation, mean over a turn", lambda e: e.lateral_offset,
        (), "lateral_offset_mm", MILLI,
    ),
    Field(
        "lateral_offset_swing", "m", "smallest and largest lateral offset in a turn", lambda e: e.lateral_offset_swing,
        SWING, "lateral_offset_swing_mm", MILLI,
    ),
    Field("moment", "1", "mean direction of the moment, rotor's frame", lambda e: e.state.moment, ("axis",)),
    Field(
        "polar_angle", "deg", "polar angle of the moment, mean over a turn", lambda e: e.polar_angle_deg,
        (), "polar_angle_deg",
    ),
    Field(
        "polar_angle_swing", "deg", "smallest and largest polar angle in a turn", lambda e: e.polar_angle_swing_deg,
        SWING, "polar_angle_swing_deg",
    ),
    Field("lag", "deg", "lag behind the rotor of the moment's turning part", lambda e: e.lag_deg, (), "lag_deg"),
    Field("spin", "1", "body spin S = Ω·m̂/ω", lambda e: e.spin, (), "spin"),
    Field(
        "spin_rate", "rad/s", "angular velocity about the moment", lambda e: e.spin_rate,
        (), "spin_about_moment_hz", 2 * math.pi,
    ),
    Field("stable", "1", "whether every small motion stays small", lambda e: e.stable, (), "stable", kind=bool),
    Field("growth", "1/s", "largest growth rate of a small motion", lambda e: e.growth_per_s, (), "growth_per_s"),
    Field("growth_error", "1/s", "its round-off error", lambda e: e.growth_error_per_s, (), "growth_error_per_s"),
)  # fmt: skip


AXIS = ("x", "y", "z")
EXTREMES = ("smallest", "largest")
MODES = ("bounce", *SIDE, *TILT)
Columns = Mapping[str, tuple[tuple[str, ...], str, str]]
"""Dimensions, unit and a name for an axis label, by name."""
LIBRARIES = ("spinlev", "ngsolve", "heyoka", "numpy", "scipy", "xarray")


def write_dataset(dataset: xr.Dataset, path: Path, scene: Scene | None = None) -> None:
    """Write a result with its provenance: versions, command, and the scene's text if it has one.

    The same command gives the same file, to the last byte, wherever its numbers are not times.
    """
    provenance = {f"version_{name}": version(name) for name in LIBRARIES}
    if scene:
        provenance["scene"] = scene_text(scene)
    command = shlex.join(["spinlev", *sys.argv[1:]])
    write_checked(dataset.assign_attrs(command=command, **provenance), path)


def variable(dims: Sequence[str], values: Any, units: str, long_name: str) -> xr.Variable:
    """A variable with its units and a name for an axis label."""
    return xr.Variable(dims, values, {"units": units, "long_name": long_name})


def columns(table: Columns, found: Mapping[str, Any], **sizes: int) -> dict[str, xr.Variable]:
    """Variables by name as a table of columns has them; NaN, in these sizes, where nothing was found."""

    def values(name: str, dims: tuple[str, ...]) -> Any:
        return found[name] if name in found else np.full([sizes[dim] for dim in dims], np.nan)

    return {name: variable(dims, values(name, dims), unit, label) for name, (dims, unit, label) in table.items()}


def axis_dataset(tables: Mapping[str, FieldTable], heights: Array) -> xr.Dataset:
    """Field of each model on the axis below the rotor, with its estimated relative error; heights (n,) m < 0."""
    points = np.stack([np.zeros_like(heights), np.zeros_like(heights), heights], axis=1)
    fields = np.full((len(tables), len(heights), 3), np.nan)
    errors = np.full((len(tables), len(heights)), np.nan)
    for k, table in enumerate(tables.values()):
        known = table.in_range(points)
        fields[k, known] = table.evaluate(points[known])[0]
        errors[k, known] = table.relative_error(points[known])[0]
    return xr.Dataset(
        {
            "axis_field": variable(("model", "axis_height", "axis"), fields, "T", "flux density on the axis"),
            "axis_error": variable(("model", "axis_height"), errors, "1", "estimated relative error of the field"),
        },
        coords={
            "model": list(tables),
            "axis": list(AXIS),
            "axis_height": variable(("axis_height",), heights, "m", "height on the axis"),
        },
    )


def curve_dataset(curves: Mapping[str, Sequence[ForceCurve]]) -> xr.Dataset:
    """Axial force along the curves of lateral balance, by model."""
    rows = [(model, number, curve) for model, found in curves.items() for number, curve in enumerate(found)]
    sizes = [len(curve.magnetic_force) for _, _, curve in rows]

    def joined(values: list[Array], *shape: int) -> Array:
        return np.concatenate([np.zeros((0, *shape)), *values])

    return xr.Dataset(
        {
            "curve_model": (("curve_point",), np.repeat([m for m, _, _ in rows] or [""], sizes or [0])),
            "curve_number": (("curve_point",), np.repeat([n for _, n, _ in rows] or [0], sizes or [0])),
            "curve_position": variable(
                ("curve_point", "axis"), joined([c.position for _, _, c in rows], 3), "m", "position, rotor's frame"
            ),
            "curve_moment": variable(
                ("curve_point", "axis"), joined([c.moment for _, _, c in rows], 3), "1", "direction of the moment"
            ),
            "curve_force": variable(
                ("curve_point",), joined([c.magnetic_force for _, _, c in rows]), "N", "axial magnetic force"
            ),
        },
        coords={"axis": list(AXIS)},
    )


def equilibria_dataset(found: Mapping[str, Sequence[Equilibrium]]) -> xr.Dataset:
    """Equilibria of all models in one list; names begin with `equilibrium_`."""
    models = [model for model, equilibria in found.items() for _ in equilibria]
    rows = found_dataset([equilibrium for equilibria in found.values() for equilibrium in equilibria])
    rows = rows.drop_vars(["number", "equilibrium"])
    named = rows.rename({name: f"equilibrium_{name}" for name in rows.data_vars})
    felt = [e.currents is not None for equilibria in found.values() for e in equilibria]
    return named.assign(
        equilibrium_model=(("equilibrium",), np.array(models, dtype=object).astype(str)),
        equilibrium_with_plate=variable(
            ("equilibrium",), np.array(felt, bool), "1", "whether the plate's currents act"
        ),
    )


def found_dataset(rows: Sequence[Equilibrium]) -> xr.Dataset:
    """Equilibria of one scene and one model over `equilibrium`, with their small motions over `mode`."""
    sizes = {"axis": 3, "mode": len(MODES), "extreme": len(EXTREMES)}

    def column(field: Field) -> xr.Variable:
        shape = (len(rows), *(sizes[dim] for dim in field.dims))
        values: Any = np.array([field.read(e) for e in rows], field.kind).reshape(shape)
        return variable(("equilibrium", *field.dims), values, field.unit, field.label)

    def by_name(equilibrium: Equilibrium, quantity: str) -> list[float]:
        known = {mode.name: float(getattr(mode, quantity)) for mode in equilibrium.modes}
        return [known.get(name, np.nan) for name in MODES]

    return xr.Dataset(
        {
            **{field.name: column(field) for field in EQUILIBRIUM_FIELDS},
            "mode_growth": column(
                Field("mode_growth", "1/s", "growth of a mode", lambda e: by_name(e, "growth_per_s"), ("mode",))
            ),
            "mode_frequency": column(
                Field("mode_frequency", "Hz", "its frequency", lambda e: by_name(e, "frequency_hz"), ("mode",))
            ),
            "number": variable((), len(rows), "1", "number of equilibria"),
        },
        {"axis": list(AXIS), "equilibrium": np.arange(len(rows)), "mode": list(MODES), "extreme": list(EXTREMES)},
    )


def trajectory_dataset(flight: Trajectory, memory: PlateMemory | None = None) -> xr.Dataset:
    """A flight in the laboratory frame, with its position in the rotor's frame as well.

    Of the plate's currents, if there are some, the attributes say how well they are known, and whether the flight ended
    where that ends.
    """
    plate = (
        {}
        if memory is None
        else {
            "plate_error_estimate": memory.error,
            "beyond_plate_table": flight.beyond_plate_table,
            "left_plate_table": int(flight.left_plate_table),
        }
    )
    lab, rotor = flight.lab, flight.rotor
    dims = ("time", "axis")
    far = np.linalg.norm(lab.position, axis=1)
    tilt = np.degrees(np.arctan2(np.hypot(lab.moment[:, 0], lab.moment[:, 1]), lab.moment[:, 2]))
    return xr.Dataset(
        {
            "position": variable(dims, lab.position, "m", "position, laboratory frame"),
            "velocity": variable(dims, lab.velocity, "m/s", "velocity, laboratory frame"),
            "moment": variable(dims, lab.moment, "1", "direction of the moment, laboratory frame"),
            "spin": variable(dims, lab.spin, "rad/s", "angular velocity, laboratory frame"),
            "position_rotor_frame": variable(dims, rotor.position, "m", "position, rotor's frame"),
            "distance": variable(("time",), far, "m", "distance from the rotor's origin"),
            "polar_angle": variable(("time",), tilt, "deg", "polar angle of the moment"),
        },
        coords={"time": variable(("time",), flight.time, "s", "time"), "axis": list(AXIS)},
        attrs={
            "study": "simulate",
            "ended_by": str(flight.ended_by),
            "levitated_s": flight.levitated_s,
            "energy_error": flight.energy_error,
            **plate,
        },
    )


def lowering_times(scene: Scene) -> dict[str, float]:
    """When the scene's plate is lowered, s; nothing where it is not."""
    down = scene.plate.lowering if scene.plate else None
    return (
        {}
        if down is None
        else {"lowered_from_s": down.start, "lowered_until_s": down.start + down.distance / down.speed}
    )
