"""The scene in SI units: plate, drag, start, and the whole."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..common import Array, freeze, frozen_array, html_table, listed, millimetres
from ..magnets import Conductor, Magnet
from ..shapes import Box, Cylinder
from ..solids import Compound, Part, Solid, Solids
from .floater import Floater

AIR_VISCOSITY = 1.83e-5  # Dynamic viscosity of air at 20-25 °C, Pa s


@dataclass(frozen=True)
class Lowering:
    """The plate's motion: from `start` (s) downwards with `speed` (m/s) over `distance` (m)."""

    start: float
    speed: float
    distance: float

    def depth(self, time: ArrayLike) -> Array:
        return np.clip((np.asarray(time) - self.start) * self.speed, 0.0, self.distance)


@dataclass(frozen=True, eq=False)
class Plate:
    """A conducting plate, fixed in the laboratory but for its lowering, or several that are apart from each other.

    Its thin side, faces and middle are those of the box about its body, whose middle planes are to mirror it; of
    several those of the first, in whose frame all are.
    """

    body: Solids
    conductivity: float  # S/m, of several the largest
    lowering: Lowering | None = None
    each: tuple[float, ...] = ()  # of several the conductivity of each, S/m

    @classmethod
    def of(cls, plates: "Sequence[Plate]") -> "Plate":
        """One or several as one; they are lowered as the first is."""
        if len(plates) == 1:
            return plates[0]
        each = tuple(plate.conductivity for plate in plates)
        bodies = [body for plate in plates for body in plate.body.placed]
        return cls(Compound.of(bodies), max(each), plates[0].lowering, each)

    @property
    def metal(self) -> float | tuple[float, ...]:
        """Conductivity, S/m; of several that of each."""
        return self.each or self.conductivity

    @property
    def box(self) -> Box:
        return self.body.box

    def depth(self, time: ArrayLike) -> Array:
        """Distance (n,) m by which it is lowered at each `time` (n,) s."""
        return self.lowering.depth(time) if self.lowering else np.zeros(np.shape(time))

    @property
    def way(self) -> float:
        """Distance by which it is lowered, m; 0 if it is not."""
        return self.lowering.distance if self.lowering else 0.0

    def __repr__(self) -> str:
        text = "Plate " + " and ".join(
            f"{body.described_size} at {millimetres(body.center)}, {metal:.3g} S/m"
            for body, metal in zip(self.body.placed, self.each or [self.conductivity], strict=True)
        )
        if (down := self.lowering) is None:
            return text
        return f"{text}, lowered by {down.distance * 1e3:g} mm at {down.speed * 1e3:g} mm/s from {down.start:g} s on"


@dataclass(frozen=True, eq=False)
class Coil:
    """A round coil along z, its current steady, `current` sin(2π `frequency` t + `phase`), or a table of time."""

    center: Array  # (3,) m
    radius: float  # of the middle of the winding, m
    width: float  # of the winding across the axis, m
    height: float  # along it, m
    turns: float
    current: float | Array  # A: a number, or rows of time (s) and current, with straight lines between
    frequency: float = 0.0  # Hz
    phase: float = 0.0  # rad

    def __post_init__(self) -> None:
        freeze(self, center=(3,))

    @property
    def body(self) -> Cylinder:
        outer, inner = self.radius + self.width / 2, self.radius - self.width / 2
        return Cylinder(outer, self.height, self.center, inner_radius=inner)

    @property
    def steady(self) -> bool:
        return not isinstance(self.current, np.ndarray) and not self.frequency

    @property
    def axial(self) -> bool:
        """Whether its field stands still in the frame of a rotor: a steady current about the rotor's axis."""
        return self.steady and not self.center[:2].any()

    @property
    def corners(self) -> list[float]:
        """Times (s) at which the current has a corner."""
        return self.current[:, 0].tolist() if isinstance(self.current, np.ndarray) else []

    def amperes(self, time: ArrayLike) -> Array:
        """The current, A, at each `time`, s."""
        if isinstance(self.current, np.ndarray):
            return np.asarray(np.interp(np.asarray(time, float), *self.current.T))
        time = np.asarray(time, float)
        if not self.frequency:
            return np.full(time.shape, self.current)
        return np.asarray(self.current * np.sin(2 * np.pi * self.frequency * time + self.phase))

    def __repr__(self) -> str:
        size = f"Ø {2e3 * self.radius:.4g}, {1e3 * self.width:.4g} × {1e3 * self.height:.4g} mm"
        current = f"a table of {len(self.corners)} currents" if self.corners else f"{self.current:g} A"
        current += f" at {self.frequency:g} Hz" if self.frequency else ""
        return f"Coil {size} at {millimetres(self.center)}, {self.turns:g} turns of {current}"


