"""The rotors, magnets and ranges of the article whose figures the studies reproduce, their scenes, and its formulas:
force along the axis, radius of the side mode, levitation distance.

J. M. Hermansen, F. L. Durhuus and R. Bjørk, Appl. Phys. Lett. 127 (2025) 012402, and its supplement.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...dynamics.continuation.frequencies import StableRange, reference_state, stable_range
from ...dynamics.equilibria.equilibrium import Equilibrium, Survey
from ...dynamics.motion.rates import Rates
from ...geometry.common import MAGNET_CONDUCTIVITY, MU_0, Array
from ...geometry.magnets import Magnet, horizontal, tilt, vertical
from ...geometry.scene.contents import Drag, Plate, Scene
from ...geometry.scene.floater import Floater
from ...geometry.shapes import Box
from ..cli.options import FieldModel, InteractionModel, Models, PlateModel
from ..levitation import Levitation
from ..study import Point

# Of the rotor's cubes: m; T, the middle of 1.29 to 1.32; recoil permeability usual for NdFeB, which is not given
EDGE, REMANENCE, PERMEABILITY = 10e-3, 1.305, 1.05
FLOATER = Floater(6.35e-3, REMANENCE, PERMEABILITY, 7500.0)
WEIGHT = FLOATER.mass * 9.81  # Of the floater, N
PLATE_SIZE, PLATE_CONDUCTIVITY = (0.1, 0.24, 0.03), 3.5e7  # Of the aluminium plate: edges, m; S/m
CONTACT = EDGE / 2 + FLOATER.radius  # Distance on the axis at which floater and a cube that is not tilted touch, m
# Frequencies that are looked at, Hz: the article's floaters levitated from below 50 Hz to what its motor gave
LOWEST, HIGHEST = 40.0, 250.0
FLIGHT = 250.0  # The longest trajectory of the experiment, s
RTOL = 1e-4  # Relative accuracy of B by finite elements, from contact on: it moves equilibria by less than 1 µm
MODELS = ("dipole", "fem")
INTERACTION = 1e-7 * FLOATER.moment * REMANENCE * EDGE**3 / MU_0  # G = μ0 m_f m_r / 4π, N m⁴
# From contact to here roots of the force are looked for, m; nearer, the side mode's radius has no bound
FARTHEST = 0.12


@dataclass(frozen=True)
class Configuration:
    """One of the article's three rotors."""

    make: Callable[..., tuple[Magnet, ...]]  # maker of its magnets, from the parameter in SI units
    symbol: str  # of the parameter, its unit, and that in SI
    unit: str
    scale: float
    tested: tuple[float, ...]  # values of the parameter that the article tried, in its unit
    levitated: tuple[float, ...]  # those of them that levitated in the experiment


X, Z, TILT = (tuple(np.arange(*ends, dtype=float).tolist()) for ends in ((1, 9), (10, 21, 2), (5, 50, 5)))
CONFIGURATIONS = {
    "horizontal": Configuration(horizontal, "δx", "mm", 1e-3, X, X[:4]),
    "vertical": Configuration(vertical, "δz", "mm", 1e-3, Z, Z[:4]),
    "tilt": Configuration(tilt, "δθ", "°", np.pi / 180, TILT, TILT[:4]),
}
# One rotor of each configuration, for the quick settings of studies
QUICK = {"horizontal": (1.0,), "vertical": (14.0,), "tilt": (10.0,)}
QUICK_ROTORS = (("horizontal", 2.0), ("vertical", 14.0), ("tilt", 10.0))


def rotor_label(configuration: str, value: float) -> str:
    kind = CONFIGURATIONS[configuration]
    return f"{kind.symbol} = {value:g}{'' if kind.unit == '°' else ' '}{kind.unit}"


def label_of(configuration: str) -> str:
    return f"{CONFIGURATIONS[configuration].symbol} ({CONFIGURATIONS[configuration].unit})"


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


def rotor_scene(
    configuration: str,
    value: float,
    frequency: float = 100.0,
    *,
    drag: bool = True,
    remanence: float = REMANENCE,
    permeability: float = PERMEABILITY,
    floater: Floater = FLOATER,
) -> Scene:
    """A rotor of the article above its `floater`, with Stokes' `drag` or in vacuum, without a plate.

    Of a `configuration` displacement or tilt are the `value` (mm or °), `frequency` in Hz; the cubes' `remanence` in T
    and recoil `permeability`.
    """
    kind = CONFIGURATIONS[configuration]
    magnets = kind.make(kind.scale * value, EDGE, remanence, permeability)
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
    """A `scene` in the field of a `model` to `rtol`, with an `interaction`, its plate left out."""
    return Levitation(scene, Models(model, "none", rtol, interaction=interaction))


def stable_frequencies(scene: Scene, rates: Rates) -> StableRange:
    """Stable frequencies of a rotor, whose motion has these `rates`; EquilibriumError where there are none."""
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
    """A scene with a `plate`, the equilibrium that its currents make of the `start` without, and its table's error.

    By `model` and `rtol` of the plate's currents, from a levitation `alone`. None where there is no equilibrium.
    """
    there = alone.elsewhere(replace(alone.models, plate_model=model, plate_rtol=rtol), plate=plate)
    there.adopt(Survey((start,), ()))
    memory, found = there.plate, there.equilibria
    if memory is None or not found or found[0].currents is None:
        return None
    return there, found[0], max(memory.table.errors.total, memory.share.error)


