"""How a floater is brought in: a rotor over its plate, and launches drawn at random."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise, product
from typing import Any
from zlib import crc32

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...dynamics.continuation.frequencies import StableRange, at_frequency, reference_state, stable_range
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...dynamics.flights.batch import Endings, launched
from ...dynamics.flights.trajectory import DURATION
from ...dynamics.motion.events import CONTACT
from ...dynamics.motion.plate import PlateMemory
from ...dynamics.motion.state import State
from ...fem.plate.choice import reachable_region
from ...fem.plate.tables import slab_and_rotor_table
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import Lowering, Plate, Scene
from ...geometry.shapes import Box
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..levitation import sources
from ..result import variable
from ..study import Point, Study, by_case, cases_with, one_case
from .article import (
    CONFIGURATIONS,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    article_scene,
    axis_label,
    conducting,
    levitation_of,
    rotor_label,
)

NEARER, FARTHER, SIDEWAYS = 4e-3, 8e-3, 6e-3
"""From where it would levitate without a plate: so much nearer to the rotor, farther from it, and to the side, m."""
LEAN = np.radians(60.0)
"""Largest angle of the moment to the axis."""
SPIN = 0.2
"""Largest spin about its own moment, over the rotor's."""
SPEED = 0.02
"""Standard deviation of each component of the velocity with which a hand lets go, m/s."""
BELOW = 0.018
"""Face of the plate below where the floater levitates without it, m: 35 mm below the rotor is 10 to 20 of these."""
SETTLED, LOWERED, LOWERING_SPEED, AFTER = 1.0, 0.055, 0.01, 1.0
"""The plate goes down after (s), by (m), at (m/s: the article's), and the flight goes on for (s)."""
PLATE_RTOL = 1e-2
"""Of the plate's tables: capture is decided by the field's attraction, the plate only brakes."""


@dataclass(frozen=True, eq=False)
class Place:
    """A rotor at one frequency, and where the floater would levitate without a plate.

    Parameters
    ----------
    scene : with the plate, which stays
    distance : of the floater from the rotor's origin, m
    low, high : ends of the stable frequencies without a plate, Hz
    """

    scene: Scene
    distance: float
    low: float
    high: float

    @cached_property
    def lowered(self) -> Scene:
        """The scene whose plate goes down once the floater has settled."""
        assert self.scene.plate is not None
        return replace(self.scene, plate=replace(self.scene.plate, lowering=Lowering(SETTLED, LOWERING_SPEED, LOWERED)))


@cache
def place_of(configuration: str, measure: float, part: float) -> Place:
    """A rotor of the article at a `part` (0 to 1) of its stable frequencies; floater and air as they are.

    Field: closed form, μr = 1, which the ranges of frequencies are of as well.

    Raises
    ------
    EquilibriumError : it levitates stably at no frequency
    """
    scene = article_scene(configuration, measure, permeability=1.0)
    rates = levitation_of(scene, "cuboid").rates
    stable: StableRange = stable_range(scene, rates, *reference_state(scene))
    low, high = stable.low.parameter, stable.high.parameter
    frequency = low + part * (high - low)
    distance = at_frequency(scene, rates, stable.near(frequency), frequency).distance
    center = np.array([0.0, 0.0, -distance - BELOW - PLATE_SIZE[2] / 2])
    plate = Plate(Box(np.array(PLATE_SIZE), center), PLATE_CONDUCTIVITY)
    whole = conducting(replace(scene, frequency=frequency, drag=replace(scene.drag, air=True)), rotor=False)
    return Place(replace(whole, plate=plate), distance, low, high)


@cache
def plate_under(place: Place, scene: Scene) -> PlateMemory:
    """The currents in the plate of a place's scene, taken as an infinite slab, wherever launches begin."""
    plate = scene.plate
    assert plate is not None
    middle = np.array([0.0, 0.0, -place.distance - (FARTHER - NEARER) / 2])
    half = [SIDEWAYS, SIDEWAYS, (FARTHER + NEARER) / 2]
    region = reachable_region(plate, middle, half, scene.floater.radius)
    frequencies = (0.5, max(250.0, 2 * scene.frequency))
    rotor = sources(levitation_of(replace(scene, plate=None), "cuboid").table)
    table, share = slab_and_rotor_table(plate, rotor, region, frequencies, PLATE_RTOL)
    return PlateMemory(plate, table, share, "slab")


