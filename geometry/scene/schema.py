"""The scene file's keys, types and ranges; every key carries its unit."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError


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
