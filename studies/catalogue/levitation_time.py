"""The rotors whose drift is studied, and what is not known of the experiment."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

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
from ...geometry.magnets import Magnet
from ...geometry.rotor import horizontal, tilt, vertical
from ...geometry.scene.contents import Drag, Floater, Scene
from ..cli.options import FieldModel
from ..figures.style import PAGE, PALETTE, panels, styled
from ..result import variable
from ..study import Point, Study
from .article import levitation_of


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


CAP, SHORTEST = 250.0, 3.0
"""The article stopped a flight after 250 s, and did not count one of less than 3 s."""
SAMPLES = 60
QUANTITIES = {
    "levitation_time": ("s", f"time until the loss, at most {CAP:g} s"),
    "outcome": ("1", "how it ended: " + ", ".join(f"{k} {name}" for k, name in enumerate(OUTCOMES))),
    "distance_start": ("m", "distance from the rotor at the start"),
    "distance_end": ("m", "distance at the end or the cap"),
    "spin_end": ("1", "body spin at the end or the cap"),
    "fall_rate": ("m/s", "mean rate of fall over the first nine tenths of the flight"),
    "fall_ratio": ("1", "rate of fall from 0.6 to 0.9 of the flight over that from 0 to 0.3"),
    "balance_spin": ("1", "body spin at which drag and eddy currents balance"),
    "growth": ("1/s", "largest growth of small motions during the flight"),
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
    rows = np.array([_row(flights.get(f)) for f in grid])
    courses = np.array([_course(flights.get(f)) for f in grid])
    dims = ("case", "variant", "step")
    data = {name: variable(dims, rows[None, None, :, k], *label) for k, (name, label) in enumerate(QUANTITIES.items())}
    course = (*dims, "sample")
    data["flight_time"] = variable(course, courses[None, None, :, 0], "s", "time")
    data["flight_distance"] = variable(course, courses[None, None, :, 1], "m", "distance from the rotor")
    frequency = variable(("case", "step"), grid[None], "Hz", "frequency of the rotor")
    coordinates = {"case": [point["case"]], "variant": [point["variant"]], "frequency": frequency}
    return xr.Dataset(data, coordinates, {"model": point["model"], "cap_s": CAP, "shortest_s": SHORTEST})


def gather_times(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """All rows by `case` and `variant`; NaN where one is missing."""
    together: dict[str, list[xr.Dataset]] = {}
    for part in parts:
        together.setdefault(str(part["case"].item()), []).append(part)
    cases = [
        xr.concat(rows, "variant", data_vars="all", coords="minimal", compat="override") for rows in together.values()
    ]
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


def _course(flight: Drift | None) -> Array:
    """Time and distance (2, sample) of a flight."""
    if flight is None:
        return np.full((2, SAMPLES), np.nan)
    times = np.linspace(0.0, flight.time[-1], SAMPLES)
    return np.array([times, np.interp(times, flight.time, flight.distance)])


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


def _row(flight: Drift | None) -> list[float]:
    if flight is None:
        return [0.0, NO_EQUILIBRIUM, *[np.nan] * 7]
    kept = flight.ended_by in ("duration", "balance")
    outcome = LEVITATES if kept else OUTCOMES.index(flight.ended_by)
    rates = [flight.fall_rate(*part) for part in ((0.0, 0.9), (0.6, 0.9), (0.0, 0.3))]
    return [
        CAP if kept else min(flight.levitated_s, CAP), outcome, flight.distance[0], flight.distance[-1],
        flight.spin[-1], rates[0], rates[1] / rates[2], flight.balance_spin, flight.growth_per_s.max(),
    ]  # fmt: skip


MARKS = dict(zip(OUTCOMES, ("v", "o", "X", "^", "|"), strict=True))
MEANINGS = {
    "contact": "touches the rotor",
    "fold": "sinks until it is lost (fold)",
    "instability": "oscillates until it is lost",
    "levitates": "still up after 250 s",
    "no equilibrium": "no equilibrium",
}
BANDS = {
    "displacement": "displacement ±0.2 mm, ±0.5 mm or ±0.5°",
    "spin": "spin at release ±0.1",
    "conductivity": "conductivity −20 … +80 %",
    "remanence": "remanence 1.29 … 1.32 T",
}
LINES = {
    "complete": ("-", "complete: mutual magnetisation, currents in the rotor too"),
    "rough release": ("--", "oscillation from 0.1 mm, not 3 µm"),
    "Stokes drag": (":", "air after Stokes"),
}
FLOWN = {
    "horizontal 1 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "horizontal 1.5 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "vertical 14 mm": {60: "24 hours"},
    "vertical 12.6 mm": {60: "24 hours"},
}
"""What the article saw (δx = 1 mm and δz = 14 mm there), by frequency in Hz."""


@styled
def times_figure(result: xr.Dataset) -> Figure:
    """Levitation time of each rotor against frequency, with the bands of what is not known well."""
    figure, axes = _one_panel_each(result)
    for panel, case in zip(axes.flat, result["case"].values.tolist(), strict=False):
        _times(panel, result.sel(case=case), FLOWN.get(case, {}))
    for row in axes:
        row[0].set_ylabel("levitation time (s)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    for name in OUTCOMES:
        handles += axes[0, 0].plot([], [], MARKS[name], color=PALETTE[0], ms=5)
        labels.append(MEANINGS[name])
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


@styled
def flights_figure(result: xr.Dataset) -> Figure:
    """Distance against time in some nominal flights of each rotor."""
    figure, axes = _one_panel_each(result)
    for panel, case in zip(axes.flat, result["case"].values.tolist(), strict=False):
        _flights_figure(panel, result.sel(case=case))
    for row in axes:
        row[0].set_ylabel("distance (mm)")
    return figure


FIGURES = {"levitation-time": times_figure, "levitation-time-flights": flights_figure}


def _one_panel_each(result: xr.Dataset) -> tuple[Figure, Any]:
    """A panel for each rotor, three in a row."""
    cases = result["case"].values.tolist()
    columns = min(3, len(cases))
    rows = -(-len(cases) // columns)
    figure, axes = panels(rows, columns, (PAGE, 2.2 * rows + 0.7))
    for panel, case in zip(axes.flat, cases, strict=False):
        panel.set_title(case.replace(" deg", "°"))
    for unused in axes.flat[len(cases) :]:
        unused.remove()
    return figure, axes


def _times(axes: Axes, result: xr.Dataset, flown: dict[int, str]) -> None:
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
    nominal = time.sel(variant="nominal").values
    axes.plot(frequency, nominal, color=PALETTE[0], lw=1.6, label="nominal")
    outcome = result["outcome"].sel(variant="nominal").values
    for number, name in enumerate(OUTCOMES):
        here = outcome == number
        axes.plot(frequency[here], nominal[here], MARKS[name], color=PALETTE[0], ms=3.5)
    for seen, word in flown.items():
        axes.axvline(seen, color=PALETTE[3], lw=0.8)
        words = axes.text(seen, 245, f"{seen} Hz {word}", rotation=90, ha="center", va="top", color=PALETTE[3], size=7)
        words.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85})
    axes.set(xlabel="frequency (Hz)", ylim=(-8, 262), xlim=(frequency[0], frequency[-1]))


def _flights_figure(axes: Axes, result: xr.Dataset) -> None:
    nominal = result.sel(variant="nominal")
    frequency = result["frequency"].values
    flown = np.flatnonzero(nominal["levitation_time"].values >= float(result.attrs["shortest_s"]))
    falls = flown[nominal["outcome"].values[flown] != LEVITATES]
    lasts = flown[nominal["outcome"].values[flown] == LEVITATES]
    shown = np.unique([*falls[:: max(1, -(-len(falls) // 4))], *lasts[:: max(1, -(-len(lasts) // 3))]]).astype(int)
    for number, k in enumerate(shown):
        color = PALETTE[number % len(PALETTE)]
        time, distance = nominal["flight_time"][k].values, 1e3 * nominal["flight_distance"][k].values
        axes.plot(time, distance, color=color)
        fold = OUTCOMES[int(nominal["outcome"][k])] == "fold"
        way = {"rotation": 60, "rotation_mode": "anchor"} if fold else {"va": "center"}
        axes.annotate(f" {frequency[k]:.3g} Hz", (time[-1], distance[-1]), color=color, size=7, ha="left", **way)
    low, high = axes.get_ylim()
    axes.set(xlabel="time (s)", xlim=(0, 330), ylim=(low, high + 0.25 * (high - low)))  # room for words above folds


def time_lines(result: xr.Dataset) -> list[str]:
    """For each rotor: where flights end in the fold, where they last and where they are unstable."""
    lines = []
    for case in result["case"].values.tolist():
        for variant in ("nominal", "permeable", "complete"):
            if variant not in result["variant"]:
                continue
            chosen = result.sel(case=case, variant=variant)
            lines.append(f"{case}{'' if variant == 'nominal' else f', {variant}'}:")
            lines += [line for number in range(len(OUTCOMES)) if (line := _line(chosen, number))]
    return lines


def _line(nominal: xr.Dataset, number: int) -> str:
    """What is to be said of all flights of one outcome; nothing if there is none."""
    here = (nominal["outcome"] == number).values
    if not here.any():
        return ""
    chosen, name = nominal.isel(step=here), OUTCOMES[number]
    span = f"{_span(chosen['frequency'])} Hz"
    if name == "no equilibrium":
        return f"  none at {span}"
    words = f"  {name} at {span}: {_span(chosen['levitation_time'])} s, "
    words += f"from {_span(1e3 * chosen['distance_start'])} to {_span(1e3 * chosen['distance_end'])} mm"
    if name == "fold":
        words += f", falling {_span(1e3 * chosen['fall_rate'])} mm/s, late over early {_span(chosen['fall_ratio'])}"
    if number == LEVITATES:
        endless = np.isfinite(chosen["balance_spin"].values)
        words += f"; with a balance ahead: {endless.sum()} of {len(endless)}, s* {_span(chosen['balance_spin'])}"
        words += f"; largest growth {_span(chosen['growth'])} /s"
    return words


def _span(values: xr.DataArray) -> str:
    known = values.values[np.isfinite(values.values)]
    if not len(known):
        return "unknown"
    low, high = (f"{value:.3g}" for value in (known.min(), known.max()))
    return low if low == high else f"{low}–{high}"


STUDY = Study(
    name="levitation-time",
    summary="levitation time against frequency by the slow drift of the floater's spin",
    points=time_points,
    compute=levitation_times,
    gather=gather_times,
    figures=FIGURES,
    report=time_lines,
)