@cache
def field_of(place: Place, model: str = "cuboid") -> FieldTable:
    """The rotor's field."""
    return levitation_of(replace(place.scene, plate=None), model).table  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Launches:
    """How n floaters are let go.

    Parameters
    ----------
    farther : (n,) from the rotor than where it levitates, m
    sideways : (n,) m
    lean : (n,) angle of the moment to the axis, rad
    spin : (n,) about the moment, over the rotor's
    states : (n, 3) at t = 0, along the rotor's axes
    """

    farther: Array
    sideways: Array
    lean: Array
    spin: Array
    states: State


def launches(place: Place, count: int, seed: list[int]) -> Launches:
    """Launches drawn evenly over heights, a disc, a cap of directions and spins; let go with a hand's speed.

    The same seed gives the same launches, to the last bit.
    """
    draws = np.random.default_rng(seed)
    height, area, cap, along = draws.uniform(size=(4, count))
    place_angle, moment_angle = draws.uniform(0, 2 * np.pi, (2, count))
    velocity = draws.normal(0, SPEED, (count, 3))
    farther = -NEARER + (NEARER + FARTHER) * height
    sideways, spin = SIDEWAYS * np.sqrt(area), SPIN * (2 * along - 1)
    cosine = 1 - (1 - np.cos(LEAN)) * cap
    sine = np.sqrt(1 - cosine**2)
    position = _stacked(sideways * np.cos(place_angle), sideways * np.sin(place_angle), -place.distance - farther)
    moment = _stacked(sine * np.cos(moment_angle), sine * np.sin(moment_angle), cosine)
    turning = (spin * place.scene.angular_velocity)[:, None] * moment
    return Launches(farther, sideways, np.arccos(cosine), spin, State(position, velocity, moment, turning))


def seed_of(configuration: str, measure: float, part: float, batch: int) -> list[int]:
    """A seed of its own for each batch of launches."""
    return [crc32(f"{configuration} {measure:g} {part:.6f}".encode()), batch]


def _stacked(*columns: Array) -> Array:
    return np.stack(columns, axis=-1)


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


SHOWN = (("horizontal", 2.0), ("vertical", 14.0), ("vertical", 18.0), ("tilt", 10.0))
"""Rotors of which it is drawn from where they catch."""
BINS = 12


@styled
def share_figure(result: xr.Dataset) -> Figure:
    """The share that is held against each configuration's displacement or tilt, at each part of its frequencies."""
    known = list(rotors_of(result))
    names = [name for name in CONFIGURATIONS if any(name == configuration for configuration, _, _ in known)]
    figure, (axes,) = panels(1, len(names), (PAGE, 2.7), sharey=True)
    for panel, name in zip(axes, names, strict=True):
        rows = [(measure, parts) for configuration, measure, parts in known if configuration == name]
        for k in range(max(len(parts) for _, parts in rows)):
            there = [(measure, parts[k].held) for measure, parts in rows if k < len(parts)]
            values = np.array([share.value for _, share in there])
            around = np.array([share.bounds for _, share in there])
            bars = np.maximum(np.stack([values - around[:, 0], around[:, 1] - values]), 0)
            label = f"{rows[0][1][k].part:.0%} of the stable range"
            panel.errorbar([m for m, _ in there], 100 * values, 100 * bars, fmt="o-", color=PALETTE[k], label=label)
        for measure in CONFIGURATIONS[name].levitated:
            panel.axvline(measure, color="0.85", lw=4, zorder=0)
        panel.set(xlabel=axis_label(name), ylim=(-2, 102))
    axes[0].set_ylabel("launches that are held (%)")
    legend_below(figure, axes[0])
    return figure


