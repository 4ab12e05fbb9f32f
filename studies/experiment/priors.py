"""What is not known of the experiment, and how well it is known beforehand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ...geometry.basics import Array

EVEN, NORMAL, POSITIVE = "even", "normal", "positive"
"""Kinds of priors: even between two ends; normal with mean and deviation; logarithm normal, by median and deviation."""


@dataclass(frozen=True)
class Unknown:
    """One number that is not known.

    Parameters
    ----------
    name, unit, symbol : its name in results, its unit, and what figures call it
    prior : kind
    first, second : ends; mean and deviation; or median and deviation of the logarithm
    why : where the range comes from
    """

    name: str
    unit: str
    symbol: str
    prior: str
    first: float
    second: float
    why: str

    def at(self, share: Array) -> Array:
        """The value below which a share (n,) of the prior lies."""
        if self.prior == EVEN:
            return np.asarray(self.first + (self.second - self.first) * share)
        deviates = ndtri(share)
        if self.prior == NORMAL:
            return np.asarray(self.first + self.second * deviates)
        return np.asarray(self.first * np.exp(self.second * deviates))


UNKNOWNS = (
    Unknown("displacement", "mm", "δx", NORMAL, 1.0, 0.3, "1 mm stated; 'sub-millimeter precision is required'"),
    Unknown("tilt", "deg", "tilt of δx", NORMAL, 0.0, 2.0, "printed holder, glue, and magnetisation against the cube"),
    Unknown("direction", "deg", "direction", NORMAL, 0.0, 10.0, "of the displacement against the magnetisation"),
    Unknown("stack", "mm", "δz", NORMAL, 14.0, 0.3, "14 mm stated, as δx"),
    Unknown("stack_displacement", "mm", "δx of δz", NORMAL, 0.0, 0.3, "of the lower cube, as δx"),
    Unknown("stack_tilt", "deg", "tilt of δz", NORMAL, 0.0, 2.0, "of the lower cube, as that of δx"),
    Unknown("rotor_remanence", "T", "Br rotor", EVEN, 1.29, 1.32, "stated"),
    Unknown("floater_remanence", "T", "Br floater", EVEN, 1.29, 1.32, "stated: identical to the rotor's"),
    Unknown("density", "kg/m3", "density", NORMAL, 7500.0, 75.0, "makers: 7400 to 7600"),
    Unknown("edge", "mm", "edge", NORMAL, 10.0, 0.05, "makers: 0.1 mm"),
    Unknown("diameter", "mm", "diameter", NORMAL, 12.7, 0.05, "makers: 0.1 mm"),
    Unknown("magnets", "S/m", "σ magnets", POSITIVE, 6.7e5, 0.15, "makers: 6.2e5 to 9e5"),
    Unknown(
        "floater", "1", "plating", POSITIVE, 1.2, 0.15, "of the floater's currents: copper and nickel add up to a half"
    ),
    Unknown("steel", "1", "steel", POSITIVE, 1.0, 1.0, "its losses over those of the balancing block: amount unknown"),
    Unknown("motion", "um", "motion", POSITIVE, 5.0, 1.2, "left of the launch when the plate is down: 1 to 100 µm"),
    Unknown("spin", "1", "spin", NORMAL, 0.02, 0.05, "at release: 0 to 0.05 in settling over the plate"),
    Unknown(
        "tilt_10", "deg", "tilt at 10 mm", NORMAL, 0.0, 2.5, "of the stack of 10 mm, displacement and tilt together"
    ),
    Unknown("tilt_18", "deg", "tilt at 18 mm", NORMAL, 0.0, 2.5, "of that of 18 mm"),
    Unknown("tilt_20", "deg", "tilt at 20 mm", NORMAL, 0.0, 2.5, "of that of 20 mm"),
    Unknown("lean", "deg", "lean", NORMAL, 0.0, 3.0, "of the shaft"),
)
NAMES = tuple(unknown.name for unknown in UNKNOWNS)


def drawn(shares: Array, unknowns: Sequence[Unknown] = UNKNOWNS) -> dict[str, Array]:
    """Values (n,) by name at points (n, unknown) of the unit cube."""
    return {unknown.name: unknown.at(shares[:, k]) for k, unknown in enumerate(unknowns)}


def likeness(values: Mapping[str, Array]) -> dict[str, Array]:
    """By what a scene is like one of the surrogate's (`dynamics.motion.likeness`), each (n,).

    With p = Br Br'/ρ over the article's and lengths over the edge, frequencies times the edge over √p, gravity times
    the edge over p and all displacements over the edge tell the motion; losses go as conductivity times Br² over ρ.
    """
    edge = values["edge"] / 10.0
    rotor, floater = values["rotor_remanence"] / 1.305, values["floater_remanence"] / 1.305
    density, radius = values["density"] / 7500.0, values["diameter"] / 12.7
    strength = rotor * floater / density
    return {
        "edge": edge,
        "frequency": edge / np.sqrt(strength),
        "weight": np.cos(np.radians(values["lean"])) * edge / strength,
        "radius": radius / edge,
        "floater": values["floater"] * values["magnets"] / 6.7e5 * rotor**2 / density,
        "magnets": values["magnets"] / 6.7e5 * floater**2 / density,
        "steel": values["steel"] * floater**2 / density,
        "air": 1 / (density * radius**2),
    }
