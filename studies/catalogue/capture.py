"""Which floaters are captured: launches drawn at random over the plate of every rotor that was tried.

Of one rotor also a disc, a rod and a cube of the sphere's volume, let go as the sphere is.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any
from zlib import crc32

import numpy as np
import scipy
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ...dynamics.continuation.frequencies import at_frequency
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...dynamics.flights.batch import Endings, launched
from ...dynamics.flights.trajectory import DURATION
from ...dynamics.motion.events import CONTACT
from ...dynamics.motion.plate import PlateMemory
from ...dynamics.motion.state import State
from ...fem.plate.choice import reachable_region
from ...fem.plate.tables import PlateAround
from ...fem.rotor.table import RotorTable
from ...geometry.common import Array
from ...geometry.scene.contents import Lowering, Scene
from ..figures.style import PALETTE, colour_bar, panels, styled, titled
from ..result import Columns
from ..study import Point, Study, cases_with, recorded
from . import article
from .floater_shape import CUBE, SPHERE, body_of
from .showing import by_rotor, configuration_panels, each, text_table

# From where it would levitate without a plate: so much nearer to the rotor, farther from it, and to the side, m
NEARER, FARTHER, SIDEWAYS = 4e-3, 8e-3, 6e-3
LEAN = np.radians(60.0)  # Largest angle of the moment to the axis
SPIN = 0.2  # Largest spin about its own moment, over the rotor's
SPEED = 0.02  # Standard deviation of each component of the velocity with which a hand lets go, m/s
BELOW = 0.018  # Face of the plate below where it levitates without it, m: 35 mm below the rotor is 10 to 20 of these
# The plate goes down after (s), by (m), at (m/s: the article's), and the trajectory goes on for (s)
SETTLED, LOWERED, LOWERING_SPEED, AFTER = 1.0, 0.055, 0.01, 1.0
PLATE_RTOL = 1e-2  # Of the plate's tables: capture is decided by the field's attraction, the plate only brakes


@dataclass(frozen=True, eq=False)
class Place:
    """A rotor at one frequency, and where the floater would levitate without a plate."""

    scene: Scene  # with the plate, which stays
    field: RotorTable  # of the rotor
    distance: float  # of the floater from the rotor's origin, m
    low: float  # ends of the stable frequencies without a plate, Hz
    high: float


@cache
def place_of(configuration: str, measure: float, part: float) -> Place:
    """A rotor (`configuration`, `measure`) at a `part` (0 to 1) of its stable frequencies; floater and air as they are.

    Field and range by the closed form of μr = 1. Raises EquilibriumError where it levitates stably at no frequency.
    """
    scene = article.rotor_scene(configuration, measure, permeability=1.0)
    levitation = article.levitation_of(scene, "cuboid")
    stable = article.stable_frequencies(scene, levitation.rates)
    frequency = float(article.within(stable, part))
    distance = at_frequency(scene, levitation.rates, stable.near(frequency), frequency).distance
    plate = article.plate_with_face(-distance - BELOW)
    there = replace(scene, frequency=frequency, plate=plate, **article.losses(scene, rotor=False))
    assert isinstance(levitation.table, RotorTable)
    return Place(there, levitation.table, distance, stable.low.parameter, stable.high.parameter)


@cache
def plate_under(place: Place, lowered: bool = False) -> PlateMemory:
    """The currents in a place's plate, an infinite slab which may be `lowered`, wherever launches begin."""
    scene, plate = place.scene, place.scene.plate
    assert plate is not None
    if lowered:
        plate = replace(plate, lowering=Lowering(SETTLED, LOWERING_SPEED, LOWERED))
    middle = np.array([0.0, 0.0, -place.distance - (FARTHER - NEARER) / 2])
    region = reachable_region(plate, middle, [SIDEWAYS, SIDEWAYS, (FARTHER + NEARER) / 2], scene.floater.radius)
    frequencies = (0.5, max(250.0, 2 * scene.frequency))
    table, share = PlateAround(plate, place.field, region, frequencies, PLATE_RTOL, slab=True).tables()
    return PlateMemory(plate, table, share, "slab")


def launches(place: Place, count: int, seed: list[int]) -> tuple[dict[str, Array], State]:
    """A `count` of launches drawn evenly over heights, a disc, a cap of directions and spins; let go by a hand.

    How each is let go below a `place` (n,) by the names of `COLUMNS`, and its state at t = 0; the same for a `seed`.
    """
    draws = np.random.default_rng(seed)
    height, area, cap, along = draws.uniform(size=(4, count))
    place_angle, moment_angle = draws.uniform(0, 2 * np.pi, (2, count))
    velocity = draws.normal(0, SPEED, (count, 3))
    how = {"farther": -NEARER + (NEARER + FARTHER) * height, "sideways": SIDEWAYS * np.sqrt(area)}
    cosine = 1 - (1 - np.cos(LEAN)) * cap  # even over the sphere's cap
    how |= {"lean": np.arccos(cosine), "spin": SPIN * (2 * along - 1)}
    position = _cylindrical(how["sideways"], place_angle, -place.distance - how["farther"])
    moment = _cylindrical(np.sqrt(1 - cosine**2), moment_angle, cosine)
    return how, State(position, velocity, moment, (how["spin"] * place.scene.angular_velocity)[:, None] * moment)


