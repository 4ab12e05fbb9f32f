"""The rotors whose drift is studied, and what is not known of the experiment."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics.slow_drift import E_FOLDS
from ...geometry.basics import MAGNET_CONDUCTIVITY
from ...geometry.bodies import Magnet, horizontal, tilt, vertical
from ...geometry.scenes import Drag, Floater, Scene


@dataclass(frozen=True)
class DriftCase:
    """One rotor: a maker of magnets, its displacement and what may be wrong with it (m or rad), and frequencies, Hz.

    At `reference` it has an equilibrium for all variants; `lowest` and `highest` bound what is asked.
    """

    make: Callable[..., tuple[Magnet, ...]]
    size: float
    tolerance: float
    reference: float
    lowest: float
    highest: float


CASES = {
    "horizontal 1 mm": DriftCase(horizontal, 1e-3, 0.2e-3, 215.0, 110.0, 250.0),
    "vertical 14 mm": DriftCase(vertical, 14e-3, 0.5e-3, 78.0, 58.0, 93.0),
    "horizontal 1.5 mm": DriftCase(horizontal, 1.5e-3, 0.2e-3, 160.0, 95.0, 220.0),
    "vertical 12.6 mm": DriftCase(vertical, 12.6e-3, 0.5e-3, 70.0, 51.0, 86.0),
    "horizontal 2 mm": DriftCase(horizontal, 2e-3, 0.2e-3, 130.0, 80.0, 195.0),
    "vertical 16 mm": DriftCase(vertical, 16e-3, 0.5e-3, 95.0, 68.0, 110.0),
    "tilt 5 deg": DriftCase(tilt, np.radians(5), np.radians(0.5), 185.0, 130.0, 250.0),
    "tilt 10 deg": DriftCase(tilt, np.radians(10), np.radians(0.5), 110.0, 75.0, 180.0),
}
"""Rotors of the article, and two whose displacement is chosen so that they fly where the article's did."""
QUICK = ("horizontal 1 mm", "vertical 14 mm")
OUTCOMES = ("contact", "fold", "instability", "levitates", "no equilibrium")
"""How a flight may end."""
LEVITATES, NO_EQUILIBRIUM = 3, 4
"""Numbers of two of these."""


@dataclass(frozen=True)
class Variant:
    """What is not known of the experiment.

    Parameters
    ----------
    spin : at release
    remanence : of all magnets, T
    conductivity : of the floater, S/m
    stokes : whether the air's drag is Stokes's
    e_folds : growth of an oscillation that ends the flight
    misplaced : error of the rotor's displacement, in units of its tolerance
    rotor : "rigid": closed form of μr = 1, and no answers; "permeable": by finite elements with μr = 1.05, rotor and
        floater magnetise each other; "conducting": and there are eddy currents in the rotor's magnets
    """

    spin: float = 0.0
    remanence: float = 1.305
    conductivity: float = MAGNET_CONDUCTIVITY
    stokes: bool = False
    e_folds: float = E_FOLDS
    misplaced: float = 0.0
    rotor: str = "rigid"


VARIANTS = {
    "nominal": Variant(),
    "spin -0.1": Variant(spin=-0.1),
    "spin +0.1": Variant(spin=0.1),
    "remanence 1.29 T": Variant(remanence=1.29),
    "remanence 1.32 T": Variant(remanence=1.32),
    "displacement smaller": Variant(misplaced=-1.0),
    "displacement larger": Variant(misplaced=1.0),
    "conductivity -20 %": Variant(conductivity=0.8 * MAGNET_CONDUCTIVITY),
    "conductivity +80 %": Variant(conductivity=1.8 * MAGNET_CONDUCTIVITY),
    "rough release": Variant(e_folds=np.log(30.0)),
    "Stokes drag": Variant(stokes=True),
    "permeable": Variant(rotor="permeable"),
    "complete": Variant(rotor="conducting"),
}
"""Conductivity: makers' values; upwards a plating of nickel and copper, and the field's gradient (`SlowTorque`)."""
QUICK_VARIANTS = ("nominal", "spin -0.1", "spin +0.1", "displacement smaller", "displacement larger", "Stokes drag")


def scene_of(case: DriftCase, variant: Variant) -> Scene:
    """The scene of a case at its reference frequency."""
    floater = Floater(6.35e-3, variant.remanence, 1.05, 7500.0, variant.conductivity)
    permeability, metal = 1.0 if variant.rotor == "rigid" else 1.05, variant.rotor == "conducting"
    magnets = case.make(case.size + variant.misplaced * case.tolerance, 10e-3, variant.remanence, permeability)
    magnets = tuple(replace(magnet, conductivity=MAGNET_CONDUCTIVITY if metal else None) for magnet in magnets)
    return Scene(case.reference, magnets, floater, Drag.stokes(floater.radius))
