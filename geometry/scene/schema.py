"""The scene file's keys, types and ranges, the rules between keys, and what they say in SI units."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from ..common import Array
from ..magnets import Conductor, Magnet, Rotor, horizontal, tilt, vertical
from ..shapes import Box, Cylinder, Sphere, rotation_matrix
from ..solids import Part, Solid, known_shape
from .contents import AbsoluteStart, Coil, Companion, Drag, DriveStep, Lowering, MapReading, OffsetStart, Plate, Scene
from .floater import Floater, FloaterPart

MILLI = 1e-3
ORIGIN = (0.0, 0.0, 0.0)
Parts = Mapping[str, Part]  # Solids of files by what the keys call these


def _zero_or(least: float) -> AfterValidator:
    """Refuse numbers, or lists of them, that are nearly zero: nobody means them, and their inverses are infinite."""

    def checked(value: Any) -> Any:
        size = max(abs(entry) for entry in value) if isinstance(value, list) else abs(value)
        if 0 < size < least:
            raise PydanticCustomError("nearly_zero", "zero, or at least {least}", {"least": f"{least:g}"})
        return value

    return AfterValidator(checked)


Entry = TypeVar("Entry")
Three = Annotated[list[Entry], Field(min_length=3, max_length=3)]
Name = Annotated[str, Field(min_length=1)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
NotNegative = Annotated[Number, Field(ge=0.0)]
Positive = Annotated[Number, Field(gt=0.0)]
Length = Annotated[Positive, Field(ge=1e-3, le=1e6)]
Coordinate = Annotated[Number, Field(ge=-1e6, le=1e6)]
Angle = Annotated[Number, Field(ge=-360.0, le=360.0)]
Polarization = Annotated[Number, Field(ge=-100.0, le=100.0)]
Remanence = Annotated[NotNegative, Field(le=100.0), _zero_or(1e-12)]
Permeability = Annotated[Number, Field(ge=1.0, le=1e6)]
Conductivity = Annotated[NotNegative, Field(le=1e9), _zero_or(1e-3)]
Metal = Annotated[Number, Field(ge=1e-3, le=1e9)]
Density = Annotated[Positive, Field(ge=1e-3, le=1e6)]
Coercivity = Annotated[Positive, Field(ge=1e-6, le=1e5)]
Brake = Annotated[NotNegative, Field(le=1e6), _zero_or(1e-30)]
Speed = Annotated[Number, Field(ge=-1e9, le=1e9)]
Frequency = Annotated[NotNegative, Field(le=1e6), _zero_or(1e-3)]
Duration = Annotated[Positive, Field(ge=1e-6, le=1e9)]
RECOIL_PERMEABILITY = 1.05  # Default: sintered NdFeB
# Along the easy axis, and across it; a single number for both.
MagnetPermeability = Annotated[
    list[Permeability],
    Field(min_length=2, max_length=2),
    BeforeValidator(lambda value: value if isinstance(value, list) else [value] * 2, json_schema_input_type=float),
]
# The keys of every shape; its axis, where it has one, is along the body's z.
SIZES: dict[str, tuple[str, ...]] = {
    "cuboid": ("size_mm",),
    "cube": ("edge_mm",),
    "ring": ("diameter_mm", "inner_diameter_mm", "height_mm"),
    "cylinder": ("diameter_mm", "height_mm"),
    "disc": ("diameter_mm", "height_mm"),
    "sphere": ("diameter_mm",),
}
SIZE_KEYS = tuple(dict.fromkeys(key for keys in SIZES.values() for key in keys))


class Table(BaseModel):
    """A table of the scene file."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def solid_of(table: Table) -> Solid:
    """The body of a table that has a shape, in its place if it has one."""
    given = dict(table)
    pose = MILLI * np.array(given.get("center_mm", ORIGIN)), rotation_matrix(given.get("rotation_deg", ORIGIN))
    shape, radius = given.get("shape", "cuboid"), (given.get("diameter_mm") or 0.0) * MILLI / 2
    if shape == "sphere":
        return Sphere(radius, *pose)
    if shape in ("cylinder", "disc", "ring"):
        hole = (given.get("inner_diameter_mm") or 0.0) * MILLI / 2
        return Cylinder(radius, given["height_mm"] * MILLI, *pose, inner_radius=hole)
    return Box(np.array([given["edge_mm"]] * 3 if shape == "cube" else given["size_mm"]) * MILLI, *pose)


