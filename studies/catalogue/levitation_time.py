"""Levitation time against frequency by the slow drift of the spin, with what is not known of the experiment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.branch import Family, follow_branch, frequencies, spins
from ...dynamics.continuation.frequencies import LONG_STEPS, UNIT, reference_state
from ...dynamics.continuation.slow_drift import E_FOLDS, Drift, drift
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...dynamics.motion.state import Scales
from ...geometry.common import MAGNET_CONDUCTIVITY
from ...geometry.scene.contents import Scene
from ..figures.style import PALETTE, styled
from ..result import Columns, columns, variable
from ..study import Point, Study
from .article import FLOATER, PERMEABILITY, REMANENCE, levitation_of, losses, rotor_label, rotor_scene
from .showing import each, small_multiples, span, text_table


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
}  # Rotors of the article, and two whose displacement is chosen so that they levitate where the article's did
TOLERANCES = {"horizontal": 0.2, "vertical": 0.5, "tilt": 0.5}  # Of the displacement or tilt, mm or degrees
QUICK = ("horizontal 1 mm", "vertical 14 mm")
OUTCOMES = ("contact", "fold", "instability", "levitates", "no equilibrium")  # How a trajectory may end
LEVITATES, NO_EQUILIBRIUM = 3, 4  # Numbers of two of these


@dataclass(frozen=True)
class Variant:
    """What is not known of the experiment."""

    spin: float = 0.0  # at release
    remanence: float = REMANENCE  # of all magnets, T
    conductivity: float = MAGNET_CONDUCTIVITY  # of the floater, S/m
    stokes: bool = False  # whether the air's drag is Stokes's
    e_folds: float = E_FOLDS  # growth of an oscillation that ends the trajectory
    misplaced: float = 0.0  # error of the rotor's displacement, in units of its tolerance
    # "rigid": closed form of μr = 1, no mutual magnetisation; "permeable": by finite elements with μr = 1.05, rotor and
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


def scenes_of(case: DriftCase, variant: Variant) -> tuple[Scene, Scene]:
    """The scene of a case at its reference frequency, and that scene without losses."""
    rotor = case.configuration, case.measure + variant.misplaced * TOLERANCES[case.configuration], case.reference
    ball, remanence = replace(FLOATER, remanence=variant.remanence), variant.remanence
    permeability = 1.0 if variant.rotor == "rigid" else PERMEABILITY
    still = rotor_scene(*rotor, drag=False, remanence=remanence, permeability=permeability, floater=ball)
    scene = replace(still, **losses(still, variant.rotor == "conducting", False))
    return replace(scene, floater=replace(scene.floater, conductivity=variant.conductivity)), still


CAP, SHORTEST = 250.0, 3.0  # The article stopped a trajectory after 250 s, and did not count one of less than 3 s
SAMPLES = 60
STEP = ("case", "variant", "step")
COLUMNS: Columns = {
    "levitation_time": (STEP, "s", f"time until the loss, at most {CAP:g} s"),
    "outcome": (STEP, "1", "how it ended: " + ", ".join(f"{k} {name}" for k, name in enumerate(OUTCOMES))),
    "distance_start": (STEP, "m", "distance from the rotor at the start"),
    "distance_end": (STEP, "m", "distance at the end or the cap"),
    "spin_end": (STEP, "1", "body spin at the end or the cap"),
    "fall_rate": (STEP, "m/s", "mean rate of fall over the first nine tenths of the trajectory"),
    "fall_ratio": (STEP, "1", "rate of fall from 0.6 to 0.9 of the trajectory over that from 0 to 0.3"),
    "balance_spin": (STEP, "1", "body spin at which drag and eddy currents balance"),
    "growth": (STEP, "1/s", "largest growth rate of a mode during the trajectory"),
    "flight_time": ((*STEP, "sample"), "s", "time"),
    "flight_distance": ((*STEP, "sample"), "m", "distance from the rotor"),
}


def time_points(quick: bool) -> list[Point]:
    names, variants = (QUICK, QUICK_VARIANTS) if quick else (tuple(CASES), tuple(VARIANTS))
    steps, model = (11, "dipole") if quick else (36, "cuboid")
    models = {v: model if VARIANTS[v].rotor == "rigid" else "fem" for v in variants}
    return [{"case": c, "variant": v, "steps": steps, "model": models[v]} for c in names for v in variants]


def levitation_times(point: Point) -> xr.Dataset:
    case, variant, model = CASES[point["case"]], VARIANTS[point["variant"]], point["model"]
    grid, (scene, still) = np.linspace(case.lowest, case.highest, point["steps"]), scenes_of(case, variant)
    levitation = levitation_of(scene, model, interaction="rigid" if model != "fem" else "mutual")
    rates = levitation.rates
    at_rest, spun = (Family(rates, frequencies(scene, spin), UNIT) for spin in (0.0, variant.spin))
    start = follow_branch(at_rest, *reference_state(still), scene.frequency, LONG_STEPS, tolerated=np.inf)[-1].state
    if variant.spin:
        start = follow_branch(Family(rates, spins(scene)), start, 0.0, variant.spin)[-1].state
    found = {name: np.full((len(grid), SAMPLES)[: len(dims) - 2], np.nan) for name, (dims, *_) in COLUMNS.items()}
    found["levitation_time"][:], found["outcome"][:] = 0.0, NO_EQUILIBRIUM
    for side in (np.flatnonzero(grid <= scene.frequency)[::-1], np.flatnonzero(grid > scene.frequency)):
        state, here = start, scene.frequency
        for k in side:
            if grid[k] != here:
                try:
                    last = follow_branch(spun, state, here, grid[k], tolerated=np.inf)[-1]
                except EquilibriumError:
                    break
                if last.parameter != grid[k] or last.growth_per_s > 1e3:
                    break
                state, here = last.state, grid[k]
            there = replace(scene, frequency=grid[k])
            release, how = Scales.of(there).unpack(state), (variant.stokes, variant.e_folds)
            row = _row(drift(there, levitation.table, variant.spin, CAP, rates, release, *how))
            for values, value in zip(found.values(), row, strict=True):
                values[k] = value
    frequency = variable(("case", "step"), grid[None], "Hz", "frequency of the rotor")
    coordinates = {"case": [point["case"]], "variant": [point["variant"]], "frequency": frequency}
    attributes = {"model": model, "cap_s": CAP, "shortest_s": SHORTEST}
    data = columns(COLUMNS, {name: values[None, None] for name, values in found.items()})
    return xr.Dataset(data, coordinates, attributes)


def _row(flight: Drift) -> tuple[Any, ...]:
    kept, times = flight.ended_by in ("duration", "balance"), np.linspace(0.0, flight.time[-1], SAMPLES)
    lasted = (CAP, LEVITATES) if kept else (min(flight.levitated_s, CAP), OUTCOMES.index(flight.ended_by))
    ends = flight.distance[0], flight.distance[-1], flight.spin[-1]
    falls = flight.fall_rate(0.0, 0.9), flight.fall_rate(0.6, 0.9) / flight.fall_rate(0.0, 0.3)
    path = times, np.interp(times, flight.time, flight.distance)
    return *lasted, *ends, *falls, flight.balance_spin, flight.growth_per_s.max(), *path


def gather_times(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    names = dict.fromkeys(part["case"].item() for part in parts)
    rotors = [[part for part in parts if part["case"].item() == name] for name in names]
    cases = [xr.concat(rows, "variant", data_vars="all", coords="minimal", compat="override") for rows in rotors]
    return xr.concat(cases, "case", data_vars="all", coords="different", compat="equals", join="outer")


# Of the outcomes, and what these are called in a legend
MARKS = {"v": "touches the rotor", "o": "lost at the fold", "X": "lost in oscillations", "^": "levitates for 250 s"}
MARKS["|"] = "no equilibrium"
BANDS = {
    "displacement": "displacement ±0.2 mm, ±0.5 mm or ±0.5°",
    "spin": "spin at release ±0.1",
    "conductivity": "conductivity −20 … +80 %",
    "remanence": "remanence 1.29 … 1.32 T",
}
LINES = {
    "complete": ("-", "mutual magnetisation, currents in the rotor too"),
    "rough release": ("--", "oscillation from 0.1 mm, not 3 µm"),
    "Stokes drag": (":", "Stokes drag"),
}
REPORTED = {
    "horizontal 1 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "horizontal 1.5 mm": {115: "linear fall", 140: "stable", 150: "oscillating loss"},
    "vertical 14 mm": {60: "24 hours"},
    "vertical 12.6 mm": {60: "24 hours"},
}  # What the article saw (δx = 1 mm and δz = 14 mm there), by frequency in Hz
ENDS = {"linear fall": ":", "stable": "-", "oscillating loss": "--", "24 hours": "-."}


def _rotors(result: xr.Dataset) -> dict[str, xr.Dataset]:
    cases = sorted(result["case"].values.tolist(), key=lambda name: CASES[name][:2])
    return {rotor_label(*CASES[case][:2]): result.sel(case=case) for case in cases}


@each(small_multiples, 2.2, 3, "frequency (Hz)", "levitation time (s)", of=_rotors)
def times_figure(panel: Axes, rotor: xr.Dataset) -> None:
    """Levitation time of each rotor against frequency, with the bands of what is not known well."""
    variants = rotor["variant"].values.tolist()
    frequency, time = rotor["frequency"].values, rotor["levitation_time"]
    for (start, label), color in zip(BANDS.items(), ("0.6", *PALETTE[1:]), strict=False):
        names = ["nominal", *(v for v in variants if v.startswith(start))]
        if len(names) > 1:
            band = time.sel(variant=names)
            low, high = band.min("variant"), band.max("variant")
            panel.fill_between(frequency, low, high, color=color, alpha=0.28, lw=0, label=label)
    for name, (dashes, label) in LINES.items():
        if name in variants:
            panel.plot(frequency, time.sel(variant=name), dashes, color="0.25", lw=1, label=label)
    nominal, outcome = (rotor[name].sel(variant="nominal") for name in ("levitation_time", "outcome"))
    panel.plot(frequency, nominal, color=PALETTE[0], lw=1.6, label="nominal")
    for number, (mark, words) in enumerate(MARKS.items()):
        if (outcome == number).any():
            panel.plot(frequency, nominal.where(outcome == number), mark, color=PALETTE[0], ms=3.5, label=words)
    for there, end in REPORTED.get(rotor["case"].item(), {}).items():
        panel.axvline(there, ls=ENDS[end], color=PALETTE[3], lw=1.0, label=f"article: {end}")
    panel.set(ylim=(-8, 262), xlim=(frequency[0], frequency[-1]))


@styled
def flights_figure(result: xr.Dataset) -> Figure:
    """Distance against time in some nominal trajectories of each rotor, their frequencies by colour."""
    figure, rows = small_multiples(_rotors(result), 2.2, 3, "time (s)", "levitation distance (mm)")
    for panel, rotor in rows:
        nominal, frequency = rotor.sel(variant="nominal"), rotor["frequency"].values
        counted = np.flatnonzero(nominal["levitation_time"].values >= float(result.attrs["shortest_s"]))
        shown = counted[np.unique(np.linspace(0, max(len(counted) - 1, 0), 6).astype(int))] if len(counted) else []
        for k, color in zip(shown, PALETTE, strict=False):
            time, distance = nominal["flight_time"][k], 1e3 * nominal["flight_distance"][k]
            panel.plot(time, distance, color=color, label=f"{frequency[k]:.3g} Hz")
            panel.plot(time[-1], distance[-1], list(MARKS)[int(nominal["outcome"][k])], color=color, ms=4)
        if len(shown):
            panel.legend(ncols=2)
        low, high = panel.get_ylim()
        panel.set_ylim(low, high + 0.6 * (high - low))  # room for the legend
    return figure


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
    head = ("outcome", "at (Hz)", "time (s)", "from (mm)", "to (mm)", "fall (mm/s)", "late/early", "balance at spin")
    return text_table(head, rows)


STUDY = Study(
    name="levitation-time",
    summary="levitation time against frequency by the slow drift of the floater's spin",
    quick="all but two rotors and six variants, two thirds of the frequencies; point dipoles instead of cuboids",
    points=time_points,
    compute=levitation_times,
    gather=gather_times,
    figures={"levitation-time": times_figure, "levitation-time-flights": flights_figure},
    report=time_lines,
)
