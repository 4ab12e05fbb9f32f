"""The scene file's keys, types and ranges; every key carries its unit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from ..shapes import Box, Cylinder, Ring, Sphere, rotation_matrix
from ..solids import Part, Solid


def _zero_or(least: float) -> AfterValidator:
    """Refuse numbers, or lists of them, that are nearly zero: nobody means them, and their inverses are infinite."""

    def checked(value: Any) -> Any:
        size = max(abs(entry) for entry in value) if isinstance(value, list) else abs(value)
        if 0 < size < least:
            raise PydanticCustomError("nearly_zero", "zero, or at least {least}", {"least": f"{least:g}"})
        return value

    return AfterValidator(checked)


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
Coercivity = Annotated[Positive, Field(ge=1e-6, le=1e5)]
Brake = Annotated[NotNegative, Field(le=1e6), _zero_or(1e-30)]
Acceleration = Annotated[Number, Field(ge=-1e6, le=1e6)]
Speed = Annotated[Number, Field(ge=-1e9, le=1e9)]
Turns = Annotated[Number, Field(ge=-1e6, le=1e6)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Sizes = Annotated[list[Length], Field(min_length=3, max_length=3)]
Coordinates = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Angle], Field(min_length=3, max_length=3)]
Polarizations = Annotated[list[Polarization], Field(min_length=3, max_length=3), _zero_or(1e-12)]
RECOIL_PERMEABILITY = 1.05
"""Default: sintered NdFeB."""


def _both_axes(value: Any) -> Any:
    """One permeability serves along and across the easy axis."""
    return value if isinstance(value, list) else [value] * 2


MagnetPermeability = Annotated[
    list[Permeability], Field(min_length=2, max_length=2), BeforeValidator(_both_axes, json_schema_input_type=float)
]
"""Along the easy axis, and across it; a single number for both."""


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ShapeSection(_Table):
    """The keys of a body's shape; which of them belong to it, `SIZES` says."""

    shape: Literal["cuboid", "cylinder", "ring", "sphere"] = "cuboid"
    size_mm: Sizes | None = None
    diameter_mm: Length | None = None
    inner_diameter_mm: Length | None = None
    height_mm: Length | None = None


SIZES = {
    "cuboid": ("size_mm",),
    "cylinder": ("diameter_mm", "height_mm"),
    "ring": ("diameter_mm", "inner_diameter_mm", "height_mm"),
    "sphere": ("diameter_mm",),
}
"""The keys of every shape; its axis, where it has one, is along the body's z."""


class ConductorSection(_Table):
    """A piece of metal that turns with the rotor: a cuboid, or a cylinder with its axis along the body's z."""

    shape: Literal["cuboid", "cylinder"] = "cuboid"
    size_mm: Sizes | None = None
    diameter_mm: Length | None = None
    height_mm: Length | None = None
    center_mm: Coordinates
    rotation_deg: Angles = [0.0, 0.0, 0.0]
    conductivity_S_m: Metal


class _AnyRotor(_Table):
    field_map: Annotated[str, Field(min_length=1)] | None = None
    map_length_unit: Literal["m", "cm", "mm", "um", "in"] | None = None
    map_field_unit: Literal["T", "mT", "uT", "nT", "G", "mG", "kG"] | None = None
    map_columns: Annotated[str, Field(min_length=1)] | None = None
    conductivity_S_m: Conductivity | None = None
    coercivity_kA_m: Coercivity | None = None
    conductors: list[ConductorSection] = []


class _ArticleRotor(_AnyRotor):
    shape: Literal["cube", "cylinder", "sphere"] = "cube"
    edge_mm: Length | None = None
    diameter_mm: Length | None = None
    height_mm: Length | None = None
    remanence_T: Remanence
    recoil_permeability: MagnetPermeability = [RECOIL_PERMEABILITY, RECOIL_PERMEABILITY]


class HorizontalRotor(_ArticleRotor):
    """One cube (or cylinder, or sphere), displaced from the axis."""

    configuration: Literal["horizontal"]
    displacement_mm: Annotated[NotNegative, Field(le=1e6)]


class VerticalRotor(_ArticleRotor):
    """Two cubes (or cylinders, or spheres), the upper magnetised along the axis."""

    configuration: Literal["vertical"]
    displacement_mm: Annotated[NotNegative, Field(le=1e6)]


class TiltRotor(_ArticleRotor):
    """One cube (or cylinder, or sphere), turned about y."""

    configuration: Literal["tilt"]
    angle_deg: Annotated[Number, Field(ge=-90.0, le=90.0)]


class MagnetSection(ShapeSection):
    """One magnet of an explicit rotor; its polarisation is along the body's axes and turns with it."""

    file: Annotated[str, Field(min_length=1)] | None = None
    center_mm: Coordinates
    rotation_deg: Angles = [0.0, 0.0, 0.0]
    polarization_T: Polarizations
    recoil_permeability: MagnetPermeability = [RECOIL_PERMEABILITY, RECOIL_PERMEABILITY]
    conductivity_S_m: Conductivity | None = None
    coercivity_kA_m: Coercivity | None = None


