"""How long does the floater stay up? Levitation time against frequency by the slow drift of its spin.

Real air and the floater's own currents are in every flight.  Variants of what is not known are flown by a rigid floater
below closed-form cuboids; `permeable` and `complete` add what rotor and floater do to each other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import xarray as xr

from ...dynamics.branches import LONG_STEPS, Family, follow_branch, frequencies, reference_state, spins
from ...dynamics.motion import Rates, Scales
from ...dynamics.slow_drift import Drift, drift
from ...dynamics.steady import EquilibriumError
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Drag, Scene
from ..article import levitation_of
from ..results import Point, Study, variable
from ..terminal import FieldModel
from .levitation_time_cases import (
    CASES,
    LEVITATES,
    NO_EQUILIBRIUM,
    OUTCOMES,
    QUICK,
    QUICK_VARIANTS,
    VARIANTS,
    Variant,
    scene_of,
)
from .levitation_time_figure import FIGURES, time_lines

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


STUDY = Study(
    name="levitation-time",
    summary="levitation time against frequency by the slow drift of the floater's spin",
    points=time_points,
    compute=levitation_times,
    gather=gather_times,
    figures=FIGURES,
    report=time_lines,
)
