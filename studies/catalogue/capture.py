"""Who is caught: floaters let go over the plate in very many ways, until they are held, touch something or are lost.

For each rotor that the article tried, those that did not levitate included, and three of its stable frequencies.
The motion has the plate's currents (infinite slab), the floater's own, and real air; the field is the closed form of
μr = 1 and the floater a rigid dipole.  A floater that is up after a second is held; a few of each fly on while the
plate goes down as in the experiment, which tells how many of these are lost after all.
"""

from collections.abc import Mapping
from itertools import product

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...dynamics.ensembles import Endings, launched
from ...dynamics.flights import DURATION
from ...dynamics.motion import CONTACT, State
from ...dynamics.steady import EquilibriumError
from ...geometry.basics import Array
from ..article import CONFIGURATIONS
from ..results import Point, Study, by_case, one_case, variable
from .capture_figure import FIGURES
from .capture_report import capture_lines, capture_numbers
from .launches import (
    AFTER,
    BELOW,
    LOWERED,
    LOWERING_SPEED,
    SETTLED,
    Launches,
    Place,
    field_of,
    launches,
    place_of,
    plate_under,
    seed_of,
)
from .outcomes import HELD, LOST, NO_EQUILIBRIUM, PLATE, ROTOR

PARTS = (1 / 6, 1 / 2, 5 / 6)
"""Places in the range of stable frequencies."""
TOGETHER, BATCHES = 2000, 5
"""Flights of a point, and points for each rotor and frequency: ten thousand flights."""
QUICK = (("horizontal", 2.0), ("vertical", 14.0), ("tilt", 10.0))
CHECKED = 8
"""Launches of each rotor and frequency that are flown on while the plate goes down."""
FEW = 24
"""Launches of a point in the quick setting."""


def capture_points(quick: bool) -> list[Point]:
    """All rotors and frequencies again and again, a batch of launches each time, so that a stop leaves equal shares."""
    if quick:
        return [_point(*rotor, 0.5, 0, FEW, 0) for rotor in QUICK]
    rotors = [(name, value) for name, kind in CONFIGURATIONS.items() for value in kind.tested]
    return [
        _point(*rotor, part, batch, TOGETHER, CHECKED if batch == 0 else 0)
        for batch, rotor, part in product(range(BATCHES), rotors, PARTS)
    ]


def _point(configuration: str, measure: float, part: float, batch: int, flights: int, checked: int) -> Point:
    return {
        "configuration": configuration, "measure": measure, "part": part,
        "batch": batch, "flights": flights, "checked": checked,
    }  # fmt: skip


def capture(point: Point) -> xr.Dataset:
    """One batch of launches below one rotor.

    Returns
    -------
    Dataset over `flight`: how each was let go, how it ended (see `outcomes`) and when; how many of those that were
    flown on while the plate went down were held first, and to the end.
    """
    rotor = point["configuration"], point["measure"], point["part"]
    try:
        place = place_of(*rotor)
    except EquilibriumError:
        return _row(point, None, None, np.full(point["flights"], NO_EQUILIBRIUM), None, (0, 0))
    begun = launches(place, point["flights"], seed_of(*rotor, point["batch"]))
    ended = launched(place.scene, field_of(place), plate_under(place, place.scene), begun.states, SETTLED)
    outcome = outcomes(place, ended)
    return _row(point, place, begun, outcome, ended, _flown_on(place, begun, point["checked"]))


def outcomes(place: Place, ended: Endings) -> NDArray[np.int_]:
    """What became of each flight (n,), see `outcomes`."""
    found = np.full(len(ended.ended_by), LOST)
    found[ended.ended_by == DURATION] = HELD
    touched = ended.ended_by == CONTACT
    low = ended.last.position[:, 2] < -(place.distance + BELOW) / 2
    found[touched] = np.where(low, PLATE, ROTOR)[touched]
    return found


def _flown_on(place: Place, begun: Launches, count: int) -> tuple[int, int]:
    """Of the first launches, flown with the plate going down after a while: held until then, and to the end."""
    if not count:
        return 0, 0
    starts = State(*(v[:count] for v in begun.states.vectors))
    duration = SETTLED + LOWERED / LOWERING_SPEED + AFTER
    ended = launched(place.lowered, field_of(place), plate_under(place, place.lowered), starts, duration)
    return int(np.sum(ended.levitated_s >= SETTLED)), int(np.sum(ended.ended_by == DURATION))


def _row(
    point: Point,
    place: Place | None,
    begun: Launches | None,
    outcome: NDArray[np.int_],
    ended: Endings | None,
    flown_on: tuple[int, int],
) -> xr.Dataset:
    empty = np.full(point["flights"], np.nan)
    numbers: Mapping[str, tuple[float, str, str]] = {
        "rotor_frequency": (place.scene.frequency if place else np.nan, "Hz", "frequency of the rotor"),
        "distance": (place.distance if place else np.nan, "m", "distance of levitation without a plate"),
        "low": (place.low if place else np.nan, "Hz", "lowest stable frequency without a plate"),
        "high": (place.high if place else np.nan, "Hz", "highest stable frequency without a plate"),
        "part": (point["part"], "1", "place in the range of stable frequencies"),
        "batch": (point["batch"], "1", "number of the batch"),
        "settled": (flown_on[0], "1", "flights that were up when the plate began to go down"),
        "stayed": (flown_on[1], "1", "those of them that were up after it had gone down"),
    }
    columns: Mapping[str, tuple[Array, str, str]] = {
        "farther": (begun.farther if begun else empty, "m", "farther from the rotor than where it levitates"),
        "sideways": (begun.sideways if begun else empty, "m", "beside the axis"),
        "lean": (begun.lean if begun else empty, "rad", "angle of the moment to the axis"),
        "spin": (begun.spin if begun else empty, "1", "spin about the moment over the rotor's"),
        "levitated": (ended.levitated_s if ended else empty, "s", "time until it touched something or was lost"),
        "outcome": (outcome.astype(float), "1", "how it ended"),
        "left_plate_table": (
            ended.left_plate_table.astype(float) if ended else empty,
            "1",
            "whether it went beyond the range of the plate's table, where the plate's field is a continuation",
        ),
    }
    single = {name: variable((), np.array(value), unit, text) for name, (value, unit, text) in numbers.items()}
    flights = {name: variable(("flight",), values, unit, text) for name, (values, unit, text) in columns.items()}
    return one_case(point, xr.Dataset({**single, **flights}))


STUDY = Study(
    name="capture",
    summary="who is caught: floaters let go over the plate in many ways, for every rotor that was tried",
    points=capture_points,
    compute=capture,
    gather=by_case,
    figures=FIGURES,
    report=capture_lines,
    numbers=capture_numbers,
)
