"""Levitation time against frequency by the slow drift of the spin, with what is not known of the experiment."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.branch import Family, follow_branch, frequencies, spins
from ...dynamics.continuation.frequencies import LONG_STEPS, reference_state
from ...dynamics.continuation.slow_drift import E_FOLDS, Drift, drift
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.state import Scales
from ...fem.rotor.table import FieldTable
from ...geometry.common import MAGNET_CONDUCTIVITY, Array
from ...geometry.scene.contents import Drag, Scene
from ..cli.options import FieldModel
from ..figures.style import PALETTE, styled
from ..result import Columns, columns, variable
from ..study import Point, Study
from .article import FLOATER, PERMEABILITY, REMANENCE, article_scene, levitation_of, losses
from .drawing import drawn, explain, small_multiples
from .tables import span, text_table


class DriftCase(NamedTuple):
    """One rotor."""

    configuration: str
    measure: float  # mm or degrees
    reference: float  # frequency at which it has an equilibrium for all variants, Hz
    lowest: float  # frequencies that bound what is asked, Hz
    highest: float


CASES = {
    "horizontal 1 mm": DriftCase("horizontal", 1.0, 215.0, 110.0, 250.0),
    "vertical 14 mm": DriftCase("vertical", 14.0, 78.0, 58.0, 93.0),
    "horizontal 1.5 mm": DriftCase("horizontal", 1.5, 160.0, 95.0, 220.0),
    "vertical 12.6 mm": DriftCase("vertical", 12.6, 70.0, 51.0, 86.0),
    "horizontal 2 mm": DriftCase("horizontal", 2.0, 130.0, 80.0, 195.0),
    "vertical 16 mm": DriftCase("vertical", 16.0, 95.0, 68.0, 110.0),
    "tilt 5 deg": DriftCase("tilt", 5.0, 185.0, 130.0, 250.0),
    "tilt 10 deg": DriftCase("tilt", 10.0, 110.0, 75.0, 180.0),
}  # Rotors of the article, and two whose displacement is chosen so that they fly where the article's did
TOLERANCES = {"horizontal": 0.2, "vertical": 0.5, "tilt": 0.5}  # Of the displacement or tilt, mm or degrees
QUICK = ("horizontal 1 mm", "vertical 14 mm")
OUTCOMES = ("contact", "fold", "instability", "levitates", "no equilibrium")  # How a flight may end
LEVITATES, NO_EQUILIBRIUM = 3, 4  # Numbers of two of these


@dataclass(frozen=True)
class Variant:
    """What is not known of the experiment."""

    spin: float = 0.0  # at release
    remanence: float = REMANENCE  # of all magnets, T
    conductivity: float = MAGNET_CONDUCTIVITY  # of the floater, S/m
    stokes: bool = False  # whether the air's drag is Stokes's
    e_folds: float = E_FOLDS  # growth of an oscillation that ends the flight
    misplaced: float = 0.0  # error of the rotor's displacement, in units of its tolerance
    # "rigid": closed form of μr = 1, and no answers; "permeable": by finite elements with μr = 1.05, rotor and
    # floater magnetise each other; "conducting": and there are eddy currents in the rotor's magnets
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
}  # Conductivity: makers' values; upwards a plating of nickel and copper, and the field's gradient (`SlowTorque`)
QUICK_VARIANTS = ("nominal", "spin -0.1", "spin +0.1", "displacement smaller", "displacement larger", "Stokes drag")


def scene_of(case: DriftCase, variant: Variant) -> Scene:
    """The scene of a case at its reference frequency."""
    measure = case.measure + variant.misplaced * TOLERANCES[case.configuration]
    permeability = 1.0 if variant.rotor == "rigid" else PERMEABILITY
    scene = article_scene(
        case.configuration, measure, case.reference,
        remanence=variant.remanence, permeability=permeability, floater=replace(FLOATER, remanence=variant.remanence),
    )  # fmt: skip
    scene = replace(scene, **losses(scene, variant.rotor == "conducting", False))
    return replace(scene, floater=replace(scene.floater, conductivity=variant.conductivity))


CAP, SHORTEST = 250.0, 3.0  # The article stopped a flight after 250 s, and did not count one of less than 3 s
SAMPLES = 60
STEP = ("case", "variant", "step")
COLUMNS: Columns = {
    "levitation_time": (STEP, "s", f"time until the loss, at most {CAP:g} s"),
    "outcome": (STEP, "1", "how it ended: " + ", ".join(f"{k} {name}" for k, name in enumerate(OUTCOMES))),
    "distance_start": (STEP, "m", "distance from the rotor at the start"),
    "distance_end": (STEP, "m", "distance at the end or the cap"),
    "spin_end": (STEP, "1", "body spin at the end or the cap"),
    "fall_rate": (STEP, "m/s", "mean rate of fall over the first nine tenths of the flight"),
    "fall_ratio": (STEP, "1", "rate of fall from 0.6 to 0.9 of the flight over that from 0 to 0.3"),
    "balance_spin": (STEP, "1", "body spin at which drag and eddy currents balance"),
    "growth": (STEP, "1/s", "largest growth rate of a mode during the flight"),
    "flight_time": ((*STEP, "sample"), "s", "time"),
    "flight_distance": ((*STEP, "sample"), "m", "distance from the rotor"),
}


def time_points(quick: bool) -> list[Point]:
    """Every case with every variant; `quick` has two cases, fewer frequencies and variants, and point dipoles."""
    names, variants = (QUICK, QUICK_VARIANTS) if quick else (tuple(CASES), tuple(VARIANTS))
    steps, model = (11, "dipole") if quick else (36, "cuboid")
    models = {v: model if VARIANTS[v].rotor == "rigid" else "fem" for v in variants}
    return [{"case": c, "variant": v, "steps": steps, "model": models[v]} for c in names for v in variants]


def levitation_times(point: Point) -> xr.Dataset:
    """Levitation time, start and end of the averaged flights of one rotor with one variant, over `step` of frequency.

    Recoil permeability is 1.05 in the floater and, but in the variants that say so, left out in the rotor.
    """
    case, variant = CASES[point["case"]], VARIANTS[point["variant"]]
    grid = np.linspace(case.lowest, case.highest, point["steps"])
    scene = scene_of(case, variant)
    flights = dict(_flights(scene, *_compiled(scene, point["model"]), variant, grid))
    rows = [_row(flights.get(f)) for f in grid]
    found = {name: np.array([row[name] for row in rows])[None, None] for name in COLUMNS}
    frequency = variable(("case", "step"), grid[None], "Hz", "frequency of the rotor")
    coordinates = {"case": [point["case"]], "variant": [point["variant"]], "frequency": frequency}
    attributes = {"model": point["model"], "cap_s": CAP, "shortest_s": SHORTEST}
    return xr.Dataset(columns(COLUMNS, found), coordinates, attributes)


def gather_times(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """All rows by `case` and `variant`; NaN where one is missing."""
    names = dict.fromkeys(part["case"].item() for part in parts)
    rotors = [[part for part in parts if part["case"].item() == name] for name in names]
    cases = [xr.concat(rows, "variant", data_vars="all", coords="minimal", compat="override") for rows in rotors]
    return xr.concat(cases, "case", data_vars="all", coords="different", compat="equals", join="outer")


def _compiled(scene: Scene, model: FieldModel) -> tuple[FieldTable, Rates, Array]:
    """Table and rates of a scene, and the scaled state of the equilibrium on the branch of the dipoles' stable one."""
    levitation = levitation_of(scene, model, interaction="rigid" if model != "fem" else "mutual")
    magnets = tuple(replace(magnet, conductivity=None) for magnet in scene.rotor)
    still = replace(scene, rotor=magnets, floater=replace(scene.floater, conductivity=None), drag=Drag(0.0, 0.0))
    state, frequency = reference_state(still)
    family = Family(levitation.rates, frequencies(scene), 50.0)
    there = follow_branch(family, state, frequency, scene.frequency, LONG_STEPS, tolerated=np.inf)[-1]
    return levitation.table, levitation.rates, there.state