@dataclass(frozen=True)
class AxialForce:
    """Parts of the magnetic force along the axis, each like the distances: N, attraction upwards positive."""

    attracting: Array  # by the on-axis field, the terms with cos θ
    repelling: Array  # by the rotating field, the terms with sin θ
    polar_angle: Array  # θ of the floater, rad; NaN where the formula has no solution
    side: Array  # radius a of the side mode, m

    @property
    def total(self) -> Array:
        return self.attracting + self.repelling


def side_radius(distance: ArrayLike, frequency: ArrayLike) -> Array:
    """Radius a = 𝒢/(μ_f ω²) of the side mode, m (equation 5)."""
    distance, rate = np.asarray(distance, float), 2 * np.pi * np.asarray(frequency, float)
    return np.asarray(3 * INTERACTION / (distance**4 * FLOATER.mass * rate**2))


def force(configuration: str, value: float, distance: ArrayLike, frequency: float, simple: bool = False) -> AxialForce:
    """Force on the floater by a rotor ("horizontal", "vertical" or "tilt"; mm or degrees) at distances (n,) m.

    At a frequency in Hz, by the semi-analytic form, or by the `simple` one for small angles, which is not for the
    vertical rotor: θ = m_f B⊥/(I ω²), and no side mode in the tilted case.
    """
    d, parameter = np.asarray(distance, float), CONFIGURATIONS[configuration].scale * value
    scale, a = 3 * INTERACTION / d**4, side_radius(d, frequency)
    stiffness = FLOATER.inertia * (2 * np.pi * frequency) ** 2
    if simple:
        angle = INTERACTION / (d**3 * stiffness)
        attracting = {"horizontal": 4 * (parameter - a) / d, "tilt": 2 * parameter + 0 * d}[configuration]
        return AxialForce(scale * attracting, -scale * angle, angle, a if configuration == "horizontal" else 0 * a)
    across, along, with_cosine, with_sine = parts(configuration, value, d, a)
    slack = stiffness - INTERACTION * along
    angle = np.where(slack > 0, INTERACTION * across / np.where(slack > 0, slack, 1.0), np.nan)
    return AxialForce(scale * with_cosine * np.cos(angle), scale * with_sine * np.sin(angle), angle, a)


def parts(configuration: str, value: float, d: Array, a: Array | float) -> Array:
    """B⊥ and B_z by μ0 m_r/4π (1/m³), and the factors of cos θ and sin θ in the force, by 𝒢 (equations 7, 11 and 13).

    Of a rotor (`configuration`, `value`) at distances `d` with radii `a` of the side mode, (n,) m.
    """
    parameter = CONFIGURATIONS[configuration].scale * value

    def cube(angle: float, away: Array, offset: Array | float) -> Array:
        u, cosine, sine = offset / away, np.cos(angle), np.sin(angle)
        field = cosine - 3 * u * (u * cosine - sine), 2 * sine - 3 * u * cosine
        factors = 2 * sine - 4 * u * cosine, (5 * u**2 - 1) * cosine - 4 * u * sine
        return np.array([*(part / away**3 for part in field), *(part * (d / away) ** 4 for part in factors)])

    if configuration == "vertical":  # the second cube's moment points along the axis
        return cube(0.0, d, a) + cube(np.pi / 2, d + parameter, a)
    return cube(0.0, d, a - parameter) if configuration == "horizontal" else cube(parameter, d, a)


def balanced(configuration: str, value: float, frequency: float, load: float) -> tuple[float, float]:
    """Distances (m) of the stable and the farther unstable point at which the semi-analytic force is a load, or NaN.

    Of a rotor (`configuration`, `value`) at a `frequency` (Hz); the `load` is in N.
    """
    grid = np.geomspace(CONTACT, FARTHEST, 600)

    def excess(d: ArrayLike) -> Array:
        return force(configuration, value, d, frequency).total - load

    enough = excess(grid) >= 0
    steps = np.flatnonzero(enough[:-1] != enough[1:])
    roots = [float(scipy.optimize.brentq(excess, grid[k], grid[k + 1])) for k in steps[-2:]]
    stable, unstable = [np.nan, np.nan, *roots][-2:]
    return stable, unstable


def analytic_distance(configuration: str, value: float, frequency: ArrayLike) -> Array:
    """Distance without gravity and for small angles, m: equations 17 and 36 of the supplement; NaN for vertical.

    Of a rotor (`configuration`, `value`) at each `frequency` (n,) Hz.
    """
    rate = 2 * np.pi * np.asarray(frequency, float)
    parameter = CONFIGURATIONS[configuration].scale * value
    angular, linear = INTERACTION / (FLOATER.inertia * rate**2), INTERACTION / (FLOATER.mass * rate**2)
    if configuration == "horizontal":
        half = angular / (8 * parameter)
        return np.asarray(np.sqrt(half + np.sqrt(half**2 + 3 * linear / parameter)))
    return np.asarray(np.cbrt(angular / (2 * parameter))) if configuration == "tilt" else np.full(rate.shape, np.nan)
