"""The rotors, magnets and ranges of the article whose figures the studies reproduce.

J. M. Hermansen, F. L. Durhuus and R. Bjørk, Appl. Phys. Lett. 127 (2025) 012402.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array
from ...geometry.magnets import Magnet
from ...geometry.rotor import horizontal, tilt, vertical
from ...geometry.scene.contents import Floater

EDGE, REMANENCE, PERMEABILITY = 10e-3, 1.305, 1.05
"""Of the rotor's cubes: m; T, the middle of 1.29 to 1.32; recoil permeability usual for NdFeB, which is not given."""
FLOATER = Floater(6.35e-3, REMANENCE, PERMEABILITY, 7500.0)
WEIGHT = FLOATER.mass * 9.81  # Of the floater, N
PLATE_SIZE, PLATE_CONDUCTIVITY = (0.1, 0.24, 0.03), 3.5e7  # Of the aluminium plate: edges, m; S/m
CONTACT = EDGE / 2 + FLOATER.radius  # Distance on the axis at which floater and a cube that is not tilted touch, m
LOWEST, HIGHEST = 40.0, 250.0
"""Frequencies that are looked at, Hz: the article flew from below 50 Hz to what its motor gave."""
FLIGHT = 250.0  # The longest flight of the experiment, s
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

    def si(self, value: float) -> float:
        """The parameter in SI units."""
        return value * self.scale


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


def stable_in_flight(growth: ArrayLike) -> NDArray[np.bool_]:
    """Where no disturbance grows e-fold within `FLIGHT`; False where there is no equilibrium (NaN)."""
    return np.asarray(np.asarray(growth) <= 1 / FLIGHT)


def polar_angle(moments: Array) -> Array:
    """Angle (...) to the axis, rad, of moments (..., 3)."""
    return np.asarray(np.arctan2(np.hypot(moments[..., 0], moments[..., 1]), moments[..., 2]))