@dataclass(frozen=True)
class Drag:
    """Viscous drag: force -linear v (N s/m) and torque -angular Ω (N m s); `air`: the more of a real sphere in air."""

    linear: float
    angular: float
    air: bool = False

    @classmethod
    def stokes(cls, radius: float) -> Self:
        """Stokes drag of a sphere in air: 6πηR and 8πηR³."""
        return cls(6 * np.pi * AIR_VISCOSITY * radius, 8 * np.pi * AIR_VISCOSITY * radius**3)

    @classmethod
    def of(cls, floater: Floater) -> Self:
        """Stokes drag of a floater: that of the sphere of its volume."""
        return cls.stokes(floater.equal_radius)


@dataclass(frozen=True)
class DriveStep:
    """A step of the rotor's drive: steadily to a `frequency` (Hz), or staying where None, in so many `seconds`.

    Meanwhile its origin moves steadily to a `center` (3,) m, and its axis turns the shortest way to an `axis` (3,),
    both of the laboratory; None: they stay.
    """

    frequency: float | None
    seconds: float
    center: tuple[float, ...] | None = None
    axis: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class Stretch:
    """The rotor's place in the laboratory from an instant on, as it moves and turns its axis steadily."""

    start: float  # s
    center: Array  # (3,) m of its origin then
    axes: Array  # (3, 3) whose columns are the axes of its frame then, had it no turn about its own
    velocity: Array  # (3,) m/s
    about: Array  # (3,) unit vector of the laboratory about which its axis turns
    rate: float  # rad/s

    def at(self, time: Array) -> tuple[Array, Array]:
        """Origin (n, 3) m and axes (n, 3, 3) at times (n,) s."""
        since = time - self.start
        turns = Rotation.from_rotvec(self.rate * since[:, None] * self.about).as_matrix()
        return self.center + since[:, None] * self.velocity, turns @ self.axes


@dataclass(frozen=True, eq=False)
class AbsoluteStart:
    """Initial state in the laboratory frame: position m, velocity m/s, moment direction, angular velocity rad/s."""

    position: Array
    velocity: Array
    moment: Array
    spin: Array
    body_x: Array | None = None  # direction near which x of the floater's keys lies; None: as `Floater.axes` has it


@dataclass(frozen=True, eq=False)
class OffsetStart:
    """Start from the stable equilibrium, displaced by `offset` (m) in the frame that turns with the rotor."""

    offset: Array = field(default_factory=lambda: frozen_array((0.0, 0.0, 1e-4), (3,)))


@dataclass(frozen=True, eq=False)
class Companion:
    """A further floater beside the first, with its drag and where it begins."""

    floater: Floater
    drag: Drag
    start: OffsetStart | AbsoluteStart