def _cylindrical(radius: Array, angle: Array, height: Array) -> Array:
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)


def seed_of(configuration: str, measure: float, part: float, batch: int) -> list[int]:
    """A seed for each `batch` of launches below a rotor, by `configuration`, `measure` and `part` as of `place_of`."""
    return [crc32(f"{configuration} {measure:g} {part:.6f}".encode()), batch]


CAPTURED, PLATE, ROTOR, LOST, NO_EQUILIBRIUM = range(5)  # Numbers of these words
WORDS = ("captured", "touched the plate", "touched the rotor", "lost to the side", "no stable frequency")
OTHERS = {word.replace(" ", "_"): word for word in WORDS[1:]}
PARTS = (1 / 6, 1 / 2, 5 / 6)  # Places in the range of stable frequencies
TOGETHER, BATCHES = 2000, 5  # Trajectories of a point, and points for each rotor and frequency: 10 000 in all
CHECKED = 8  # Launches of each rotor and frequency that are simulated on while the plate goes down
FEW = 24  # Launches of a point in the quick setting
# Floaters and their heights over their diameters, see `body_of`
SHAPES = {SPHERE: (SPHERE, 1.0), "disc": ("cylinder", 0.5), "rod": ("cylinder", 2.0), CUBE: (CUBE, 1.0)}
# The launches of those that are no spheres, and how many there are of each
SHAPED, OF_SHAPE = {"configuration": "vertical", "measure": 14.0, "part": 0.5, "batch": 0, "checked": 0}, 400
FLIGHTS = ("flight",)
COLUMNS: Columns = {
    "rotor_frequency": ((), "Hz", "frequency of the rotor"),
    "distance": ((), "m", "distance of levitation without a plate"),
    "low": ((), "Hz", "lowest stable frequency without a plate"),
    "high": ((), "Hz", "highest stable frequency without a plate"),
    "part": ((), "1", "place in the range of stable frequencies"),
    "batch": ((), "1", "number of the batch"),
    "shape": ((), "", "shape of the floater"),
    "settled": ((), "1", "trajectories that still levitated when the plate began to go down"),
    "stayed": ((), "1", "those of them that were up after it had gone down"),
    "farther": (FLIGHTS, "m", "farther from the rotor than where it levitates"),
    "sideways": (FLIGHTS, "m", "lateral offset"),
    "lean": (FLIGHTS, "rad", "angle of the moment to the axis"),
    "spin": (FLIGHTS, "1", "spin about the moment over the rotor's"),
    "levitated": (FLIGHTS, "s", "time until it touched something or was lost"),
    "outcome": (FLIGHTS, "1", "how it ended"),
    "left_plate_table": (FLIGHTS, "1", "whether it went where the plate's field is a continuation of its table"),
}


def capture_points(quick: bool) -> list[Point]:
    """All rotors and frequencies in turn, a batch of launches each, so that a stop leaves equal shares; then shapes."""
    rotors = [(name, value) for name, kind in article.CONFIGURATIONS.items() for value in kind.tested]
    every = product(range(BATCHES), rotors, PARTS)
    requested = [(*rotor, part, batch, TOGETHER, 0 if batch else CHECKED) for batch, rotor, part in every]
    shapes, count = list(SHAPES)[1:], OF_SHAPE
    if quick:
        requested, shapes, count = [(*rotor, 0.5, 0, FEW, 0) for rotor in article.QUICK_ROTORS], [CUBE], FEW
    names = ("configuration", "measure", "part", "batch", "flights", "checked")
    others = [{**SHAPED, "flights": count, "shape": shape} for shape in shapes]
    return [*(dict(zip(names, values, strict=True)) for values in requested), *others]


