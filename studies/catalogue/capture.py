"""Which floaters are captured: launches drawn at random over the plate of every rotor that was tried."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from typing import Any
from zlib import crc32

import numpy as np
import scipy
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
from ..result import Columns, columns
from ..scene_tables import sources
from ..study import Point, Study, cases_with, one_case
from .article import (
    CONFIGURATIONS,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    QUICK_ROTORS,
    article_scene,
    conducting,
    label_of,
    levitation_of,
    rotor_label,
)
from .drawing import by_configuration, configuration_panels, text_table

NEARER, FARTHER, SIDEWAYS = 4e-3, 8e-3, 6e-3
"""From where it would levitate without a plate: so much nearer to the rotor, farther from it, and to the side, m."""
LEAN = np.radians(60.0)  # Largest angle of the moment to the axis
SPIN = 0.2  # Largest spin about its own moment, over the rotor's
SPEED = 0.02  # Standard deviation of each component of the velocity with which a hand lets go, m/s
BELOW = 0.018
"""Face of the plate below where the floater levitates without it, m: 35 mm below the rotor is 10 to 20 of these."""
SETTLED, LOWERED, LOWERING_SPEED, AFTER = 1.0, 0.055, 0.01, 1.0
"""The plate goes down after (s), by (m), at (m/s: the article's), and the flight goes on for (s)."""
PLATE_RTOL = 1e-2  # Of the plate's tables: capture is decided by the field's attraction, the plate only brakes


@dataclass(frozen=True, eq=False)
class Place:
    """A rotor at one frequency, and where the floater would levitate without a plate."""

    scene: Scene  # with the plate, which stays
    distance: float  # of the floater from the rotor's origin, m
    low: float  # ends of the stable frequencies without a plate, Hz
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
    """How n floaters are let go."""

    farther: Array  # (n,) from the rotor than where it levitates, m
    sideways: Array  # (n,) m
    lean: Array  # (n,) angle of the moment to the axis, rad
    spin: Array  # (n,) about the moment, over the rotor's
    states: State  # (n, 3) at t = 0, along the rotor's axes


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
    position = np.stack(
        [sideways * np.cos(place_angle), sideways * np.sin(place_angle), -place.distance - farther], axis=-1
    )
    moment = np.stack([sine * np.cos(moment_angle), sine * np.sin(moment_angle), cosine], axis=-1)
    turning = (spin * place.scene.angular_velocity)[:, None] * moment
    return Launches(farther, sideways, np.arccos(cosine), spin, State(position, velocity, moment, turning))


def seed_of(configuration: str, measure: float, part: float, batch: int) -> list[int]:
    """A seed of its own for each batch of launches."""
    return [crc32(f"{configuration} {measure:g} {part:.6f}".encode()), batch]


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
class Captured:
    """One rotor at one frequency: all of its launches."""

    configuration: str  # of the rotor and of its range of stable frequencies
    measure: float
    part: float
    frequency: float  # Hz, NaN where none is stable
    flights: xr.Dataset  # outcome and how each was let go, over `flight`
    settled: int  # of those flown on while the plate went down: up before, and after
    stayed: int

    @property
    def captured(self) -> NDArray[np.bool_]:
        """Which launches are captured."""
        return np.asarray(self.flights["outcome"].values == HELD)

    @property
    def probability(self) -> Share:
        """Share of launches that are captured."""
        return Share(int(self.captured.sum()), self.captured.size)

    @property
    def beyond(self) -> NDArray[np.bool_]:
        """Which launches left the range of the plate's table."""
        return np.asarray(self.flights["left_plate_table"].values == 1)

    @property
    def others(self) -> dict[str, float]:
        """Shares of launches that ended otherwise, by name."""
        return {word: float(np.mean(self.flights["outcome"].values == k)) for k, word in enumerate(WORDS) if k != HELD}

    @property
    def levitated(self) -> bool:
        """Whether the article's experiment levitated with this rotor."""
        return self.measure in CONFIGURATIONS[self.configuration].levitated


def captured(result: xr.Dataset) -> list[Captured]:
    """Each rotor and frequency of a joined result, its batches put together."""
    found = []
    for _, some in by_configuration(result):
        for measure, part in sorted({(float(m), float(p)) for m, p in zip(some["measure"], some["part"], strict=True)}):
            found.append(_together(cases_with(some, measure=measure, part=part)))
    return found


def _together(part: xr.Dataset) -> Captured:
    names = ["outcome", "farther", "sideways", "lean", "spin", "levitated", "left_plate_table"]
    whole = part[names].drop_vars(["configuration", "measure"], errors="ignore")
    flights = whole.stack(every=("case", "flight"), create_index=False).rename(every="flight")
    flights = flights.isel(flight=np.flatnonzero(np.isfinite(flights["outcome"].values)))
    first = part.isel(case=0)
    rotor = str(first["configuration"].values), float(first["measure"]), float(first["part"])
    counts = int(part["settled"].sum()), int(part["stayed"].sum())
    return Captured(*rotor, float(first["rotor_frequency"]), flights, *counts)


PARTS = (1 / 6, 1 / 2, 5 / 6)  # Places in the range of stable frequencies
TOGETHER, BATCHES = 2000, 5  # Flights of a point, and points for each rotor and frequency: ten thousand flights
CHECKED = 8  # Launches of each rotor and frequency that are flown on while the plate goes down
FEW = 24  # Launches of a point in the quick setting


def capture_points(quick: bool) -> list[Point]:
    """All rotors and frequencies again and again, a batch of launches each time, so that a stop leaves equal shares."""
    if quick:
        return [_point(*rotor, 0.5, 0, FEW, 0) for rotor in QUICK_ROTORS]
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
    """One batch of launches below one rotor, see `COLUMNS`; the outcomes are numbers of `WORDS`."""
    rotor = point["configuration"], point["measure"], point["part"]
    found: dict[str, Any] = {"part": point["part"], "batch": point["batch"], "settled": 0, "stayed": 0}
    empty = np.full(point["flights"], np.nan)
    try:
        place = place_of(*rotor)
    except EquilibriumError:
        found |= {name: np.nan for name, (dims, *_) in COLUMNS.items() if not dims and name not in found}
        found["outcome"] = np.full(point["flights"], float(NO_EQUILIBRIUM))
    else:
        begun = launches(place, point["flights"], seed_of(*rotor, point["batch"]))
        ended = launched(place.scene, field_of(place), plate_under(place, place.scene), begun.states, SETTLED)
        found |= {"rotor_frequency": place.scene.frequency, "distance": place.distance, "low": place.low}
        found |= {"high": place.high, "levitated": ended.levitated_s, "outcome": outcomes(place, ended).astype(float)}
        found |= {name: getattr(begun, name) for name in ("farther", "sideways", "lean", "spin")}
        found["left_plate_table"] = ended.left_plate_table.astype(float)
        found["settled"], found["stayed"] = _flown_on(place, begun, point["checked"])
    found = {name: found.get(name, empty) for name in COLUMNS}
    return one_case(point, xr.Dataset(columns(COLUMNS, {name: np.asarray(value) for name, value in found.items()})))


FLIGHTS = ("flight",)
COLUMNS: Columns = {
    "rotor_frequency": ((), "Hz", "frequency of the rotor"),
    "distance": ((), "m", "distance of levitation without a plate"),
    "low": ((), "Hz", "lowest stable frequency without a plate"),
    "high": ((), "Hz", "highest stable frequency without a plate"),
    "part": ((), "1", "place in the range of stable frequencies"),
    "batch": ((), "1", "number of the batch"),
    "settled": ((), "1", "flights that were up when the plate began to go down"),
    "stayed": ((), "1", "those of them that were up after it had gone down"),
    "farther": (FLIGHTS, "m", "farther from the rotor than where it levitates"),
    "sideways": (FLIGHTS, "m", "lateral offset"),
    "lean": (FLIGHTS, "rad", "angle of the moment to the axis"),
    "spin": (FLIGHTS, "1", "spin about the moment over the rotor's"),
    "levitated": (FLIGHTS, "s", "time until it touched something or was lost"),
    "outcome": (FLIGHTS, "1", "how it ended"),
    "left_plate_table": (FLIGHTS, "1", "whether it went where the plate's field is a continuation of its table"),
}


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


SHOWN = (("horizontal", 2.0), ("vertical", 14.0), ("vertical", 18.0), ("tilt", 10.0))
"""Rotors of which it is drawn from where they capture."""
BINS = 6


@styled
def share_figure(result: xr.Dataset) -> Figure:
    """The capture probability against each configuration's displacement or tilt, at each part of its frequencies."""
    found = captured(result)
    figure, rows = configuration_panels(result, 2.7, ylabel="capture probability (%)", sharey=True)
    for axes, name, _ in rows:
        own = [one for one in found if one.configuration == name]
        for part, color in zip(sorted({one.part for one in own}), PALETTE, strict=False):
            some = [one for one in own if one.part == part]
            label = f"{part:.0%} of the stable range"
            _shares(axes, [one.measure for one in some], [one.probability for one in some], color, label)
        for measure in CONFIGURATIONS[name].levitated:
            axes.axvline(measure, color="0.85", lw=4, zorder=0, label="levitated in the article")
        axes.set(xlabel=label_of(name), ylim=(-2, 102))
    legend_below(figure, rows[0][0])
    return figure


def _shares(axes: Axes, x: Sequence[float], shares: Sequence[Share], color: str, label: str) -> None:
    """Shares in per cent with Wilson's intervals."""
    values, around = np.array([s.value for s in shares]), np.array([s.bounds for s in shares])
    bars = np.maximum(np.stack([values - around[:, 0], around[:, 1] - values]), 0)
    axes.errorbar(x, 100 * values, 100 * bars, fmt="o-", ms=4, capsize=2, color=color, label=label)


@styled
def place_figure(result: xr.Dataset) -> Figure:
    """From where floaters are captured: over height and lateral offset, and over the moment's angle to the axis."""
    found = [[one for one in captured(result) if (one.configuration, one.measure) == rotor] for rotor in SHOWN]
    chosen = [some[len(some) // 2] for some in found if some]
    figure, (maps, leans) = panels(2, len(chosen), (PAGE, 4.6), sharey="row")
    side, height = np.linspace(0, SIDEWAYS, 5), np.linspace(-NEARER, FARTHER, 9)
    edges = np.degrees(np.linspace(0, LEAN, BINS + 1))
    for top, bottom, one in zip(maps, leans, chosen, strict=True):
        at = one.flights["sideways"].values, one.flights["farther"].values
        hits = one.captured.astype(float)
        share = 100 * scipy.stats.binned_statistic_2d(*at, hits, bins=(side, height)).statistic
        drawn = top.pcolormesh(1e3 * side, 1e3 * height, share.T, vmin=0, vmax=100, cmap="viridis")
        top.grid(False)
        top.set(title=f"{rotor_label(one.configuration, one.measure)}, {one.frequency:.0f} Hz")
        top.set_xlabel("lateral offset (mm)")
        lean = np.digitize(np.degrees(one.flights["lean"].values), edges) - 1
        shares = [Share(int(one.captured[lean == k].sum()), int((lean == k).sum())) for k in range(BINS)]
        _shares(bottom, ((edges[1:] + edges[:-1]) / 2).tolist(), shares, PALETTE[0], "")
        bottom.set(xlabel="moment to the axis (°)", ylim=(-2, 102))
    maps[0].set_ylabel("farther from the rotor (mm)")
    maps[0].invert_yaxis()  # shared by all
    leans[0].set_ylabel("capture probability (%)")
    figure.colorbar(drawn, ax=maps, label="captured (%)")
    return figure


def capture_lines(result: xr.Dataset) -> list[str]:
    """The capture probability of each rotor and frequency, and what became of the others."""
    found, rows = captured(result), []
    for one in found:
        rest = sorted(((share, word) for word, share in one.others.items() if share > 0), reverse=True)
        after = f"{one.stayed} of {one.settled}" if one.settled else ""
        seen = "levitated" if one.levitated else "did not levitate"
        name = f"{rotor_label(one.configuration, one.measure)}, {one.frequency:.1f} Hz"
        ends = ", ".join(f"{100 * share:.0f} % {word}" for share, word in rest)
        rows.append((name, f"{one.probability}", str(one.probability.trials), seen, after, ends))
    head = ("rotor", "captured", "launches", "article", "stay, plate lowered", "others")
    lines = text_table(head, rows)
    flown = sum(int(np.isfinite(one.flights["left_plate_table"]).sum()) for one in found)
    beyond = sum(int(one.beyond.sum()) for one in found)
    if beyond:
        inside = sum(int((one.beyond & one.captured).sum()) for one in found)
        lines.append(
            f"{beyond} of {flown} trajectories, {inside} of them captured, were for a while beyond the range of the "
            "plate's table, where the field of its currents is a continuation of unknown error."
        )
    settled, stayed = sum(one.settled for one in found), sum(one.stayed for one in found)
    if settled:
        lines.append(
            f"Of {settled} captured floaters {stayed} still levitate after the plate was lowered (10 mm/s over 55 mm): "
            f"{Share(settled - stayed, settled)} are lost."
        )
    return lines


def capture_numbers(result: xr.Dataset) -> dict[str, Any]:
    """The shares as numbers: `shares`, one entry for each rotor and frequency; and what the plate's lowering loses."""
    found = captured(result)
    rows = [
        {
            "configuration": one.configuration,
            "value": one.measure,
            "levitated_in_article": one.levitated,
            "frequency_hz": None if np.isnan(one.frequency) else one.frequency,
            "flights": one.probability.trials,
            "held": one.probability.value,
            "held_error": one.probability.error,
            "left_plate_table": float(np.mean(one.beyond)),
            **{word.replace(" ", "_"): share for word, share in one.others.items()},
        }
        for one in found
    ]
    return {
        "shares": rows, "flown_on": sum(one.settled for one in found), "stayed_up": sum(one.stayed for one in found),
    }  # fmt: skip


STUDY = Study(
    name="capture",
    summary="capture probability: floaters let go over the plate in many ways, for every rotor that was tried",
    points=capture_points,
    compute=capture,
    figures={"capture": share_figure, "capture-from-where": place_figure},
    report=capture_lines,
    numbers=capture_numbers,
)