@styled
def place_figure(result: xr.Dataset) -> Figure:
    """From where floaters are caught: the share over height and distance from the axis, and over the moment's angle."""
    found = {(c, m): parts for c, m, parts in rotors_of(result)}
    chosen = [parts[len(parts) // 2] for key in SHOWN if (parts := found.get(key))]
    figure, (maps, leans) = panels(2, len(chosen), (PAGE, 4.6), sharey="row")
    for top, bottom, caught in zip(maps, leans, chosen, strict=True):
        _map(top, caught)
        _lean(bottom, caught)
        top.set_title(f"{rotor_label(caught.configuration, caught.measure)}, {caught.frequency:.0f} Hz")
    maps[0].set_ylabel("farther from the rotor (mm)")
    maps[0].invert_yaxis()  # shared by all
    leans[0].set_ylabel("held (%)")
    return figure


FIGURES = {"capture": share_figure, "capture-from-where": place_figure}


def _map(axes: Axes, caught: Caught) -> None:
    """Held (blue) and not held (red) launches; of each place the mean over all directions of the moment."""
    side, height = np.linspace(0, SIDEWAYS, 5), np.linspace(-NEARER, FARTHER, 9)
    at = caught.flights["sideways"].values, caught.flights["farther"].values
    held = caught.flights["outcome"].values == HELD
    every = np.histogram2d(*at, bins=(side, height))[0]
    some = np.histogram2d(at[0][held], at[1][held], bins=(side, height))[0]
    share = np.divide(100 * some, every, out=np.full_like(every, np.nan), where=every > 0)
    drawn = axes.pcolormesh(1e3 * side, 1e3 * height, share.T, vmin=0, vmax=100, cmap="RdYlBu")
    axes.set_xlabel("beside the axis (mm)")
    axes.figure.colorbar(drawn, ax=axes, label="held (%)")


def _lean(axes: Axes, caught: Caught) -> None:
    """The share against the moment's angle to the axis."""
    edges = np.degrees(np.linspace(0, LEAN, BINS // 2 + 1))
    angle, held = np.degrees(caught.flights["lean"].values), caught.flights["outcome"].values == HELD
    inside = [(angle >= a) & (angle < b) for a, b in pairwise(edges)]
    shares = [Share(int(held[k].sum()), int(k.sum())) for k in inside]
    values, bars = [100 * s.value for s in shares], [100 * s.error for s in shares]
    axes.errorbar((edges[1:] + edges[:-1]) / 2, values, bars, fmt="o-", color=PALETTE[0])
    axes.set(xlabel="moment to the axis (°)", ylim=(-2, 102))


def capture_lines(result: xr.Dataset) -> list[str]:
    """The share that is held of each rotor and frequency, and what became of the others."""
    lines, every = [], []
    for configuration, measure, parts in rotors_of(result):
        levitated = measure in CONFIGURATIONS[configuration].levitated
        told = "levitated in the article" if levitated else "did NOT levitate in the article"
        for caught in parts:
            lines.append(f"{rotor_label(configuration, measure)} ({told}), {_line(caught)}")
        every += parts
    flown = sum(int(np.isfinite(c.flights["left_plate_table"]).sum()) for c in every)
    beyond = [sum(int(_beyond(c)[_held(c) == held].sum()) for c in every) for held in (True, False)]
    if sum(beyond):
        lines.append(
            f"{sum(beyond)} of {flown} flights, {beyond[0]} of them held, were for a while beyond the range of the "
            "plate's table, where the field of its currents is a continuation of unknown error."
        )
    settled, stayed = sum(c.settled for c in every), sum(c.stayed for c in every)
    if settled:
        gone = Share(settled - stayed, settled)
        lines.append(
            f"Of {settled} flights that were up when the plate began to go down (10 mm/s over 55 mm), {stayed} were "
            f"still up at the end: {gone} of what is called held is lost after all."
        )
    return lines


def _beyond(caught: Caught) -> Array:
    return np.asarray(caught.flights["left_plate_table"].values == 1)


def _held(caught: Caught) -> Array:
    return np.asarray(caught.flights["outcome"].values == HELD)


def _line(caught: Caught) -> str:
    if caught.share(NO_EQUILIBRIUM) == 1:
        return "no stable frequency is found: none can be held."
    others = [(caught.share(k), k) for k in range(len(WORDS)) if k != HELD]
    rest = ", ".join(f"{100 * share:.0f} % {WORDS[k]}" for share, k in sorted(others, reverse=True) if share > 0)
    after = f"; the plate lowered: {caught.stayed} of {caught.settled} stay" if caught.settled else ""
    return f"{caught.frequency:.1f} Hz: {caught.held} of {caught.held.trials} launches are held; {rest}{after}."


def capture_numbers(result: xr.Dataset) -> dict[str, Any]:
    """The shares as numbers: `shares`, one entry for each rotor and frequency; and what the plate's lowering loses."""
    rows, settled, stayed = [], 0, 0
    for configuration, measure, parts in rotors_of(result):
        for caught in parts:
            settled, stayed = settled + caught.settled, stayed + caught.stayed
            rows.append({
                "configuration": configuration,
                "value": measure,
                "levitated_in_article": measure in CONFIGURATIONS[configuration].levitated,
                "frequency_hz": None if np.isnan(caught.frequency) else caught.frequency,
                "flights": caught.held.trials,
                "held": caught.held.value,
                "held_error": caught.held.error,
                "left_plate_table": float(np.mean(_beyond(caught))),
                **{WORDS[k].replace(" ", "_"): caught.share(k) for k in range(1, len(WORDS))},
            })  # fmt: skip
    return {"shares": rows, "flown_on": settled, "stayed_up": stayed}


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