def _flights(
    scene: Scene, table: FieldTable, rates: Rates, start: Array, variant: Variant, grid: Array
) -> Iterator[tuple[float, Drift]]:
    """Flights at those frequencies that the branch of equilibria reaches, from the scene's own frequency both ways."""
    begin = follow_branch(Family(rates, spins(scene)), start, 0.0, variant.spin)[-1] if variant.spin else None
    start = begin.state if begin else start
    walk = partial(follow_branch, Family(rates, frequencies(scene, variant.spin), 50.0), tolerated=np.inf)
    for side in (grid[grid <= scene.frequency][::-1], grid[grid > scene.frequency]):
        state, here = start, scene.frequency
        for frequency in side:
            try:
                last = walk(state, here, frequency)[-1] if frequency != here else None
            except EquilibriumError:
                break
            if last is not None:
                if last.parameter != frequency or last.growth_per_s > 1e3:
                    break
                state, here = last.state, frequency
            there = replace(scene, frequency=frequency)
            at_rest = Scales.of(there).unpack(state)
            yield frequency, drift(there, table, variant.spin, CAP, rates, at_rest, variant.stokes, variant.e_folds)


def _row(flight: Drift | None) -> dict[str, Any]:
    if flight is None:
        course = {name: np.full(SAMPLES, np.nan) for name in ("flight_time", "flight_distance")}
        return dict.fromkeys(COLUMNS, np.nan) | {"levitation_time": 0.0, "outcome": NO_EQUILIBRIUM} | course
    kept = flight.ended_by in ("duration", "balance")
    whole, late, early = (flight.fall_rate(*part) for part in ((0.0, 0.9), (0.6, 0.9), (0.0, 0.3)))
    times = np.linspace(0.0, flight.time[-1], SAMPLES)
    return {
        "levitation_time": CAP if kept else min(flight.levitated_s, CAP),
        "outcome": LEVITATES if kept else OUTCOMES.index(flight.ended_by),
        "distance_start": flight.distance[0],
        "distance_end": flight.distance[-1],
        "spin_end": flight.spin[-1],
        "fall_rate": whole,
        "fall_ratio": late / early,
        "balance_spin": flight.balance_spin,
        "growth": flight.growth_per_s.max(),
        "flight_time": times,
        "flight_distance": np.interp(times, flight.time, flight.distance),
    }


