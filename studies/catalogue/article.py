"""The rotors, magnets and ranges of the article whose figures the studies reproduce, and their scenes.

J. M. Hermansen, F. L. Durhuus and R. Bjørk, Appl. Phys. Lett. 127 (2025) 012402.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...dynamics.continuation.frequencies import StableRange, reference_state, stable_range
from ...dynamics.equilibria.equilibrium import Equilibrium, Survey
from ...dynamics.motion.rates import Rates
from ...geometry.common import MAGNET_CONDUCTIVITY, Array
from ...geometry.magnets import Magnet
from ...geometry.rotor import horizontal, tilt, vertical
from ...geometry.scene.contents import Drag, Plate, Scene
from ...geometry.scene.floater import Floater
from ...geometry.shapes import Box
from ..cli.options import FieldModel, InteractionModel, Models, PlateModel
from ..levitation import Levitation
from ..study import Point

EDGE, REMANENCE, PERMEABILITY = 10e-3, 1.305, 1.05
"""Of the rotor's cubes: m; T, the middle of 1.29 to 1.32; recoil permeability usual for NdFeB, which is not given."""
FLOATER = Floater(6.35e-3, REMANENCE, PERMEABILITY, 7500.0)
WEIGHT = FLOATER.mass * 9.81  # Of the floater, N
PLATE_SIZE, PLATE_CONDUCTIVITY = (0.1, 0.24, 0.03), 3.5e7  # Of the aluminium plate: edges, m; S/m
CONTACT = EDGE / 2 + FLOATER.radius  # Distance on the axis at which floater and a cube that is not tilted touch, m
LOWEST, HIGHEST = 40.0, 250.0
"""Frequencies that are looked at, Hz: the article's floaters levitated from below 50 Hz to what its motor gave."""
FLIGHT = 250.0  # The longest trajectory of the experiment, s
RTOL = 1e-4
"""Relative accuracy of B asked of the finite elements, from contact on: it moves the equilibria by less than 1 µm."""
MODELS = ("dipole", "fem")


@dataclass(frozen=True)
class Configuration:
    """One of the article's three rotors."""

    make: Callable[..., tuple[Magnet, ...]]  # maker of its magnets, from the parameter in SI units
    symbol: str  # of the parameter, its unit, and that in SI
    unit: str
    scale: float
    tested: tuple[float, ...]  # values of the parameter that the article tried, in its unit
    levitated: tuple[float, ...]  # those of them that levitated in the experiment


CONFIGURATIONS = {
    "horizontal": Configuration(
        horizontal, "δx", "mm", 1e-3, tuple(float(x) for x in range(1, 9)), (1.0, 2.0, 3.0, 4.0)
    ),
    "vertical": Configuration(
        vertical, "δz", "mm", 1e-3, (10.0, 12.0, 14.0, 16.0, 18.0, 20.0), (10.0, 12.0, 14.0, 16.0)
    ),
    "tilt": Configuration(
        tilt, "δθ", "°", np.pi / 180, tuple(float(x) for x in range(5, 50, 5)), (5.0, 10.0, 15.0, 20.0)
    ),
}
QUICK = {"horizontal": (1.0,), "vertical": (14.0,), "tilt": (10.0,)}
"""One rotor of each configuration, for the quick settings of studies."""
QUICK_ROTORS = (("horizontal", 2.0), ("vertical", 14.0), ("tilt", 10.0))


def rotor_label(configuration: str, value: float) -> str:
    """A rotor's parameter with its symbol and unit."""
    kind = CONFIGURATIONS[configuration]
    return f"{kind.symbol} = {value:g}{'' if kind.unit == '°' else ' '}{kind.unit}"


def label_of(configuration: str) -> str:
    """A configuration's parameter with its unit, for an axis."""
    kind = CONFIGURATIONS[configuration]
    return f"{kind.symbol} ({kind.unit})"


def levitated_rotors(quick: bool) -> list[Point]:
    """A point for each rotor that levitated in the experiment; `quick` has one of each configuration."""
    return [
        {"configuration": configuration, "measure": measure}
        for configuration, kind in CONFIGURATIONS.items()
        for measure in (kind.levitated[1:2] if quick else kind.levitated)
    ]


