"""Between which frequencies of the rotor do flights last, and what ends them above?"""

from dataclasses import dataclass, field, replace

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..branches import FOLD, HIGHEST, LONG_STEPS, LOWEST, BranchPoint, by_frequency, follow_branch
from ..motion import Rates, Scales, rotor_gap
from .averaged import BALANCE, DURATION, E_FOLDS
from .spin_drift import drift

BORDER = "border"
"""The end of what was looked at, where flights still last."""
POINTS = 16
"""Frequencies along the branch at which flights are tried first: what lasts only between two of them is missed."""


@dataclass(frozen=True)
class Lasting:
    """The lowest interval of frequencies in which averaged flights last.

    Parameters
    ----------
    low, high : Hz; NaN where none lasts
    ended_by : what ends flights above `high`, see `averaged.Drift`; or "border" of what was looked at; "" without one
    growth_per_s : largest growth of a small motion during the flight at `high`
    """

    low: float = np.nan
    high: float = np.nan
    ended_by: str = ""
    growth_per_s: float = np.nan


def lasting_frequencies(
    scene: Scene,
    table: FieldTable,
    rates: Rates,
    start: Array,
    frequency: float,
    duration: float = 250.0,
    e_folds: float = E_FOLDS,
    resolution: float = 0.5,
) -> Lasting:
    """Where a floater that is let go with body spin 0 stays up, by its averaged flights along a branch of equilibria.

    A flight is over where a small motion has grown by `e_folds`: seven are 3 µm, what is left of a launch over a plate,
    to 3 mm.  Growth is added up along the drift of the body spin, see `averaged`.

    Parameters
    ----------
    table, rates : of all effects that shall take part
    start : scaled state (12,) of an equilibrium of the branch at `frequency` (Hz)
    duration : s
    resolution : of the two ends, Hz
    """
    flights = _Flights(scene, table, rates, duration, e_folds, _branch(scene, rates, start, frequency))
    ends = flights.known[0].parameter, flights.known[-1].parameter
    grid = [float(at) for at in np.linspace(*ends, POINTS + 2)[1:-1]]
    first = next((at for at in grid if not flights.ended(at)[0]), None)
    if first is None:
        return Lasting()
    low = flights.edge(first, max((at for at in grid if at < first), default=ends[0]), resolution)[0]
    gone = next((at for at in grid if at > first and flights.ended(at)[0]), None)
    last = max(at for at in grid if gone is None or at < gone)
    if gone is None:
        return Lasting(low, ends[1], BORDER, flights.ended(last)[1])
    high, lost = flights.edge(last, gone, resolution)
    return Lasting(low, high, flights.ended(lost)[0], flights.ended(high)[1])


@dataclass(frozen=True, eq=False)
class _Flights:
    """Averaged flights from the equilibria of a branch, of which some are `known`, by ascending frequency."""

    scene: Scene
    table: FieldTable
    rates: Rates
    duration: float
    e_folds: float
    known: list[BranchPoint]
    flown: dict[float, tuple[str, float]] = field(default_factory=dict)

    def ended(self, frequency: float) -> tuple[str, float]:
        """What ends the flight at a frequency (Hz), "" if it lasts; and the largest growth in it, 1/s."""
        if frequency not in self.flown:
            near = min(self.known, key=lambda point: abs(point.parameter - frequency))
            family, there = by_frequency(self.scene, self.rates), replace(self.scene, frequency=frequency)
            point = follow_branch(family, near.state, near.parameter, frequency, LONG_STEPS, tolerated=np.inf)[-1]
            state = Scales.of(there).unpack(point.state)
            flight = drift(there, self.table, 0.0, self.duration, self.rates, state, False, self.e_folds)
            lasts = flight.ended_by in (BALANCE, DURATION) or flight.levitated_s >= self.duration
            self.flown[frequency] = "" if lasts else flight.ended_by, float(flight.growth_per_s.max())
        return self.flown[frequency]

    def edge(self, kept: float, gone: float, resolution: float) -> tuple[float, float]:
        """Between a frequency at which the flight lasts and one at which it does not: the two, nearer to each other."""
        while abs(gone - kept) > resolution:
            middle = (kept + gone) / 2
            kept, gone = (kept, middle) if self.ended(middle)[0] else (middle, gone)
        return kept, gone


def _branch(scene: Scene, rates: Rates, start: Array, frequency: float) -> list[BranchPoint]:
    """The branch of equilibria by ascending frequency, to its fold or contact, or the border of what is looked at."""

    def over(point: BranchPoint) -> bool:
        return point.kind == FOLD or rotor_gap(scene, point.position) < 0

    family, sides = by_frequency(scene, rates), []
    for border in (LOWEST, HIGHEST):
        points = follow_branch(family, start, frequency, border, LONG_STEPS, over, np.inf)
        sides.append(points[: next((k for k, point in enumerate(points) if over(point)), len(points))])
    return [*sides[0][:0:-1], *sides[1]]