MARKS = dict(zip(OUTCOMES, ("v", "o", "X", "^", "|"), strict=True))
MEANINGS = ("touches the rotor", "falls (fold)", "lost in oscillations", "levitates for 250 s", "no equilibrium")
"""Of the outcomes, in a legend."""
BANDS = {
    "displacement": "displacement ±0.2 mm, ±0.5 mm or ±0.5°",
    "spin": "spin at release ±0.1",
    "conductivity": "conductivity −20 … +80 %",
    "remanence": "remanence 1.29 … 1.32 T",
}
LINES = {
    "complete": ("-", "mutual magnetisation, currents in the rotor too"),
    "rough release": ("--", "oscillation from 0.1 mm, not 3 µm"),
    "Stokes drag": (":", "air after Stokes"),
}
REPORTED = {
    "horizontal 1 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "horizontal 1.5 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "vertical 14 mm": {60: "24 hours"},
    "vertical 12.6 mm": {60: "24 hours"},
}  # What the article saw (δx = 1 mm and δz = 14 mm there), by frequency in Hz
ENDS = {"linear fall": ":", "stable": "-", "oscillating loss": "--", "24 hours": "-."}


@drawn
def times_figure(result: xr.Dataset) -> Figure:
    """Levitation time of each rotor against frequency, with the bands of what is not known well."""
    figure, rows = _rotors(result, "frequency (Hz)", "levitation time (s)")
    for panel, case, rotor in rows:
        _times(panel, rotor)
        for frequency, end in REPORTED.get(case, {}).items():
            panel.axvline(frequency, ls=ENDS[end], color=PALETTE[3], lw=1.0, label=f"article: {end}")
    first = rows[0][0]
    explain(first, {words: MARKS[name] for name, words in zip(OUTCOMES, MEANINGS, strict=True)}, color=PALETTE[0], ms=4)
    return figure


