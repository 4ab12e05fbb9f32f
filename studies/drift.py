"""How long does the floater stay up? Levitation time against frequency by the slow drift of its spin."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import xarray as xr

from ..dynamics import Drift, Family, Rates, Steps, drift, find_equilibria, follow_branch
from ..dynamics.branch import frequencies, spins
from ..dynamics.equilibrium import EquilibriumError
from ..dynamics.state import Scales
from ..fem.models import rotor_table
from ..fem.table import FieldTable
from ..geometry import rotor
from ..geometry.box import Array
from ..geometry.scene import Drag, Floater, Scene
from .results import variable

CAP, SHORTEST = 250.0, 3.0
"""The article stopped a flight after 250 s, and did not count one of less than 3 s."""
CONDUCTIVITY = 6.7e5
"""Of sintered NdFeB, S/m; makers give 6.2e5 to 9e5."""
SAMPLES = 60
KEPT, NONE = 3, 4
OUTCOMES = ("contact", "fold", "instability", "levitates", "no equilibrium")


@dataclass(frozen=True)
class Case:
    """One rotor of the article: a maker of magnets, its displacement (m or rad), and frequencies, Hz.

    At `reference` it has an equilibrium for all variants; `lowest` and `highest` bound what is asked.
    """

    make: Callable[..., rotor.Rotor]
    size: float
    reference: float
    lowest: float
    highest: float


CASES = {
    "vertical 14 mm": Case(rotor.vertical, 14e-3, 78.0, 60.0, 88.0),
    "horizontal 1 mm": Case(rotor.horizontal, 1e-3, 195.0, 150.0, 222.0),
    "vertical 12 mm": Case(rotor.vertical, 12e-3, 70.0, 48.0, 80.0),
    "vertical 16 mm": Case(rotor.vertical, 16e-3, 95.0, 68.0, 110.0),
    "horizontal 2 mm": Case(rotor.horizontal, 2e-3, 120.0, 85.0, 180.0),
    "tilt 5 deg": Case(rotor.tilt, np.radians(5), 185.0, 140.0, 250.0),
    "tilt 10 deg": Case(rotor.tilt, np.radians(10), 110.0, 75.0, 170.0),
}
QUICK = ("vertical 14 mm", "horizontal 1 mm")


@dataclass(frozen=True)
class Variant:
    """What is not known of the experiment: release spin, remanence of all magnets (T), conductivity, the air's law."""

    spin: float = 0.0
    remanence: float = 1.305
    conductivity: float = CONDUCTIVITY
    stokes: bool = False


VARIANTS = {
    "nominal": Variant(),
    "spin -0.1": Variant(spin=-0.1),
    "spin +0.1": Variant(spin=0.1),
    "remanence 1.29 T": Variant(remanence=1.29),
    "remanence 1.32 T": Variant(remanence=1.32),
    "conductivity -20 %": Variant(conductivity=0.8 * CONDUCTIVITY),
    "conductivity +20 %": Variant(conductivity=1.2 * CONDUCTIVITY),
    "Stokes drag": Variant(stokes=True),
}
QUICK_VARIANTS = ("nominal", "spin -0.1", "spin +0.1", "remanence 1.29 T", "remanence 1.32 T", "Stokes drag")