def stable_in_flight(growth: ArrayLike) -> NDArray[np.bool_]:
    """Where no disturbance grows by a factor e within `FLIGHT`; False where there is no equilibrium (NaN)."""
    return np.asarray(np.asarray(growth) <= 1 / FLIGHT)


def polar_angle(moments: Array) -> Array:
    """Angle (...) to the axis, rad, of moments (..., 3)."""
    return np.asarray(np.arctan2(np.hypot(moments[..., 0], moments[..., 1]), moments[..., 2]))


def rotor_scene(
    configuration: str,
    value: float,
    frequency: float = 100.0,
    *,
    drag: bool = True,
    edge: float = EDGE,
    remanence: float = REMANENCE,
    permeability: float = PERMEABILITY,
    floater: Floater = FLOATER,
) -> Scene:
    """A rotor of the article above its floater, without a plate.

    Parameters
    ----------
    configuration, value : of the rotor; displacement in mm or tilt in degrees
    frequency : Hz
    drag : whether there is air (Stokes)
    edge, remanence, permeability : of the cubes, m, T and 1
    """
    kind = CONFIGURATIONS[configuration]
    magnets = kind.make(kind.scale * value, edge, remanence, permeability)
    return Scene(frequency, magnets, floater, Drag.stokes(floater.radius) if drag else Drag(0.0, 0.0))


def losses(scene: Scene, rotor: bool = True, air: bool = True) -> dict[str, Any]:
    """A scene's parts with eddy currents in the floater and in the `rotor`'s magnets, in real `air` or after Stokes."""
    magnets = tuple(replace(m, conductivity=MAGNET_CONDUCTIVITY if rotor else None) for m in scene.rotor)
    floater = replace(scene.floater, conductivity=MAGNET_CONDUCTIVITY)
    return {"rotor": magnets, "floater": floater, "drag": replace(Drag.stokes(floater.radius), air=air)}


def plate_with_face(face: float) -> Plate:
    """The article's plate below the rotor, its upper face at this height (m) from the rotor's origin."""
    return Plate(Box(np.array(PLATE_SIZE), np.array([0.0, 0.0, face - PLATE_SIZE[2] / 2])), PLATE_CONDUCTIVITY)


def levitation_of(
    scene: Scene, model: FieldModel, rtol: float = RTOL, interaction: InteractionModel = "rigid"
) -> Levitation:
    """A scene in one model's field, its plate left out."""
    return Levitation(scene, Models(model, "none", rtol, interaction=interaction))


def stable_frequencies(scene: Scene, rates: Rates) -> StableRange:
    """Frequencies of stable levitation of a rotor, whose motion has these `rates`; the scene's own is any.

    Raises
    ------
    EquilibriumError : it levitates stably at no frequency
    """
    return stable_range(scene, rates, *reference_state(scene))


def within(stable: StableRange, part: ArrayLike) -> Array:
    """Frequencies, Hz, at parts (0 to 1) of the way from the lowest to the highest stable one."""
    low, high = stable.low.parameter, stable.high.parameter
    return np.asarray(low + np.asarray(part) * (high - low))


def equilibrium_at(levitation: Levitation, distance: float) -> Equilibrium | None:
    """The equilibrium at a distance (m) that is known from its branch."""
    return next((e for e in levitation.equilibria if abs(e.distance - distance) < 1e-6), None)


def over_plate(
    alone: Levitation, start: Equilibrium, plate: Plate, model: PlateModel, rtol: float
) -> tuple[Levitation, Equilibrium, float] | None:
    """A scene with a plate, the equilibrium that its currents make of one without, and its table's relative error.

    None where there is none any more.

    Parameters
    ----------
    alone, start : the scene without a plate, and its equilibrium
    plate, model, rtol : the plate, the model of its currents and the accuracy asked of them
    """
    there = alone.elsewhere(replace(alone.models, plate_model=model, plate_rtol=rtol), plate=plate)
    there.adopt(Survey((start,), ()))
    memory, found = there.plate, there.equilibria
    if memory is None or not found or found[0].currents is None:
        return None
    return there, found[0], max(memory.table.errors.total, memory.share.error)
