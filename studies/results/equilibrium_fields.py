"""What is told of an equilibrium: listed once, for labelled data and for JSON."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...dynamics.steady import Equilibrium


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