class ExplicitRotor(_AnyRotor):
    """Any set of magnets."""

    magnets: Annotated[list[MagnetSection], Field(min_length=1)]


def rotor_kind(rotor: Any) -> str | None:
    """Which of the rotor tables a `[rotor]` table is."""
    if not isinstance(rotor, dict):
        return None
    configuration = rotor.get("configuration")
    return "magnets" if "magnets" in rotor else configuration if isinstance(configuration, str) else None


Rotor = Annotated[
    Annotated[HorizontalRotor, Tag("horizontal")]
    | Annotated[VerticalRotor, Tag("vertical")]
    | Annotated[TiltRotor, Tag("tilt")]
    | Annotated[ExplicitRotor, Tag("magnets")],
    Discriminator(rotor_kind),
]


class FloaterSection(_Table):
    """The floating magnet: a sphere, or a cuboid or cylinder that is polarised along the body's z."""

    shape: Literal["sphere", "cuboid", "cylinder"] = "sphere"
    size_mm: Sizes | None = None
    diameter_mm: Length | None = None
    height_mm: Length | None = None
    remanence_T: Remanence
    recoil_permeability: Permeability = RECOIL_PERMEABILITY
    density_kg_m3: Annotated[Positive, Field(ge=1e-3, le=1e6)]
    conductivity_S_m: Conductivity | None = None


class LoweringSection(_Table):
    """The plate's way down."""

    start_s: Annotated[NotNegative, Field(le=1e9)]
    speed_mm_s: Annotated[Positive, Field(ge=1e-6, le=1e6)]
    distance_mm: Annotated[NotNegative, Field(le=1e6), _zero_or(1e-6)]


class PlateSection(_Table):
    """The conducting plate."""

    size_mm: Sizes
    center_mm: Coordinates
    rotation_deg: Angles = [0.0, 0.0, 0.0]
    conductivity_S_m: Metal
    lowering: LoweringSection | None = None


class DragSection(_Table):
    """Drag on the floater: of air by a model, or numbers."""

    model: Literal["stokes", "air"] | None = None
    linear_N_s_m: Brake | None = None
    angular_N_m_s: Brake | None = None


class StartSection(_Table):
    """Where a simulation begins: an offset from the stable equilibrium, or absolutely."""

    offset_mm: Coordinates | None = None
    position_mm: Coordinates | None = None
    velocity_mm_s: Annotated[list[Speed], Field(min_length=3, max_length=3)] | None = None
    moment: Vector | None = None
    spin_hz: Annotated[list[Turns], Field(min_length=3, max_length=3)] | None = None


class SceneSection(_Table):
    """The whole file."""

    frequency_hz: Annotated[NotNegative, Field(le=1e6), _zero_or(1e-3)]
    gravity_m_s2: Annotated[list[Acceleration], Field(min_length=3, max_length=3)] = [0.0, 0.0, -9.81]
    rotor: Rotor
    floater: FloaterSection
    plate: PlateSection | None = None
    drag: DragSection | None = None
    start: StartSection | None = None


MILLI = 1e-3
ARTICLE_SIZES = {"cube": ("edge_mm",), **{shape: SIZES[shape] for shape in ("cylinder", "sphere")}}
"""The keys of every shape that may stand for the cubes of a rotor of the article."""
FLOATER_SIZES = {shape: SIZES[shape] for shape in ("sphere", "cuboid", "cylinder")}
"""The keys of every shape of a floater."""
KEYS = ("size_mm", "edge_mm", "diameter_mm", "inner_diameter_mm", "height_mm")


def shape_faults(place: str, table: Any, sizes: Mapping[str, tuple[str, ...]]) -> list[str]:
    """What is wrong with the keys of a shape at a place of the scene file."""
    if getattr(table, "file", None):
        sizes = {"cuboid": ()}
        if table.shape not in sizes:
            return [f"Input {place}.shape must be left out beside file; instead received {table.shape!r}."]
    given = tuple(key for key in KEYS if getattr(table, key, None) is not None)
    wanted = sizes[table.shape]
    if set(given) != set(wanted) and not wanted:
        return [f"Input {place} must have no size beside file; instead received {' and '.join(given)}."]
    if set(given) != set(wanted):
        more = " and ".join(key for key in given if key not in wanted)
        return [
            f"Input {place} must have {' and '.join(wanted)}, as the shape is {table.shape!r}; "
            f"instead received {' and '.join(given) or 'no size'}." + (f" Leave out {more}." if more else "")
        ]
    if table.shape == "ring" and table.inner_diameter_mm >= table.diameter_mm:
        return [
            f"Input {place}.inner_diameter_mm must be less than diameter_mm {table.diameter_mm:g}; "
            f"instead received {table.inner_diameter_mm:g}."
        ]
    return []