def capture(point: Point) -> xr.Dataset:
    rotor, count = (point["configuration"], point["measure"], point["part"]), point["flights"]
    shape = point.get("shape", SPHERE)
    found: dict[str, Any] = {"part": point["part"], "batch": point["batch"], "settled": 0, "stayed": 0, "shape": shape}
    try:
        place = place_of(*rotor)
    except EquilibriumError:
        return recorded(point, COLUMNS, found | {"outcome": np.full(count, float(NO_EQUILIBRIUM))}, {}, flight=count)
    how, states = launches(place, count, seed_of(*rotor, point["batch"]))
    if shape != SPHERE:  # of the same volume and material
        floater = replace(body_of(*SHAPES[shape]), conductivity=place.scene.floater.conductivity)
        place = replace(place, scene=replace(place.scene, floater=floater))
    ended = _simulated(place, states, SETTLED)
    low = ended.last.position[:, 2] < -(place.distance + BELOW) / 2
    outcome = np.where(ended.ended_by == CONTACT, np.where(low, PLATE, ROTOR), LOST)
    outcome[ended.ended_by == DURATION] = CAPTURED
    found |= {"rotor_frequency": place.scene.frequency, **{k: getattr(place, k) for k in ("distance", "low", "high")}}
    found |= {**how, "levitated": ended.levitated_s, "outcome": outcome.astype(float)}
    found["left_plate_table"] = ended.left_plate_table.astype(float)
    if point["checked"]:
        first = states[: point["checked"]]
        later = _simulated(place, first, SETTLED + LOWERED / LOWERING_SPEED + AFTER, lowered=True)
        found |= {"settled": np.sum(later.levitated_s >= SETTLED), "stayed": np.sum(later.ended_by == DURATION)}
    return recorded(point, COLUMNS, found, {}, flight=count)


def _simulated(place: Place, states: State, seconds: float, lowered: bool = False) -> Endings:
    memory = plate_under(place, lowered)
    return launched(replace(place.scene, plate=memory.plate), place.field, memory, states, seconds)


def share(hits: ArrayLike) -> tuple[float, float, float]:
    """Share of trials (n,) that hit, and the ends of Wilson's binomial interval of one standard deviation."""
    trials = np.asarray(hits, bool)
    if not trials.size:
        return np.nan, np.nan, np.nan
    found = scipy.stats.binomtest(int(trials.sum()), trials.size)
    return float(found.statistic), *found.proportion_ci(math.erf(0.5**0.5), "wilson")


def share_text(hits: ArrayLike) -> str:
    value, low, high = share(hits)
    error = (high - low) / 2
    digits = max(1, math.ceil(-math.log10(100 * error))) if np.isfinite(error) else 1
    return f"{100 * value:.{digits}f} ± {100 * error:.{digits}f} %"


