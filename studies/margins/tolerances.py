"""What is not known exactly of a rotor and its floater, and what they do with other values of it."""

from dataclasses import dataclass, replace

import numpy as np

from ...dynamics.branches import (
    HIGHEST,
    LONG_STEPS,
    LOWEST,
    StableRange,
    at_frequency,
    by_frequency,
    reference_state,
    stability_end,
    stable_range,
)
from ...dynamics.steady import EquilibriumError
from ...geometry.basics import Array
from ...geometry.scenes import Floater, Scene
from ..article import article_scene, levitation_of
from ..terminal import FieldModel

MODEL: FieldModel = "cuboid"
FRACTIONS = (0.1, 0.5, 0.9)
"""Places in the range of stable frequencies at which the distance is asked for."""


@dataclass(frozen=True)
class Known:
    """A parameter as it is known: its nominal value and realistic tolerance, both in `unit`.

    `spread` is half the width of an even distribution, or the standard deviation of a normal one.
    """

    nominal: float
    unit: str
    spread: float
    normal: bool = False


PARAMETERS = {
    "measure": Known(np.nan, "mm or °", 0.1, True),
    "rotor_remanence": Known(1.305, "T", 0.015),
    "floater_remanence": Known(1.305, "T", 0.015),
    "density": Known(7500.0, "kg/m³", 100.0),
    "edge": Known(10e-3, "m", 0.1e-3),
    "diameter": Known(12.7e-3, "m", 0.05e-3),
    "gravity": Known(9.81, "m/s²", 0.0),
    "frequency": Known(np.nan, "Hz", 0.5, True),
}
"""Remanence: the article's 1.29 to 1.32 T. Size: what makers of magnets give. Place of the cube: 0.1 mm, tilt 0.5°."""
TILT_SPREAD = 0.5
TILTS = (1.0, 2.0)
"""Of the axis from the vertical, degrees."""
QUANTITIES = ("lowest", "highest", *(f"distance at {f:.0%}" for f in FRACTIONS))
PLACE = "frequency"


@dataclass(frozen=True, eq=False)
class Nominal:
    """What one rotor does with all parameters as they should be.

    Parameters
    ----------
    configuration, measure : of the rotor
    model : of its field
    values : of the parameters
    range : its stable frequencies
    """

    configuration: str
    measure: float
    model: FieldModel
    values: dict[str, float]
    range: StableRange

    @property
    def grid(self) -> Array:
        """Frequencies at which the distance is asked for, Hz."""
        low, high = self.range.low.parameter, self.range.high.parameter
        return low + (high - low) * np.array(FRACTIONS)


def scene_of(configuration: str, values: dict[str, float], frequency: float = 100.0) -> Scene:
    """The scene with all parameters given."""
    floater = Floater(values["diameter"] / 2, values["floater_remanence"], 1.05, values["density"])
    scene = article_scene(
        configuration, values["measure"], frequency, drag=False,
        edge=values["edge"], remanence=values["rotor_remanence"], permeability=1.0, floater=floater,
    )  # fmt: skip
    return replace(scene, gravity=np.array([0.0, 0.0, -values["gravity"]]))


def nominal(configuration: str, measure: float, model: FieldModel = MODEL) -> Nominal:
    """The rotor as it should be. Raises EquilibriumError where it does not levitate."""
    values = {name: known.nominal for name, known in PARAMETERS.items() if name != PLACE} | {"measure": measure}
    scene = scene_of(configuration, values)
    found = stable_range(scene, levitation_of(scene, model).rates, *reference_state(scene))
    return Nominal(configuration, measure, model, values, found)


def levitation(base: Nominal, values: dict[str, float], shift: float = 0.0) -> Array:
    """Lowest and highest frequency (Hz) and the distances (m) with other values of the parameters; NaN where none.

    Parameters
    ----------
    shift : of the frequencies at which the distance is asked for, Hz
    """
    scene = scene_of(base.configuration, values)
    rates = levitation_of(scene, base.model).rates
    middle = base.range.near(base.grid[1])
    family = by_frequency(scene, rates)
    row = np.full(len(QUANTITIES), np.nan)
    try:
        ends = [
            stability_end(scene, family, middle.state, middle.parameter, end, LONG_STEPS) for end in (LOWEST, HIGHEST)
        ]
    except EquilibriumError:
        return row
    row[:2] = [end.parameter for end in ends]
    for k, frequency in enumerate(base.grid + shift, 2):
        if row[0] < frequency < row[1]:
            row[k] = at_frequency(scene, rates, middle, float(frequency), LONG_STEPS).distance
    return row