@styled
def flights_figure(result: xr.Dataset) -> Figure:
    """Distance against time in some nominal flights of each rotor, their frequencies by colour."""
    figure, rows = _rotors(result, "time (s)", "distance (mm)")
    for panel, _, rotor in rows:
        nominal, frequency = rotor.sel(variant="nominal"), rotor["frequency"].values
        counted = np.flatnonzero(nominal["levitation_time"].values >= float(result.attrs["shortest_s"]))
        shown = counted[np.unique(np.linspace(0, max(len(counted) - 1, 0), 6).astype(int))] if len(counted) else []
        for k, color in zip(shown, PALETTE, strict=False):
            time, distance = nominal["flight_time"][k], 1e3 * nominal["flight_distance"][k]
            panel.plot(time, distance, color=color, label=f"{frequency[k]:.3g} Hz")
            panel.plot(time[-1], distance[-1], MARKS[OUTCOMES[int(nominal["outcome"][k])]], color=color, ms=4)
        if len(shown):
            panel.legend(ncols=2)
        low, high = panel.get_ylim()
        panel.set_ylim(low, high + 0.6 * (high - low))  # room for the legend
    return figure


def _rotors(result: xr.Dataset, xlabel: str, ylabel: str) -> tuple[Figure, list[tuple[Axes, str, xr.Dataset]]]:
    """A panel for each rotor, in the order of its displacement or tilt, with its name and its part of the result."""
    cases = sorted(result["case"].values.tolist(), key=lambda name: CASES[name][:2])
    figure, axes = small_multiples([case.replace(" deg", "°") for case in cases], 2.2, 3, xlabel, ylabel)
    return figure, [(panel, case, result.sel(case=case)) for panel, case in zip(axes, cases, strict=True)]


def _times(axes: Axes, result: xr.Dataset) -> None:
    frequency, time = result["frequency"].values, result["levitation_time"]
    variants = result["variant"].values.tolist()
    for (start, label), color in zip(BANDS.items(), ("0.6", *PALETTE[1:]), strict=False):
        names = ["nominal", *(v for v in variants if v.startswith(start))]
        if len(names) > 1:
            band = time.sel(variant=names).values
            low, high = np.fmin.reduce(band), np.fmax.reduce(band)
            axes.fill_between(frequency, low, high, color=color, alpha=0.28, lw=0, label=label)
    for name, (dashes, label) in LINES.items():
        if name in variants:
            axes.plot(frequency, time.sel(variant=name), dashes, color="0.25", lw=1, label=label)
    nominal, outcome = (result[name].sel(variant="nominal").values for name in ("levitation_time", "outcome"))
    axes.plot(frequency, nominal, color=PALETTE[0], lw=1.6, label="nominal")
    for number, name in enumerate(OUTCOMES):
        here = outcome == number
        axes.plot(frequency[here], nominal[here], MARKS[name], color=PALETTE[0], ms=3.5)
    axes.set(ylim=(-8, 262), xlim=(frequency[0], frequency[-1]))


def time_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for case in result["case"].values.tolist():
        for variant in ("nominal", "permeable", "complete"):
            if variant not in result["variant"]:
                continue
            chosen = result.sel(case=case, variant=variant)
            for number, name in enumerate(OUTCOMES):
                one = chosen.isel(step=(chosen["outcome"] == number).values)
                if not one.sizes["step"]:
                    continue
                scaled = [1e3 * one[key] for key in ("distance_start", "distance_end", "fall_rate")]
                values = (one["frequency"], one["levitation_time"], *scaled, one["fall_ratio"], one["balance_spin"])
                cells = [span(value) if number != NO_EQUILIBRIUM or not k else "" for k, value in enumerate(values)]
                rows.append((f"{case}, {variant}: {name}", *cells))
    head = ("flights", "at (Hz)", "time (s)", "from (mm)", "to (mm)", "fall (mm/s)", "late/early", "balance at spin")
    return text_table(head, rows)


STUDY = Study(
    name="levitation-time",
    summary="levitation time against frequency by the slow drift of the floater's spin",
    points=time_points,
    compute=levitation_times,
    gather=gather_times,
    figures={"levitation-time": times_figure, "levitation-time-flights": flights_figure},
    report=time_lines,
)