def solid(
    table: Any, center_mm: Sequence[float] = (0.0, 0.0, 0.0), rotation_deg: Sequence[float] = (0.0, 0.0, 0.0)
) -> Solid:
    """The body of keys without faults, in its place."""
    pose = np.array(center_mm) * MILLI, rotation_matrix(rotation_deg)
    if table.shape in ("cuboid", "cube"):
        return Box(np.array(table.size_mm if table.shape == "cuboid" else [table.edge_mm] * 3) * MILLI, *pose)
    radius = table.diameter_mm * MILLI / 2
    if table.shape == "sphere":
        return Sphere(radius, *pose)
    if table.shape == "cylinder":
        return Cylinder(radius, table.height_mm * MILLI, *pose)
    return Ring(radius, table.inner_diameter_mm * MILLI / 2, table.height_mm * MILLI, *pose)


def placed(part: Part, center_mm: Sequence[float], rotation_deg: Sequence[float]) -> Part:
    """The solid of a STEP file, its own origin in a place."""
    turn = rotation_matrix(rotation_deg)
    return replace(part, center=np.array(center_mm) * MILLI - turn @ part.origin, rotation=turn)


def shape_keys(body: Solid) -> dict[str, Any]:
    """The keys of a body's shape in SI units of the body, but for its pose; a cuboid's is left out."""
    if isinstance(body, Box):
        return {"size_mm": body.size}
    if isinstance(body, Part):
        return {"file": str(body.file)}
    if isinstance(body, Sphere):
        return {"shape": "sphere", "diameter_mm": 2 * body.radius}
    known: dict[str, Any] = {"diameter_mm": 2 * body.radius, "height_mm": body.height}
    if isinstance(body, Ring):
        return {"shape": "ring", "inner_diameter_mm": 2 * body.inner_radius, **known}
    return {"shape": "cylinder", **known}


def key_faults(table: SceneSection) -> list[str]:
    """One sentence for each rule that is broken."""
    faults = _start_faults(table.start) + _drag_faults(table.drag) + _shape_faults(table.rotor) + _floater_faults(table)
    if table.rotor.field_map is None:
        alone = [k for k in ("map_length_unit", "map_field_unit", "map_columns") if getattr(table.rotor, k) is not None]
        faults += [f"Input rotor.{key} must come with rotor.field_map; instead received it alone." for key in alone]
    return faults


def _start_faults(start: StartSection | None) -> list[str]:
    """Rules between the keys of `[start]`."""
    if start is None:
        return []
    absolute = {key: getattr(start, key) for key in ("velocity_mm_s", "moment", "spin_hz")}
    faults = []
    if start.offset_mm is not None and start.position_mm is not None:
        faults.append("Input start must have offset_mm or position_mm; instead received both.")
    if start.position_mm is None:
        faults += [
            f"Input start.{key} must come with start.position_mm; instead received it alone."
            for key, value in absolute.items()
            if value is not None
        ]
    if start.moment is not None and not any(start.moment):
        faults.append(f"Input start.moment must be a direction, not zero; instead received {start.moment}.")
    return faults


def _drag_faults(drag: DragSection | None) -> list[str]:
    """A model, or both numbers."""
    if drag is None:
        return []
    numbers = {key: getattr(drag, key) for key in ("linear_N_s_m", "angular_N_m_s")}
    given = [key for key, value in numbers.items() if value is not None]
    if drag.model is not None:
        return [f"Input drag.{key} must be left out beside drag.model; instead received both." for key in given]
    return [f"Input drag.{key} must be given; instead it is missing." for key in numbers if key not in given]


def _shape_faults(rotor: Rotor) -> list[str]:
    """Which sizes belong to which shape."""
    faults = []
    if isinstance(rotor, ExplicitRotor):
        for k, magnet in enumerate(rotor.magnets):
            faults += shape_faults(f"rotor.magnets[{k}]", magnet, SIZES)
    else:
        faults += shape_faults("rotor", rotor, ARTICLE_SIZES)
    for k, conductor in enumerate(rotor.conductors):
        faults += shape_faults(f"rotor.conductors[{k}]", conductor, SIZES)
    return faults


def _floater_faults(table: SceneSection) -> list[str]:
    """The sizes of the floater's shape, and what only a sphere can have."""
    floater, faults = table.floater, shape_faults("floater", table.floater, FLOATER_SIZES)
    if floater.shape == "sphere":
        missing = floater.diameter_mm is None and floater.size_mm is None and floater.height_mm is None
        return ["Input floater.diameter_mm must be given; instead it is missing."] if missing else faults
    if floater.conductivity_S_m is not None:
        faults.append(
            "Input floater.conductivity_S_m must be left out where the floater is no sphere, as its currents are not "
            f"known then; instead received {floater.conductivity_S_m:g}."
        )
    if table.drag and table.drag.model == "air":
        faults.append(
            'Input drag.model must be "stokes", or linear_N_s_m and angular_N_m_s be given, where the floater is no '
            'sphere; instead received "air".'
        )
    return faults
