"""The plates and rotors of the study of the plate's damping, and where the floater levitates without a plate."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ...dynamics.branches import StableRange, at_frequency, reference_state, stable_range
from ...dynamics.steady import Equilibrium, EquilibriumError
from ...geometry.basics import Array, Box, rotation_matrix
from ...geometry.scenes import Plate
from ..article import CONFIGURATIONS, PLATE_CONDUCTIVITY, PLATE_SIZE, article_scene, conducting, levitation_of
from ..one_scene import Levitation
from ..terminal import PlateModel

DISTANCE = 0.018
"""Face below or beside the floater's centre in the sweeps over all else, m."""
CONFIGURATION, MEASURE, FREQUENCY = "tilt", 10.0, 130.0
"""The rotor of the sweeps over plates, that of the scene `tilt-over-plate`: tilt in degrees, Hz."""
REAL = (DISTANCE,)
"""Distances of the face at which the real plate, with its edges, is computed beside the infinite slab, m."""
FIELD_RTOL = 1e-4
MIDDLE = 0.5
ROTORS = ("rotors, below", "rotors, beside")
"""Sweeps over the article's rotors."""


@dataclass(frozen=True)
class PlateCase:
    """One plate and rotor.

    Parameters
    ----------
    sweep : what is varied
    value : of that, SI; of a rotor its displacement (mm) or tilt (degrees)
    model : slab or reduced
    upright : beside the floater instead of below it
    distance : of the face from the floater's centre, m
    thickness : m
    conductivity : S/m
    configuration, measure : of the rotor
    part : place of the rotor's frequency in its range of stable frequencies, 0 to 1; None: `FREQUENCY`
    complete : rotor and floater magnetise each other and have eddy currents, in real air; else Stokes drag alone
    """

    sweep: str
    value: float
    model: PlateModel = "slab"
    upright: bool = False
    distance: float = DISTANCE
    thickness: float = PLATE_SIZE[2]
    conductivity: float = PLATE_CONDUCTIVITY
    configuration: str = CONFIGURATION
    measure: float = MEASURE
    part: float | None = None
    complete: bool = False

    def plate(self, place: Array) -> Plate:
        """The plate for a floater at `place` (3,) m."""
        size = np.array([*PLATE_SIZE[:2], self.thickness])
        away = self.distance + self.thickness / 2
        if self.upright:
            center = np.array([away, 0.0, place[2]])
            return Plate(Box(size, center, rotation_matrix((0.0, 90.0, 0.0))), self.conductivity)
        return Plate(Box(size, np.array([0.0, 0.0, place[2] - away])), self.conductivity)


def cases(quick: bool) -> list[PlateCase]:
    """The plates and rotors of the study."""
    few, real = (3, ()) if quick else (10, REAL)
    found = [PlateCase("below", d, distance=d) for d in (*np.geomspace(0.0085, 0.06, few).tolist(), *real)]
    found += [
        PlateCase("beside", d, upright=True, distance=d) for d in (*np.geomspace(0.01, 0.06, few).tolist(), *real)
    ]
    found += [PlateCase("conductivity", s, conductivity=s) for s in np.geomspace(1e6, 6e7, few).tolist()]
    found += [PlateCase("thickness", t, thickness=t) for t in np.geomspace(1e-3, 5e-2, few).tolist()]
    found += [PlateCase("frequency", p, part=p) for p in np.linspace(0.02, 0.98, 2 if quick else 9).tolist()]
    for sweep in ROTORS:
        for name, kind in CONFIGURATIONS.items():
            some = kind.levitated[1:2] if quick else kind.levitated
            beside = sweep == ROTORS[1]
            found += [PlateCase(sweep, m, upright=beside, configuration=name, measure=m, part=MIDDLE) for m in some]
    found += [PlateCase("below, real plate", d, "reduced", distance=d) for d in real]
    found += [PlateCase("beside, real plate", d, "reduced", upright=True, distance=d) for d in real]
    return [replace(case, complete=not quick) for case in found]


@cache
def _in_field(configuration: str, measure: float, complete: bool) -> Levitation:
    """A rotor in air, its field and compiled motion, once for all points that a process computes; without currents."""
    scene = article_scene(configuration, measure, FREQUENCY)
    return levitation_of(scene, "fem", FIELD_RTOL, "auto" if complete else "rigid")


@cache
def _stable_range(configuration: str, measure: float, complete: bool) -> StableRange:
    levitation = _in_field(configuration, measure, complete)
    return stable_range(levitation.scene, levitation.rates, *reference_state(levitation.scene))


def without_plate(case: PlateCase) -> tuple[Levitation, Equilibrium]:
    """A case's scene without plate, and its equilibrium that is stable but for the currents in rotor and floater.

    Raises
    ------
    EquilibriumError : nothing levitates there
    """
    return _without_plate(case.configuration, case.measure, case.part, case.complete)


@cache
def _without_plate(
    configuration: str, measure: float, part: float | None, complete: bool
) -> tuple[Levitation, Equilibrium]:
    alone, frequency = _in_field(configuration, measure, complete), FREQUENCY
    if part is not None:
        stable = _stable_range(configuration, measure, complete)
        frequency = stable.low.parameter + part * (stable.high.parameter - stable.low.parameter)
        near = at_frequency(alone.scene, alone.rates, stable.near(frequency), frequency).distance
    else:
        near = next((e.distance for e in alone.equilibria if e.stable), np.nan)
    levitation = alone.elsewhere(frequency=frequency)
    if complete:
        scene = conducting(levitation.scene)
        whole = Levitation(replace(scene, drag=replace(scene.drag, air=True)), alone.models)
        whole.share(levitation)
        levitation = whole
    known = [e for e in levitation.equilibria if abs(e.distance - near) < 1e-6]
    if not known:
        raise EquilibriumError("There is no stable levitation without the plate.")
    return levitation, known[0]
