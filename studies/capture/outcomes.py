"""How launches end, as numbers in a result, and shares of many with their errors."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..article import CONFIGURATIONS
from ..results import cases_with

HELD, PLATE, ROTOR, LOST, NO_EQUILIBRIUM = range(5)
"""Up at the end; touched the plate; touched the rotor; far away; never flown, as no frequency is stable."""
WORDS = ("held", "touched the plate", "touched the rotor", "lost to the side", "no stable frequency")


@dataclass(frozen=True)
class Share:
    """A share of n trials with its binomial error (E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209, one sigma)."""

    hits: int
    trials: int

    @property
    def value(self) -> float:
        """The share itself; NaN of no trial."""
        return self.hits / self.trials if self.trials else np.nan

    @property
    def bounds(self) -> tuple[float, float]:
        """Ends of Wilson's interval of one standard deviation."""
        if not self.trials:
            return np.nan, np.nan
        n, p = self.trials, self.value
        middle, half = (p + 0.5 / n) / (1 + 1 / n), np.sqrt(p * (1 - p) / n + 0.25 / n**2) / (1 + 1 / n)
        return max(0.0, middle - half), min(1.0, middle + half)

    @property
    def error(self) -> float:
        """Half of the interval."""
        low, high = self.bounds
        return (high - low) / 2

    def __str__(self) -> str:
        digits = max(1, math.ceil(-math.log10(100 * self.error))) if self.trials else 1
        return f"{100 * self.value:.{digits}f} ± {100 * self.error:.{digits}f} %"


@dataclass(frozen=True, eq=False)
class Caught:
    """One rotor at one frequency: all of its launches.

    Parameters
    ----------
    configuration, measure, part : of the rotor and of its range of stable frequencies
    frequency : Hz, NaN where none is stable
    flights : outcome and how each was let go, over `flight`
    settled, stayed : of those flown on while the plate went down: up before, and after
    """

    configuration: str
    measure: float
    part: float
    frequency: float
    flights: xr.Dataset
    settled: int
    stayed: int

    @property
    def held(self) -> Share:
        """Share of launches that are held."""
        outcome = self.flights["outcome"].values
        return Share(int(np.sum(outcome == HELD)), len(outcome))

    def share(self, outcome: int) -> float:
        """Share of launches that ended so."""
        return float(np.mean(self.flights["outcome"].values == outcome))


def rotors_of(result: xr.Dataset) -> Iterator[tuple[str, float, list[Caught]]]:
    """Each rotor of a joined result with its frequencies, their batches put together."""
    for configuration in CONFIGURATIONS:
        some = cases_with(result, configuration=configuration)
        for measure in np.unique(some["measure"].values):
            here = cases_with(some, measure=measure)
            parts = [cases_with(here, part=part) for part in np.unique(here["part"].values)]
            yield configuration, float(measure), [_caught(part) for part in parts]


def _caught(part: xr.Dataset) -> Caught:
    names = ("outcome", "farther", "sideways", "lean", "spin", "levitated", "left_plate_table")
    whole = part[list(names)].drop_vars(["configuration", "measure"], errors="ignore")
    flights = whole.stack(every=("case", "flight"), create_index=False).rename(every="flight")
    flights = flights.isel(flight=np.flatnonzero(np.isfinite(flights["outcome"].values)))
    first = part.isel(case=0)
    return Caught(
        str(first["configuration"].values), float(first["measure"]), float(first["part"]),
        float(first["rotor_frequency"]), flights, int(part["settled"].sum()), int(part["stayed"].sum()),
    )  # fmt: skip