class _Placed(Table):
    size_mm: Three[Length] | None = None
    diameter_mm: Length | None = None
    height_mm: Length | None = None
    center_mm: Three[Coordinate]
    rotation_deg: Three[Angle] = [0.0, 0.0, 0.0]


class _Shaped(_Placed):
    shape: Literal["cuboid", "cylinder", "ring", "sphere"] = "cuboid"
    inner_diameter_mm: Length | None = None
    file: Name | None = None

    def body(self, parts: Parts) -> Solid:
        """The body, or that of a file with the file's origin in its place, turned about it."""
        if not self.file:
            return solid_of(self)
        part, turn = parts[self.file], rotation_matrix(self.rotation_deg)
        part = replace(part, center=MILLI * np.array(self.center_mm) - turn @ part.origin, rotation=turn)
        return known_shape(part) or part

    def along(self, body: Solid, vector: list[float]) -> Array:
        """A vector along the table's axes along those of its `body`: a known shape in a file can have others."""
        if not self.file or isinstance(body, Part):
            return np.array(vector)
        return np.asarray(body.rotation.T @ rotation_matrix(self.rotation_deg) @ np.array(vector))


class ConductorTable(_Placed):
    """A piece of metal that turns with the rotor."""

    shape: Literal["cuboid", "cylinder"] = "cuboid"
    conductivity_S_m: Metal


class MagnetTable(_Shaped):
    """One magnet of an explicit rotor; its polarisation is along the body's axes and turns with it."""

    polarization_T: Annotated[Three[Polarization], _zero_or(1e-12)]
    recoil_permeability: MagnetPermeability = [RECOIL_PERMEABILITY, RECOIL_PERMEABILITY]
    conductivity_S_m: Conductivity | None = None
    coercivity_kA_m: Coercivity | None = None

    def magnet(self, parts: Parts, rotor: "AnyRotor") -> Magnet:
        """The magnet, its body from a file where that is given; what it does not say, its `rotor` says."""
        conductivity = rotor.conductivity_S_m if self.conductivity_S_m is None else self.conductivity_S_m
        knee = self.coercivity_kA_m or rotor.coercivity_kA_m
        (along, across), body = self.recoil_permeability, self.body(parts)
        material = along, across, conductivity, 1e3 * knee if knee else None
        return Magnet(body, self.along(body, self.polarization_T), *material)


class AnyRotor(Table):
    """Keys of every rotor."""

    field_map: Name | None = None
    map_length_unit: Literal["m", "cm", "mm", "um", "in"] | None = None
    map_field_unit: Literal["T", "mT", "uT", "nT", "G", "mG", "kG"] | None = None
    map_columns: Name | None = None
    conductivity_S_m: Conductivity | None = None
    coercivity_kA_m: Coercivity | None = None
    conductors: list[ConductorTable] = []


class ArticleRotor(AnyRotor):
    """One or two cubes (or cylinders, or spheres) of the article's rotors."""

    shape: Literal["cube", "cylinder", "sphere"] = "cube"
    edge_mm: Length | None = None
    diameter_mm: Length | None = None
    height_mm: Length | None = None
    remanence_T: Remanence
    recoil_permeability: MagnetPermeability = [RECOIL_PERMEABILITY, RECOIL_PERMEABILITY]

    def _of(self, build: Callable[..., Rotor], measure: float) -> Rotor:
        knee = None if self.coercivity_kA_m is None else 1e3 * self.coercivity_kA_m
        magnets = build(measure, solid_of(self), self.remanence_T, *self.recoil_permeability)
        return tuple(replace(magnet, conductivity=self.conductivity_S_m, coercivity=knee) for magnet in magnets)