@dataclass(frozen=True)
class MapReading:
    """Reading of a map of the field where its file does not tell."""

    # length_unit, field_unit: of the coordinates and of B, whatever the file says; None: as it says
    length_unit: str | None = None
    field_unit: str | None = None
    # what the titles of the columns to take have and others have not, as of one of several solutions; or None
    columns: str | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a computation needs.

    Parameters
    ----------
    frequency : turns of the rotor per second about +z, Hz; of one with a drive at t = 0
    rotor : magnets in the rotor's frame, which is the laboratory's at t = 0
    floater : the floating magnet
    gravity : (3,) m/s², laboratory frame
    plate : conducting plate, or None
    drag : of the surrounding medium
    start : where a simulation begins
    field_map : file of a map of the rotor's B in its frame, or None
    map_reading : how the map is read
    text : the scene file as it was read, for the record
    conductors : metal beside the magnets that turns with the rotor
    files : path of each file that it names, with the SHA-256 of its content when the scene was read
    parts : the solids of the STEP files that its keys name, in canonical pose, also of those computed as another shape
    drive : what the rotor's frequency does in time, step by step; after the last it stays
    coils : whose field acts on the floater; without a rotor they drive currents in it
    companions : further floaters beside the first, to which floater, drag and start belong
    keys : the tables of a scene file that it was made of, and the scene that they made: what of that was not replaced
        since is as they say. None of a scene that was put together from its parts
    tolerances : by dotted key of the scene file, in its units: how far its number may be off, either way
    """

    frequency: float
    rotor: tuple[Magnet, ...]
    floater: Floater
    drag: Drag
    gravity: Array = field(default_factory=lambda: frozen_array((0.0, 0.0, -9.81), (3,)))
    plate: Plate | None = None
    start: OffsetStart | AbsoluteStart = field(default_factory=OffsetStart)
    field_map: Path | None = None
    map_reading: MapReading = MapReading()
    text: str = field(default="", compare=False)
    conductors: tuple[Conductor, ...] = ()
    files: tuple[tuple[str, str], ...] = field(default=(), compare=False)
    parts: tuple[Part, ...] = field(default=(), compare=False)
    drive: tuple[DriveStep, ...] = ()
    coils: tuple[Coil, ...] = ()
    companions: tuple[Companion, ...] = ()
    keys: "tuple[Mapping[str, Any], Scene] | None" = field(default=None, compare=False, repr=False)
    tolerances: tuple[tuple[str, float], ...] = field(default=(), compare=False)

    @property
    def angular_velocity(self) -> float:
        """ω = 2π frequency, rad/s; with a drive at t = 0."""
        return 2 * np.pi * self.frequency

    @property
    def each(self) -> "tuple[Scene, ...]":
        """The scene of each floater alone."""
        first = replace(self, companions=()) if self.companions else self
        return first, *(replace(first, floater=c.floater, drag=c.drag, start=c.start) for c in self.companions)

    @property
    def fastest(self) -> float:
        return max(abs(self.frequency), *(step.frequency or 0.0 for step in self.drive), 0.0)

    @cached_property
    def knots(self) -> Array:
        """(3, n) instants (s) between which the angular velocity changes steadily; it (rad/s) and the angle (rad)."""
        times, rates, angles = [0.0], [self.angular_velocity], [0.0]
        for step in self.drive:
            rate = rates[-1] if step.frequency is None else 2 * np.pi * step.frequency
            angles.append(angles[-1] + (rates[-1] + rate) / 2 * step.seconds)
            rates.append(rate)
            times.append(times[-1] + step.seconds)
        return np.array([times, rates, angles])

    def rate(self, time: ArrayLike) -> Array:
        """Angular velocity of the rotor at each `time` (s), rad/s."""
        return np.asarray(np.interp(np.asarray(time, float), *self.knots[:2]))

    def angle(self, time: ArrayLike) -> Array:
        """Angle (rad) of the rotor at each `time` (s): the integral of its angular velocity."""
        time = np.asarray(time, float)
        if not self.drive:
            return np.asarray(self.angular_velocity * time)
        times, rates, angles = self.knots
        last = np.searchsorted(times[1:], time, "right")
        return np.asarray(angles[last] + (rates[last] + self.rate(time)) / 2 * (time - times[last]))

    @property
    def moving(self) -> bool:
        return any(step.center or step.axis for step in self.drive)

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The rotor's way, a stretch for each step of the drive and one for all that follows."""
        found, time, center, axes = list[Stretch](), 0.0, np.zeros(3), np.eye(3)
        for step in (*self.drive, DriveStep(None, np.inf)):
            velocity = (np.array(step.center) - center) / step.seconds if step.center else np.zeros(3)
            about, rate = np.eye(3)[0], 0.0
            if step.axis:
                across = np.cross(axes[:, 2], step.axis)
                size = float(np.linalg.norm(across))
                about = across / size if size else about
                rate = float(np.arctan2(size, axes[:, 2] @ step.axis)) / step.seconds
            found.append(Stretch(time, center, axes, velocity, about, rate))
            if np.isfinite(step.seconds):
                time += step.seconds
                (center,), (axes,) = found[-1].at(np.array([time]))
        return tuple(found)

    def pose(self, time: ArrayLike) -> tuple[Array, Array]:
        """Origin (n, 3) m of the rotor at times (n,) s, and the axes (n, 3, 3) of its frame before its own turn."""
        time = np.asarray(time, float)
        which = np.searchsorted([stretch.start for stretch in self.stretches], time, "right") - 1
        center, axes = np.empty((len(time), 3)), np.empty((len(time), 3, 3))
        for k in np.unique(which):
            center[which == k], axes[which == k] = self.stretches[k].at(time[which == k])
        return center, axes

    @property
    def carried_by_coils(self) -> bool:
        """Whether there is no rotor, so that coils alone carry the floater."""
        return bool(self.coils) and not (self.rotor or self.field_map)

    @property
    def axial_coils(self) -> tuple[Coil, ...]:
        return tuple(coil for coil in self.coils if coil.axial)

    @property
    def other_coils(self) -> tuple[Coil, ...]:
        return tuple(coil for coil in self.coils if not coil.axial)

    @property
    def standing_bodies(self) -> tuple[Solid, ...]:
        """Plates and windings of coils, which stand in the laboratory."""
        return (*(self.plate.body.placed if self.plate else ()), *(coil.body for coil in self.coils))

    @property
    def turning_bodies(self) -> tuple[Solid, ...]:
        return (*(magnet.body for magnet in self.rotor), *(conductor.body for conductor in self.conductors))

    def __repr__(self) -> str:
        air = f"drag {self.drag.linear:.3g} N s/m, {self.drag.angular:.3g} N m s{' and more' if self.drag.air else ''}"
        lines = [f"Scene at {self._frequencies}, gravity ({listed(self.gravity)}) m/s², {air}"]
        lines += [f"  {body!r}" for body in (*self.rotor, *self.conductors)]
        lines += [f"  Field from {self.field_map}"] if self.field_map else []
        lines += [f"  {body!r}" for body in (self.floater, *(c.floater for c in self.companions), self.plate) if body]
        lines += [f"  {coil!r}" for coil in self.coils]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows = {f"magnet {k}": repr(magnet).removeprefix("Magnet ") for k, magnet in enumerate(self.rotor, 1)}
        rows |= {"field": str(self.field_map)} if self.field_map else {}
        rows["floater"] = repr(self.floater).removeprefix("Floater ")
        rows |= {"plate": repr(self.plate).removeprefix("Plate ")} if self.plate else {}
        rows |= {f"coil {k}": repr(coil).removeprefix("Coil ") for k, coil in enumerate(self.coils, 1)}
        return html_table(f"Scene at {self._frequencies}", rows | {"gravity": f"({listed(self.gravity)}) m/s²"})

    @property
    def _frequencies(self) -> str:
        said = [f"{self.frequency:g} Hz"]
        for step in self.drive:
            way = "held for" if step.frequency is None else f"to {step.frequency:g} Hz in"
            there = f", its origin to ({listed(1e3 * np.array(step.center))}) mm" if step.center else ""
            there += f", its axis to ({listed(np.array(step.axis))})" if step.axis else ""
            said.append(f"{way} {step.seconds:g} s{there}")
        return ", ".join(said)
