"""The result of a scene: its numbers once, as labelled data for files, as a mapping for JSON and in words."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.continuation.frequencies import nearest_range
from ..dynamics.equilibria.equilibrium import LIBRATION, SIDE, TILT, Equilibrium, ForceCurve, LeftOut, Survey
from ..dynamics.flights.trajectory import Trajectory
from ..dynamics.motion.plate import PlateMemory
from ..dynamics.motion.state import State, polar_angle
from ..fem.cache import write_checked
from ..fem.rotor.table import FieldTable
from ..geometry.common import Array, millimetres
from . import words
from .effects import PLATE_NEGLECTED, ListedEffect, effects_summary, listed_effects, would_end
from .levitation import Levitation

AXIS = ("x", "y", "z")
MODES = ("bounce", *SIDE, *TILT)
# Labels of the dimensions of an equilibrium.
SIZES: Mapping[str, tuple[str, ...]] = {"axis": AXIS, "extreme": ("smallest", "largest"), "mode": MODES}
# Of an equilibrium: name in labelled data, SI unit, label, dimensions.
QUANTITIES: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("position", "m", "mean position, rotor's frame", ("axis",)),
    ("laboratory_position", "m", "mean position over a turn, laboratory frame", ("axis",)),
    ("position_error", "m", "its estimated error", ()),
    ("distance", "m", "distance from the rotor's origin, mean over a turn", ()),
    ("distance_swing", "m", "smallest and largest distance in a turn", ("extreme",)),
    ("lateral_offset", "m", "distance from the axis of rotation, mean over a turn", ()),
    ("lateral_offset_swing", "m", "smallest and largest lateral offset in a turn", ("extreme",)),
    ("moment", "1", "mean direction of the moment, rotor's frame", ("axis",)),
    ("polar_angle", "deg", "polar angle of the moment, mean over a turn", ()),
    ("polar_angle_swing", "deg", "smallest and largest polar angle in a turn", ("extreme",)),
    ("lag", "deg", "lag behind the rotor of the moment's turning part", ()),
    ("spin", "1", "body spin S = Ω·m̂/ω", ()),
    ("spin_rate", "rad/s", "angular velocity about the moment", ()),
    ("stable", "1", "whether no mode grows", ()),
    ("growth", "1/s", "growth rate of the least stable mode", ()),
    ("growth_error", "1/s", "its round-off error", ()),
)
# How a name ends there, for its unit, and what the number is divided by.
IN_JSON = {"m": ("_mm", 1e-3), "deg": ("_deg", 1.0), "1/s": ("_per_s", 1.0), "1": ("", 1.0)}
OF_A_STATE = (
    ("position", "m", "position"),
    ("velocity", "m/s", "velocity"),
    ("moment", "1", "direction of the moment"),
    ("spin", "rad/s", "angular velocity"),
)
PLACES = 500  # of a trajectory, at which the field's error is looked at
ENDED = ("beyond_plate_table", "left_plate_table", "levitated_s", "ended_by")
Columns = Mapping[str, tuple[tuple[str, ...], str, str]]  # dimensions, unit and a name for an axis label, by name
Found = Mapping[str, Any] | Sequence[Any]  # quantities by name, or in the order of a table of columns
DRIVE: Columns = {
    "rotor_frequency": (("time",), "Hz", "frequency of the rotor"),
    "motor_torque": (("time",), "N m", "torque of the motor, mean since the sample before"),
    "motor_power": (("time",), "W", "power of the motor, mean since the sample before"),
    "motor_momentum": (("time",), "N m s", "angular momentum that the motor has given"),
    "motor_work": (("time",), "J", "work that the motor has done"),
    "quasi_static_frequency": (("branch_point",), "Hz", "frequency of an equilibrium without the plate"),
    "quasi_static_distance": (("branch_point",), "m", "its levitation distance"),
    "quasi_static_growth": (("branch_point",), "1/s", "growth rate of its least stable mode"),
}  # Of a trajectory with a drive
LIBRARIES = ("spinlev", "ngsolve", "heyoka", "numpy", "scipy", "xarray")


@dataclass(frozen=True, eq=False)
class Result:
    """Equilibria, a trajectory, or both, of a scene by the models of its `Levitation`."""

    levitation: Levitation
    survey: Survey | None = None  # what was asked for
    flight: Trajectory | None = None
    # Levitation distances by the point dipole and the field of the finite magnets, see `run`
    comparison: Mapping[str, Any] | None = None
    failed: str = ""  # why there are no equilibria, if so

    def dataset(self) -> xr.Dataset:
        """The trajectory, or else the equilibria, over `time` or `equilibrium`, SI units; the models are attributes."""
        levitation, scene = self.levitation, self.levitation.scene
        if self.flight is not None:
            found = trajectory_dataset(self.flight, levitation.flight_plate)
            if scene.plate and (down := scene.plate.lowering):
                end = down.start + down.distance / down.speed
                found = found.assign_attrs(lowered_from_s=down.start, lowered_until_s=end)
            if self.flight.given is not None:
                points = [*levitation.beyond_fold[::-1], *levitation.branch]
                branch = [[p.parameter, -p.position[2], p.growth_per_s] for p in points]
                motor = self.flight.motor.T, self.flight.given.T, np.reshape(branch, (-1, 3)).T
                frequency = self.flight.rate / (2 * np.pi)
                found = found.assign(columns(DRIVE, [frequency, *(row for rows in motor for row in rows)]))
        else:
            survey = self.survey or levitation.survey
            found = found_dataset(survey.equilibria)
            found = found.assign_attrs(study="equilibria", left_out=left_out_text(survey.left_out))
        return found.assign_attrs(levitation.about)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """For JSON; `error_estimate` is the field's largest relative error where the floater is or was."""
        levitation, values = self.levitation, dict[str, Any]()
        if self.survey is not None:
            found, table = self.survey.equilibria, levitation.table
            places = np.array([e.start.position for e in found]).reshape(-1, 3)
            values = {
                "model": table.model,
                "body_spin": levitation.spin,
                "error_estimate": float(table.relative_error(places)[0].max()) if found else None,
                **_plate(levitation.plate),
                "equilibria": [equilibrium_summary(equilibrium) for equilibrium in found],
                "left_out": [
                    {
                        "position_mm": one.known.position / 1e-3,
                        "laboratory_position_mm": one.known.laboratory_position / 1e-3,
                        "with_plate": one.known.currents is not None,
                        "why": one.why,
                        "followed_to": one.part,
                    }
                    for one in self.survey.left_out
                ],
            }
        if (flight := self.flight) is not None:
            table = levitation.flight_table
            places = flight.rotor.position[:: max(1, len(flight.time) // PLACES)]
            values |= {
                "model": table.model,
                "error_estimate": float(table.relative_error(places[table.in_range(places)])[0].max()),
                **_plate(levitation.flight_plate),
                **{name: getattr(flight, name) for name in ENDED},
                "kind": words.kind_of_flight(levitation, flight),
                "energy_error": flight.energy_error,
                "field_changes": vars(flight.field_changes),
                "realtime_factor": flight.realtime_factor,
            }
            if flight.given is not None:
                momentum, work = flight.given[-1].tolist()
                stable = nearest_range(levitation.branch, levitation.scene.frequency)
                values |= {
                    "lost_at_hz": flight.lost_at_hz,
                    "ended_at_hz": float(flight.rate[-1]) / (2 * np.pi),
                    "motor_torque_N_m": momentum / flight.levitated_s if flight.levitated_s else None,
                    "motor_power_W": work / flight.levitated_s if flight.levitated_s else None,
                    "motor_momentum_N_m_s": momentum,
                    "motor_work_J": work,
                    "quasi_static_range_hz": stable and [stable.low.parameter, stable.high.parameter],
                    "quasi_static_ends": stable and [stable.low.kind, stable.high.kind],
                }
        return {**values, **effects_summary(levitation, self._effects)}

    @cached_property
    def _effects(self) -> list[ListedEffect]:
        # A trajectory that begins where the scene says needs no equilibrium, and searches for none.
        alone = self.flight is not None and self.levitation.absolute
        found = () if alone else (self.survey or self.levitation.quiet.survey).equilibria
        return listed_effects(self.levitation, found)

    def text(self) -> list[str]:
        levitation, lines = self.levitation, [self.failed] if self.failed else []
        if self.survey is not None and not self.failed:
            lines += words.equilibria_words(levitation, self.survey)
        lines += words.comparison_words(self.comparison, levitation.scene.plate is not None)
        if self.flight is not None:
            lines += [words.flight_words(levitation, self.flight), *words.drive_words(levitation, self.flight)]
        if self.flight is not None or not self.failed:
            lines += words.plate_words(levitation)
        lines += [PLATE_NEGLECTED] if PLATE_NEGLECTED in self.summary["not_modelled"] else []
        first = next(iter(self.survey.equilibria), None) if self.survey is not None else None
        listed = [f"  {effect}" for effect in self._effects]
        return [*lines, "Effects beyond the rigid dipole:", *listed, *would_end(first, self._effects)]


def equilibrium_summary(equilibrium: Equilibrium) -> dict[str, Any]:
    """The numbers of an equilibrium by their names in JSON, which end in their units, with its kind and stability."""
    numbers = {}
    for name, unit, _, _ in QUANTITIES:
        if unit in IN_JSON and name != "moment":
            end, scale = IN_JSON[unit]
            value = _read(equilibrium, name, unit)
            numbers[name + end] = value if scale == 1 else value / scale
    return {
        **numbers,
        **({"kind": equilibrium.kind} if equilibrium.kind else {}),
        **({"body_axes": equilibrium.state.axes} if equilibrium.state.axes is not None else {}),
        "stability": equilibrium.stability,
        "efolding_s": equilibrium.efolding_s,
        "spin_about_moment_hz": equilibrium.spin_rate / (2 * np.pi),
        "frequencies_hz": equilibrium.frequencies_hz,
        "modes": [vars(mode) for mode in equilibrium.modes],
        "with_plate": equilibrium.currents is not None,
        "without_plate": None if equilibrium.without is None else equilibrium_summary(equilibrium.without),
    }


def _read(equilibrium: Equilibrium, name: str, unit: str) -> Any:
    if name == "moment":
        return equilibrium.state.moment
    return getattr(equilibrium, name + {"deg": "_deg", "1/s": "_per_s"}.get(unit, ""))


def left_out_text(left_out: Sequence[LeftOut]) -> str:
    return "; ".join(f"{one.why}: {millimetres(one.known.position)}" for one in left_out)


def _plate(memory: PlateMemory | None) -> dict[str, Any]:
    if memory is None:
        return {"plate_model": "none"}
    return {"plate_model": memory.model, "plate_error_estimate": memory.error, "plate_states": len(memory.table.rates)}


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset with its provenance, command and versions; that of a scene has the scene's text already.

    The same command gives the same file, to the last byte, wherever its numbers are not times.
    """
    versions = {f"version_{name}": version(name) for name in LIBRARIES}
    write_checked(dataset.assign_attrs(command=shlex.join(["spinlev", *sys.argv[1:]]), **versions), path)


def variable(dims: Sequence[str], values: Any, units: str, long_name: str) -> xr.Variable:
    """A variable of `values` over `dims` with its `units` and a `long_name` for an axis label."""
    return xr.Variable(dims, values, {"units": units, "long_name": long_name})


# How a key of the scene file ends, for its unit
ENDS = {"kg_m3": "kg/m³", "S_m": "S/m", "kA_m": "kA/m", "mm_s": "mm/s", "m_s2": "m/s²", "N_s_m": "N s/m"}
ENDS |= {"N_m_s": "N m s", "hz": "Hz", "mm": "mm", "deg": "deg", "T": "T", "A": "A", "s": "s"}


def label_of_key(key: str) -> dict[str, str]:
    """Unit and name for an axis label of a scene file's key.

    >>> label_of_key("rotor.magnets.1.center_mm.2")
    {'units': 'mm', 'long_name': 'rotor magnets 1 center 2'}
    """
    stem, _, number = key.rpartition(".") if key.rpartition(".")[2].isdecimal() else (key, "", "")
    end = next((end for end in ENDS if stem.endswith(f"_{end}")), "")
    name = " ".join([*stem.removesuffix(f"_{end}").replace(".", " ").replace("_", " ").split(), number]).strip()
    return {"units": ENDS.get(end, "1"), "long_name": name}


def columns(table: Columns, found: Found, **sizes: int) -> dict[str, xr.Variable]:
    """Variables by name as a `table` of columns has them: dimensions, unit and label of each quantity.

    `found` are the quantities by name, or all of them in the table's order; `sizes` are of the dimensions of what was
    not found, which is NaN.
    """
    known = found if isinstance(found, Mapping) else dict(zip(table, found, strict=True))
    return {
        # an array, as xarray takes a tuple for one value
        name: variable(dims, np.asarray(known.get(name, np.full([sizes.get(d, 0) for d in dims], np.nan))), unit, label)
        for name, (dims, unit, label) in table.items()
    }


def records(dataset: xr.Dataset, keys: Mapping[str, str]) -> list[dict[str, Any]]:
    """For JSON: what variables over one and the same dimension hold at each place, by `keys`; None for NaN."""
    found = zip(*(dataset[name].values.tolist() for name in keys.values()), strict=True)
    return [{key: None if each != each else each for key, each in zip(keys, row, strict=True)} for row in found]


def axis_dataset(tables: Mapping[str, FieldTable], heights: Array) -> xr.Dataset:
    """Field of each model on the axis below the rotor, with its estimated relative error; heights (n,) m < 0."""
    points = np.column_stack([np.zeros((len(heights), 2)), heights])
    found = np.full((len(tables), len(heights), 4), np.nan)  # field and error
    for row, table in zip(found, tables.values(), strict=True):
        known = table.in_range(points)
        row[known] = np.column_stack([table.evaluate(points[known])[0], table.relative_error(points[known])[0]])
    field = variable(("model", "axis_height", "axis"), found[..., :3], "T", "flux density on the axis")
    error = variable(("model", "axis_height"), found[..., 3], "1", "estimated relative error of the field")
    height = variable(("axis_height",), heights, "m", "height on the axis")
    axes = {"model": list(tables), "axis": list(AXIS), "axis_height": height}
    return xr.Dataset({"axis_field": field, "axis_error": error}, axes)


def curve_dataset(curves: Mapping[str, Sequence[ForceCurve]]) -> xr.Dataset:
    """Axial force along the curves of lateral balance, by model."""
    rows = [(model, number, curve) for model, found in curves.items() for number, curve in enumerate(found)]
    sizes, point, place = [len(curve.position) for *_, curve in rows], ("curve_point",), ("curve_point", "axis")
    data: dict[str, Any] = {
        "curve_model": (point, np.repeat([model for model, *_ in rows] or [""], sizes or [0])),
        "curve_number": (point, np.repeat([number for _, number, _ in rows] or [0], sizes or [0])),
    }
    for name, of, dims, unit, label in (
        ("position", "position", place, "m", "position, rotor's frame"),
        ("moment", "moment", place, "1", "direction of the moment"),
        ("force", "magnetic_force", point, "N", "axial magnetic force"),
    ):
        none = np.zeros((0, 3) if dims is place else 0)
        values = np.concatenate([none, *(getattr(curve, of) for *_, curve in rows)])
        data[f"curve_{name}"] = variable(dims, values, unit, label)
    return xr.Dataset(data, {"axis": list(AXIS)})


def equilibria_dataset(found: Mapping[str, Sequence[Equilibrium]]) -> xr.Dataset:
    """Equilibria of all models in one list; names begin with `equilibrium_`."""
    every = [(model, equilibrium) for model, equilibria in found.items() for equilibrium in equilibria]
    rows = found_dataset([equilibrium for _, equilibrium in every]).drop_vars(["number", "equilibrium"])
    acting = np.array([e.currents is not None for _, e in every], bool)
    return rows.rename({name: f"equilibrium_{name}" for name in rows.data_vars}).assign(
        equilibrium_model=(("equilibrium",), np.array([model for model, _ in every], dtype=object).astype(str)),
        equilibrium_with_plate=variable(("equilibrium",), acting, "1", "whether the plate's currents act"),
    )


def found_dataset(rows: Sequence[Equilibrium]) -> xr.Dataset:
    """Equilibria of one scene and one model over `equilibrium`, with their modes over `mode`."""
    data, count = {}, len(rows)
    for name, unit, label, dims in QUANTITIES:
        values = np.array([_read(e, name, unit) for e in rows], bool if name == "stable" else float)
        shape = (count, *(len(SIZES[dim]) for dim in dims))
        data[name] = variable(("equilibrium", *dims), values.reshape(shape), unit, label)
    for name, label in (("stability", "stable, marginal or unstable"), ("kind", "kind")):
        texts = np.array([getattr(e, name) for e in rows], dtype=str)
        if name == "stability" or any(texts):
            data[name] = xr.Variable(("equilibrium",), texts, {"long_name": label})
    growing = np.array([e.efolding_s or np.nan for e in rows], float)
    data["efolding"] = variable(("equilibrium",), growing, "s", "e-folding time of the least stable mode, if it grows")
    modes = [{mode.name: (mode.growth_per_s, mode.frequency_hz) for mode in e.modes} for e in rows]
    names = (*MODES, LIBRATION) if any(LIBRATION in each for each in modes) else MODES
    known = np.array([[each.get(name, (np.nan, np.nan)) for name in names] for each in modes], float)
    growth, frequency = np.moveaxis(known.reshape(count, len(names), 2), -1, 0)
    data["mode_growth"] = variable(("equilibrium", "mode"), growth, "1/s", "growth rate of a mode")
    data["mode_frequency"] = variable(("equilibrium", "mode"), frequency, "Hz", "its frequency")
    data["number"] = variable((), count, "1", "number of equilibria")
    sizes = {dim: list(labels) for dim, labels in SIZES.items()}
    return xr.Dataset(data, {"equilibrium": np.arange(count), **sizes, "mode": list(names)})


def state_columns(state: State, over: str, when: str = "", prefix: str = "") -> dict[str, xr.Variable]:
    """A `state` (n, 3) along the laboratory's axes `over` a dimension; `when` ends labels, `prefix` begins names."""
    found, said = {}, f", laboratory frame{when}"
    for (name, unit, label), values in zip(OF_A_STATE, state.vectors, strict=True):
        found[f"{prefix}{name}"] = variable((over, "axis"), values, unit, label + said)
    if state.axes is not None:
        label = f"axes of the body as columns, laboratory frame{when}"
        found[f"{prefix}body_axes"] = variable((over, "axis", "body_axis"), state.axes, "1", label)
    return found


def trajectory_dataset(flight: Trajectory, memory: PlateMemory | None = None) -> xr.Dataset:
    """A trajectory in the laboratory and the rotor's frame, and how well the plate's currents are known."""
    lab, rotor, dims = flight.lab, flight.rotor, ("time", "axis")
    far, tilt = np.linalg.norm(rotor.position, axis=1), np.degrees(polar_angle(lab.moment))
    data = {
        **state_columns(lab, "time"),
        "position_rotor_frame": variable(dims, rotor.position, "m", "position, rotor's frame"),
        "distance": variable(("time",), far, "m", "distance from the rotor's origin"),
        "polar_angle": variable(("time",), tilt, "deg", "polar angle of the moment"),
    }
    if flight.pose is not None:
        center, axes = flight.pose
        data["rotor_center"] = variable(dims, center, "m", "origin of the rotor, laboratory frame")
        data["rotor_axis"] = variable(dims, axes[:, :, 2], "1", "axis of the rotor, laboratory frame")
    said: dict[str, Any] = {"study": "simulate", "ended_by": str(flight.ended_by)}
    said |= {"levitated_s": flight.levitated_s, "energy_error": flight.energy_error}
    if memory is not None:
        said |= {"plate_error_estimate": memory.error, "beyond_plate_table": flight.beyond_plate_table}
        said["left_plate_table"] = int(flight.left_plate_table)
    return xr.Dataset(data, {"time": variable(("time",), flight.time, "s", "time"), "axis": list(AXIS)}, said)