class DisplacedRotor(ArticleRotor):
    """One cube beside the axis, or two, the upper magnetised along the axis."""

    configuration: Literal["horizontal", "vertical"]
    displacement_mm: Annotated[NotNegative, Field(le=1e6)]

    def in_si(self, parts: Parts) -> Rotor:
        return self._of(horizontal if self.configuration == "horizontal" else vertical, self.displacement_mm * MILLI)


class TiltRotor(ArticleRotor):
    """One cube, turned about y."""

    configuration: Literal["tilt"]
    angle_deg: Annotated[Number, Field(ge=-90.0, le=90.0)]

    def in_si(self, parts: Parts) -> Rotor:
        return self._of(tilt, float(np.radians(self.angle_deg)))


class ExplicitRotor(AnyRotor):
    """Any set of magnets."""

    magnets: Annotated[list[MagnetTable], Field(min_length=1)]

    def in_si(self, parts: Parts) -> Rotor:
        return tuple(magnet.magnet(parts, self) for magnet in self.magnets)


def _rotor_kind(rotor: Any) -> str | None:
    table = dict(rotor) if isinstance(rotor, dict | BaseModel) else {}
    configuration = table.get("configuration")
    return "magnets" if "magnets" in table else configuration if isinstance(configuration, str) else None


class BallastTable(_Shaped):
    """A part of a floater that is not magnetic, placed along the axes of the floater's keys."""

    density_kg_m3: Density
    conductivity_S_m: Conductivity | None = None

    def piece(self, parts: Parts, conductivity: float | None) -> FloaterPart:
        """The part; `conductivity` is that of all magnets that do not name their own."""
        body = Magnet(self.body(parts), np.zeros(3), conductivity=self.conductivity_S_m)
        return FloaterPart(body, self.density_kg_m3)


class FloaterMagnetTable(BallastTable):
    """A magnet of a floater, likewise; its polarisation is along the body's axes and turns with it."""

    polarization_T: Annotated[Three[Polarization], _zero_or(1e-12)]
    recoil_permeability: Permeability = RECOIL_PERMEABILITY

    def piece(self, parts: Parts, conductivity: float | None) -> FloaterPart:
        body, own = self.body(parts), self.conductivity_S_m
        polarization = self.along(body, self.polarization_T)
        metal = conductivity if own is None else own
        magnet = Magnet(body, polarization, self.recoil_permeability, conductivity=metal)
        return FloaterPart(magnet, self.density_kg_m3)


class FloaterTable(Table):
    """The floating magnet: one body that is polarised along its z, or a composite of magnets and ballast."""

    shape: Literal["sphere", "cuboid", "cylinder", "ring", "file"] = "sphere"
    size_mm: Three[Length] | None = None
    diameter_mm: Length | None = None
    height_mm: Length | None = None
    inner_diameter_mm: Length | None = None
    file: Name | None = None
    remanence_T: Remanence | None = None
    recoil_permeability: Permeability | None = None
    density_kg_m3: Density | None = None
    conductivity_S_m: Conductivity | None = None
    inertia_kg_m2: Three[Positive] | None = None
    magnets: list[FloaterMagnetTable] = []
    bodies: list[BallastTable] = []

    @property
    def composite(self) -> bool:
        return bool(self.model_fields_set & {"magnets", "bodies"})

    def floater(self, parts: Parts) -> Floater:
        permeability = self.recoil_permeability or RECOIL_PERMEABILITY
        given = None if self.inertia_kg_m2 is None else tuple(self.inertia_kg_m2)
        pieces = [table.piece(parts, self.conductivity_S_m) for table in self.tables]
        assert pieces or (self.remanence_T is not None and self.density_kg_m3 is not None)
        if self.file:
            body = known_shape(parts[self.file]) or parts[self.file]
            polarization = body.rotation.T @ np.array([0.0, 0.0, self.remanence_T])
            magnet = Magnet(body, polarization, permeability, conductivity=self.conductivity_S_m)
            pieces = [FloaterPart(magnet, self.density_kg_m3)]  # type: ignore[arg-type]
        if pieces:
            return Floater.composed(pieces, given)  # type: ignore[arg-type]
        shape = solid_of(self)
        material = self.remanence_T, permeability, self.density_kg_m3, self.conductivity_S_m
        own = None if isinstance(shape, Sphere | Part) else shape
        return Floater(shape.circumradius, *material, own, moments_of_inertia=given)  # type: ignore[arg-type]

    @property
    def tables(self) -> list[BallastTable]:
        return [*self.magnets, *self.bodies]