def drift_study(quick: bool) -> xr.Dataset:
    """Levitation time, start and end of the averaged flight for every case, variant and frequency.

    Returns
    -------
    Dataset over `case`, `variant` and `step` of frequency; `quick` has two cases, fewer frequencies and variants, and
    point dipoles instead of cuboids (μr = 1).  Recoil permeability is 1.05 in the floater and left out in the rotor.
    """
    names, variants = (QUICK, QUICK_VARIANTS) if quick else (tuple(CASES), tuple(VARIANTS))
    steps, model = (11, "dipole") if quick else (29, "cuboid")
    grids = np.array([np.linspace(CASES[n].lowest, CASES[n].highest, steps) for n in names])
    pairs = [_rows(CASES[n], grid, variants, model) for n, grid in zip(names, grids, strict=True)]
    rows, courses = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    dims = ("case", "variant", "step")
    labels = {
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
    data = {name: variable(dims, rows[..., k], *label) for k, (name, label) in enumerate(labels.items())}
    course = ("case", "step", "sample")
    data["flight_time"] = variable(course, courses[..., 0, :], "s", "time")
    data["flight_distance"] = variable(course, courses[..., 1, :], "m", "distance from the rotor, nominal")
    frequency = variable(("case", "step"), grids, "Hz", "frequency of the rotor")
    coordinates = {"case": list(names), "variant": list(variants), "frequency": frequency}
    return xr.Dataset(data, coordinates, {"model": model, "cap_s": CAP, "shortest_s": SHORTEST})


def _rows(case: Case, grid: Array, variants: Sequence[str], model: str) -> tuple[Array, Array]:
    """Quantities (variant, frequency, quantity) of one case, and the nominal flights (frequency, 2, sample)."""
    scene = _scene(case, Variant())
    table = rotor_table(scene.rotor, model)
    rates = Rates.of(scene, table)
    found = min(find_equilibria(scene, table, rates=rates), key=lambda e: e.growth_per_s)
    rows, courses = [], np.full((len(grid), 2, SAMPLES), np.nan)
    for variant in (VARIANTS[name] for name in variants):
        scene = _scene(case, variant)
        if variant.remanence != Variant().remanence:
            table = rotor_table(scene.rotor, model)
            rates = Rates.of(scene, table)
        flights = dict(_flights(scene, table, rates, Scales.of(scene).pack(found.state), variant, grid))
        rows.append([_row(flights.get(f)) for f in grid])
        if variant == Variant():
            for k in (k for k, f in enumerate(grid) if f in flights):
                courses[k] = _course(flights[grid[k]])
    return np.array(rows), courses


def _course(flight: Drift) -> Array:
    """Time and distance (2, sample) of a flight."""
    times = np.linspace(0.0, flight.time[-1], SAMPLES)
    return np.array([times, np.interp(times, flight.time, flight.distance)])


def _scene(case: Case, variant: Variant) -> Scene:
    floater = Floater(6.35e-3, variant.remanence, 1.05, 7500.0, variant.conductivity)
    magnets = case.make(case.size, 10e-3, variant.remanence, 1.0)
    return Scene(case.reference, magnets, floater, Drag.stokes(floater.radius))


def _flights(
    scene: Scene, table: FieldTable, rates: Rates, start: Array, variant: Variant, grid: Array
) -> Iterator[tuple[float, Drift]]:
    """Flights at those frequencies that the branch of equilibria reaches, from the scene's own frequency both ways."""
    begin = follow_branch(Family(rates, spins(scene)), start, 0.0, variant.spin)[-1] if variant.spin else None
    start = begin.state if begin else start
    walk = partial(follow_branch, Family(rates, frequencies(scene, variant.spin), 50.0), steps=Steps(tolerated=np.inf))
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
            yield frequency, drift(there, table, variant.spin, CAP, rates, at_rest, variant.stokes)


def _row(flight: Drift | None) -> list[float]:
    if flight is None:
        return [0.0, NONE, *[np.nan] * 7]
    kept = flight.ended_by in ("duration", "balance")
    outcome = KEPT if kept else OUTCOMES.index(flight.ended_by)
    rates = [flight.fall_rate(*part) for part in ((0.0, 0.9), (0.6, 0.9), (0.0, 0.3))]
    return [
        CAP if kept else min(flight.levitated_s, CAP), outcome, flight.distance[0], flight.distance[-1],
        flight.spin[-1], rates[0], rates[1] / rates[2], flight.balance_spin, flight.growth_per_s.max(),
    ]  # fmt: skip
