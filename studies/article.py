"""The rotors, magnets and ranges of the article whose figures the studies reproduce.

J. M. Hermansen, F. L. Durhuus and R. Bjørk, Appl. Phys. Lett. 127 (2025) 012402.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ..fem.cache import cached_rotor_table
from ..fem.models import rotor_table
from ..fem.table import RotorTable
from ..geometry import rotor
from ..geometry.scene import Drag, Floater, Scene
from .console import note
from .study import Point

EDGE, REMANENCE, PERMEABILITY = 10e-3, 1.305, 1.05
"""Of the rotor's cubes: m; T, the middle of 1.29 to 1.32; recoil permeability usual for NdFeB, which is not given."""
FLOATER = Floater(6.35e-3, REMANENCE, PERMEABILITY, 7500.0)
CONTACT = EDGE / 2 + FLOATER.radius
"""Distance on the axis at which floater and a cube that is not tilted touch, m."""
LOWEST, HIGHEST = 40.0, 250.0
"""Frequencies that are looked at, Hz: the article flew from below 50 Hz to what its motor gave."""
FLIGHT = 250.0
"""The longest flight of the experiment, s."""
RTOL = 1e-4
"""Relative accuracy of B asked of the finite elements, from contact on: it moves the equilibria by less than 1 µm."""
MODELS = ("dipole", "fem")


@dataclass(frozen=True)
class Configuration:
    """One of the article's three rotors.

    Parameters
    ----------
    make : maker of its magnets, from the parameter in SI units
    symbol, unit, scale : of the parameter, its unit, and that in SI
    tested : values of the parameter that the article tried, in its unit
    levitated : those of them that levitated in the experiment
    """

    make: Callable[..., rotor.Rotor]
    symbol: str
    unit: str
    scale: float
    tested: tuple[float, ...]
    levitated: tuple[float, ...]

    def si(self, value: float) -> float:
        """The parameter in SI units."""
        return value * self.scale


CONFIGURATIONS = {
    "horizontal": Configuration(
        rotor.horizontal, "δx", "mm", 1e-3, tuple(float(x) for x in range(1, 9)), (1.0, 2.0, 3.0, 4.0)
    ),
    "vertical": Configuration(
        rotor.vertical, "δz", "mm", 1e-3, (10.0, 12.0, 14.0, 16.0, 18.0, 20.0), (10.0, 12.0, 14.0, 16.0)
    ),
    "tilt": Configuration(
        rotor.tilt, "δθ", "°", np.pi / 180, tuple(float(x) for x in range(5, 50, 5)), (5.0, 10.0, 15.0, 20.0)
    ),
}


def article_scene(configuration: str, value: float, frequency: float, drag: bool = True) -> Scene:
    """A rotor of the article above its floater, in air unless `drag` is off; `value` in the configuration's unit."""
    kind = CONFIGURATIONS[configuration]
    magnets = kind.make(kind.si(value), EDGE, REMANENCE, PERMEABILITY)
    return Scene(frequency, magnets, FLOATER, Drag.stokes(FLOATER.radius) if drag else Drag(0.0, 0.0))


def article_table(scene: Scene, model: str) -> RotorTable:
    """The field of a scene's rotor; finite elements from the cache if they are there."""
    if model != "fem":
        return rotor_table(scene.rotor, model, RTOL, FLOATER.radius)
    return cached_rotor_table(scene.rotor, model, RTOL, note, FLOATER.radius)[0]


def label(configuration: str, value: float) -> str:
    """A rotor's parameter with its symbol and unit."""
    kind = CONFIGURATIONS[configuration]
    return f"{kind.symbol} = {value:g}{'' if kind.unit == '°' else ' '}{kind.unit}"


def stable(growth: ArrayLike) -> NDArray[np.bool_]:
    """Where no disturbance grows e-fold within `FLIGHT`; False where there is no equilibrium (NaN)."""
    return np.asarray(np.asarray(growth) <= 1 / FLIGHT)


def one_case(point: Point, dataset: xr.Dataset) -> xr.Dataset:
    """A point's result with what tells it from the others (texts and numbers), ready to be joined along `case`."""
    labels = {name: xr.Variable((), point[name]) for name in ("configuration", "value", "model")}
    return dataset.assign(labels).expand_dims("case")


def chosen(result: xr.Dataset, **labels: object) -> xr.Dataset:
    """The cases of a joined result with the given labels."""
    found = np.ones(result.sizes["case"], bool)
    for name, wanted in labels.items():
        found &= result[name].values == wanted
    return result.isel(case=np.flatnonzero(found))