class LoweringTable(Table):
    """The plate's way down."""

    start_s: Annotated[NotNegative, Field(le=1e9)]
    speed_mm_s: Annotated[Positive, Field(ge=1e-6, le=1e6)]
    distance_mm: Annotated[NotNegative, Field(le=1e6), _zero_or(1e-6)]


class PlateTable(_Shaped):
    """The conducting plate."""

    shape: Literal["cuboid", "disc", "cylinder", "ring", "sphere", "file"] = "cuboid"  # type: ignore[assignment]
    conductivity_S_m: Metal
    lowering: LoweringTable | None = None

    def plate(self, parts: Parts) -> Plate:
        down = self.lowering
        lowering = Lowering(down.start_s, down.speed_mm_s * MILLI, down.distance_mm * MILLI) if down else None
        return Plate(self.body(parts), self.conductivity_S_m, lowering)


class CoilTable(Table):
    """A round coil whose axis is along z."""

    radius_mm: Length
    width_mm: Length
    height_mm: Length
    center_mm: Three[Coordinate]
    turns: Annotated[Positive, Field(le=1e9)] = 1.0
    current_A: Number | Annotated[list[Annotated[list[Number], Field(min_length=2, max_length=2)]], Field(min_length=2)]
    frequency_hz: Frequency = 0.0
    phase_deg: Angle = 0.0

    def coil(self) -> Coil:
        size = self.radius_mm * MILLI, self.width_mm * MILLI, self.height_mm * MILLI
        current = self.current_A if isinstance(self.current_A, float) else np.array(self.current_A)
        phase = float(np.radians(self.phase_deg))
        return Coil(MILLI * np.array(self.center_mm), *size, self.turns, current, self.frequency_hz, phase)


class DragTable(Table):
    """Drag on the floater: of air by a model, or numbers."""

    model: Literal["stokes", "air"] | None = None
    linear_N_s_m: Brake | None = None
    angular_N_m_s: Brake | None = None

    def drag(self, floater: Floater) -> Drag:
        if self.linear_N_s_m is not None and self.angular_N_m_s is not None:
            return Drag(self.linear_N_s_m, self.angular_N_m_s)
        return replace(Drag.of(floater), air=self.model == "air")


class StartTable(Table):
    """Where a simulation begins: an offset from the stable equilibrium, or absolutely."""

    offset_mm: Three[Coordinate] | None = None
    position_mm: Three[Coordinate] | None = None
    velocity_mm_s: Three[Speed] | None = None
    moment: Three[Number] | None = None
    spin_hz: Three[Coordinate] | None = None
    body_x: Three[Number] | None = None

    def start(self) -> OffsetStart | AbsoluteStart:
        if self.position_mm is None:
            return OffsetStart() if self.offset_mm is None else OffsetStart(MILLI * np.array(self.offset_mm))
        moment = np.array(self.moment or [0.0, 0.0, 1.0])
        if not 1e-100 < np.abs(moment).max() < 1e100:  # squares of its parts are no numbers
            moment = moment / np.abs(moment).max()
        return AbsoluteStart(
            position=MILLI * np.array(self.position_mm),
            velocity=MILLI * np.array(self.velocity_mm_s or ORIGIN),
            moment=moment / np.linalg.norm(moment),
            spin=2 * np.pi * np.array(self.spin_hz or ORIGIN),
            body_x=None if self.body_x is None else np.array(self.body_x) / np.linalg.norm(self.body_x),
        )