def each_place(result: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    """The launches of each rotor, frequency and shape of a joined result, by its label, its batches put together."""
    found = []
    for label, rotor in by_rotor(result):
        for part, shape in product(np.unique(rotor["part"].values), SHAPES):
            some = cases_with(rotor, part=part, shape=shape)
            if not some.sizes["case"]:
                continue
            flights = some[[name for name, (dims, *_) in COLUMNS.items() if dims]].stack(trial=("case", "flight"))
            one = flights.isel(trial=np.isfinite(flights["outcome"].values)).drop_vars(["trial", "case", "flight"])
            one = one.assign(some[["configuration", "measure", "part", "shape", "rotor_frequency"]].isel(case=0))
            name = label if shape == SPHERE else f"{label}, {shape}"
            found.append((name, one.assign(some[["settled", "stayed"]].sum())))
    return found


SHOWN = ("δx = 2 mm", "δz = 14 mm", "δz = 18 mm", "δθ = 10°")  # Rotors of which it is drawn from where they capture
BINS = 6


@each(configuration_panels, 2.7, ylabel="capture probability (%)")
def share_figure(axes: Axes, own: xr.Dataset) -> None:
    """The capture probability of each rotor at each part of its frequencies; bars: one standard deviation."""
    every = [one for _, one in each_place(own) if one["shape"] == SPHERE]
    for part, color in zip(np.unique(own["part"]), PALETTE, strict=False):
        some = [one for one in every if one["part"] == part]
        measures, hits = [one["measure"].item() for one in some], [one["outcome"] == CAPTURED for one in some]
        _shares(axes, measures, hits, color, f"{part:.0%} of the stable range")
    for measure in article.CONFIGURATIONS[own["configuration"].values[0]].levitated:
        axes.axvline(measure, color="0.85", lw=4, zorder=0, label="levitated in the article")
    axes.set_ylim(-2, 102)


def _shares(axes: Axes, x: ArrayLike, hits: Sequence[ArrayLike], color: str, label: str) -> None:
    values, low, high = 100 * np.array([share(each) for each in hits]).T
    bars = np.maximum([values - low, high - values], 0)
    axes.errorbar(x, values, bars, fmt="o-", ms=4, capsize=2, color=color, label=label, clip_on=False)


@styled
def place_figure(result: xr.Dataset) -> Figure:
    """From where floaters are captured: over height and lateral offset, and over the moment's angle to the axis."""
    every = each_place(result)
    found = [(label, [one for name, one in every if name == label]) for label in SHOWN]
    chosen = [(label, some[len(some) // 2]) for label, some in found if some]
    figure, (maps, leans) = panels(2, len(chosen), 2.3)
    side, height = np.linspace(0, SIDEWAYS, 5), np.linspace(-NEARER, FARTHER, 9)
    edges = np.degrees(np.linspace(0, LEAN, BINS + 1))
    for top, bottom, (label, one) in zip(maps, leans, chosen, strict=True):
        at, hits = (one["sideways"].values, one["farther"].values), one["outcome"].values == CAPTURED
        mean = 100 * scipy.stats.binned_statistic_2d(*at, hits.astype(float), bins=(side, height)).statistic
        shades = top.pcolormesh(1e3 * side, 1e3 * height, mean.T, vmin=0, vmax=100, cmap="viridis")
        top.grid(False)
        titled(top, f"{label}\n{float(one['rotor_frequency']):.0f} Hz")
        top.set(xlabel="lateral offset (mm)", ylim=1e3 * height[[-1, 0]])
        lean = np.digitize(np.degrees(one["lean"].values), edges) - 1
        _shares(bottom, (edges[1:] + edges[:-1]) / 2, [hits[lean == k] for k in range(BINS)], PALETTE[0], "")
        bottom.set(xlabel="initial polar angle (°)", ylim=(-2, 102))
    maps[0].set_ylabel("initial distance beyond the equilibrium's (mm)")
    leans[0].set_ylabel("capture probability (%)")
    colour_bar(figure, shades, maps, label="captured (%)")
    return figure


def _capture_lines(result: xr.Dataset) -> list[str]:
    found, known, rows = each_place(result), capture_numbers(result), []
    for (label, one), numbers in zip(found, known["shares"], strict=True):
        after = f"{int(one['stayed'])} of {int(one['settled'])}" if one["settled"] else ""
        seen = "levitated" if numbers["levitated_in_article"] else "did not levitate"
        rest = sorted(((numbers[key], word) for key, word in OTHERS.items()), key=lambda other: -other[0])
        ends = ", ".join(f"{100 * part:.0f} % {word}" for part, word in rest if part > 0)
        name, held = f"{label}, {float(one['rotor_frequency']):.1f} Hz", share_text(one["outcome"] == CAPTURED)
        rows.append((name, held, str(one.sizes["trial"]), seen, after, ends))
    head = ("rotor", "captured", "launches", "article", "stay, plate lowered", "others")
    lines = text_table(head, rows)
    every = xr.concat([one[["outcome", "left_plate_table"]] for _, one in found], "trial", coords="minimal")
    beyond = every["left_plate_table"] == 1
    if beyond.any():
        captured, count = int((beyond & (every["outcome"] == CAPTURED)).sum()), int(every["left_plate_table"].count())
        lines.append(
            f"{int(beyond.sum())} of {count} trajectories, {captured} of them captured, were for a while beyond the "
            "range of the plate's table, where the field of its currents is a continuation of unknown error."
        )
    if settled := known["simulated_on"]:
        stayed = known["still_levitating"]
        lines.append(
            f"Of {settled} captured floaters {stayed} still levitate after the plate was lowered (10 mm/s over 55 mm): "
            f"{share_text(np.arange(settled) >= stayed)} are lost."
        )
    return lines


def capture_numbers(result: xr.Dataset) -> dict[str, Any]:
    rows = []
    for _, one in each_place(result):
        value, low, high = share(one["outcome"] == CAPTURED)
        frequency, name, measure = (one[key].item() for key in ("rotor_frequency", "configuration", "measure"))
        seen = measure in article.CONFIGURATIONS[name].levitated
        row = {"configuration": name, "value": measure, "shape": one["shape"].item(), "levitated_in_article": seen}
        row |= {"frequency_hz": None if np.isnan(frequency) else frequency, "flights": one.sizes["trial"]}
        row |= {"captured": value, "captured_error": (high - low) / 2}
        row["left_plate_table"] = float((one["left_plate_table"] == 1).mean())
        rows.append(row | {key: float((one["outcome"] == k).mean()) for k, key in enumerate(OTHERS, 1)})
    on, still = (int(result[name].sum()) for name in ("settled", "stayed"))
    return {"shares": rows, "simulated_on": on, "still_levitating": still}


STUDY = Study(
    name="capture",
    summary="capture probability: floaters let go over the plate in many ways, for every rotor that was tried",
    quick="all but three rotors at one frequency each; fewer launches",
    points=capture_points,
    compute=capture,
    figures={"capture": share_figure, "capture-from-where": place_figure},
    report=_capture_lines,
    numbers=capture_numbers,
)