class DriveTable(Table):
    """A step of the rotor's drive: a ramp to a frequency or to rest, or a hold, or the rotor's way."""

    to_hz: Frequency | None = None
    stop: Literal[True] | None = None
    in_s: Duration | None = None
    hold_s: Duration | None = None
    center_mm: Three[Coordinate] | None = None
    axis: Three[Number] | None = None

    def step(self) -> DriveStep:
        center = None if self.center_mm is None else tuple(MILLI * c for c in self.center_mm)
        axis = None if self.axis is None else tuple((np.array(self.axis) / np.linalg.norm(self.axis)).tolist())
        return DriveStep(0.0 if self.stop else self.to_hz, self.in_s or self.hold_s or 0.0, center, axis)


One = TypeVar("One")
Several = TypeVar("Several")
OneOrSeveral = Annotated[
    Annotated[One, Tag("one")] | Annotated[Several, Tag("several")],
    Discriminator(lambda given: "several" if isinstance(given, list) else "one"),
]


class SceneTable(Table):
    """The whole file."""

    frequency_hz: Frequency = 0.0
    gravity_m_s2: Three[Coordinate] = [0.0, 0.0, -9.81]
    rotor: Annotated[
        Annotated[DisplacedRotor, Tag("horizontal")]
        | Annotated[DisplacedRotor, Tag("vertical")]
        | Annotated[TiltRotor, Tag("tilt")]
        | Annotated[ExplicitRotor, Tag("magnets")],
        Discriminator(_rotor_kind),
    ] = ExplicitRotor.model_construct(magnets=[])  # none, beside coils
    floater: OneOrSeveral[FloaterTable, list[FloaterTable]]
    plate: OneOrSeveral[PlateTable | None, Annotated[list[PlateTable], Field(min_length=1)]] = None
    drag: DragTable | None = None
    start: OneOrSeveral[StartTable | None, list[StartTable]] = None
    drive: list[DriveTable] | None = None
    coils: list[CoilTable] | None = None

    def named(self, name: str) -> dict[str, Any]:
        """The tables of plates, floaters or starts by what messages call them."""
        given = getattr(self, name)
        if isinstance(given, list):
            return {f"{name}[{k}]": one for k, one in enumerate(given)}
        return {} if given is None else {name: given}

    @property
    def starts(self) -> dict[str, StartTable]:
        return self.named("start") or {"start": StartTable()}

    def scene(self, parts: Parts) -> Scene:
        rotor, drag = self.rotor, self.drag or DragTable()
        floater, *others = (table.floater(parts) for table in self.named("floater").values())
        start, *elsewhere = (table.start() for table in self.starts.values())
        return Scene(
            frequency=self.frequency_hz,
            gravity=np.array(self.gravity_m_s2),
            rotor=rotor.in_si(parts),
            floater=floater,
            companions=tuple(
                Companion(one, drag.drag(one), begins) for one, begins in zip(others, elsewhere, strict=True)
            ),
            plate=Plate.of([table.plate(parts) for table in self.named("plate").values()]) if self.plate else None,
            drag=drag.drag(floater),
            start=start,
            field_map=Path(rotor.field_map) if rotor.field_map else None,
            map_reading=MapReading(rotor.map_length_unit, rotor.map_field_unit, rotor.map_columns),
            conductors=tuple(Conductor(solid_of(table), table.conductivity_S_m) for table in rotor.conductors),
            drive=tuple(step.step() for step in self.drive or ()),
            coils=tuple(coil.coil() for coil in self.coils or ()),
        )
