"""Linear fall, stable and unstable flight: levitation distance against time, the article's last supplementary figure.

Its experiment had δx = 1 mm and fell at 115 Hz, stayed at 140 Hz and was lost in oscillations at 150 Hz.  Each flight
is simulated in full, from equilibrium with spin s = 0, and compared with the averaged flight along the branch of
equilibria.  In the motion are real air, eddy currents in floater and rotor, and that both magnetise each other; in that
of `quick` Stokes drag and the floater's currents alone.
"""

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.branch import BranchPoint
from ...dynamics.continuation.frequencies import kicked, levitating_branch
from ...dynamics.continuation.slow_drift import drift
from ...dynamics.flights.flight import simulate
from ...dynamics.flights.trajectory import Trajectory, flight_kind
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.state import Scales
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.style import PAGE, PALETTE, panels, styled
from ..result import variable
from ..study import Point, Study, by_case, one_case
from .article import FLIGHT, HIGHEST, article_scene, conducting, levitation_of, rotor_label

FREQUENCIES = (115.0, 140.0, 150.0, 160.0, 170.0, 200.0)
DISPLACEMENTS = (1.0, 1.5, 2.0)
"""δx in mm: as in the experiment, what gives its fall at 115 Hz, and what is lost in oscillations within these."""
KICK = 1e-3
"""Speed with which a flight begins upwards, m/s."""
PARTS, SAMPLES = 400, 100
SHORTEST = 3.0
"""What stays up for less, the article does not call levitation, s."""


def flight_points(quick: bool) -> list[Point]:
    """The displacements, flown for 60 s in the field of finite elements, `quick` in the dipole's."""
    model, seconds = ("dipole" if quick else "fem"), 60.0
    asked = {"configuration": "horizontal", "model": model, "duration_s": seconds, "complete": not quick}
    return [{**asked, "value": value} for value in DISPLACEMENTS]


def trajectories(point: Point) -> xr.Dataset:
    """The flights of one rotor.

    Returns
    -------
    Dataset over `frequency`: what became of the simulated flight and of the averaged one; over `part` of the flight:
    its time, and the least, mean and largest distance along the axis; over `sample`: the averaged flight.
    """
    complete = point.get("complete", False)
    scene = conducting(article_scene(point["configuration"], point["value"], HIGHEST), rotor=complete)
    scene = replace(scene, drag=replace(scene.drag, air=complete))
    levitation = levitation_of(scene, point["model"], interaction="auto" if complete else "rigid")
    table, rates = levitation.interaction, levitation.rates
    starts = levitating_branch(scene, table, rates, HIGHEST).side("near", np.array(FREQUENCIES))
    rows = [_row(scene, table, rates, start, point["duration_s"]) for start in starts]
    data = {
        name: variable(("frequency", *dims), np.array([row[name] for row in rows]), unit, text)
        for name, (dims, unit, text) in COLUMNS.items()
    }
    kinds = {name: (("frequency",), [str(row[name]) for row in rows]) for name in ("kind", "averaged_end")}
    frequency = variable(("frequency",), np.array(FREQUENCIES), "Hz", "frequency of the rotor")
    return one_case(point, xr.Dataset({**data, **kinds}, {"frequency": frequency}))


COLUMNS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "levitated": ((), "s", "time until the loss in the simulated flight, or its duration"),
    "averaged_levitated": ((), "s", "the same in the averaged flight; infinite for a balance"),
    "growth": ((), "1/s", "largest growth rate of a small motion at the start"),
    "energy_error": ((), "1", "largest violation of the ledger of energy"),
    "time": (("part",), "s", "middle of a part of the simulated flight"),
    "lowest": (("part",), "m", "least distance in the part"),
    "mean": (("part",), "m", "mean distance in the part"),
    "highest": (("part",), "m", "largest distance in the part"),
    "averaged_time": (("sample",), "s", "time of the averaged flight"),
    "averaged_distance": (("sample",), "m", "distance of the averaged flight"),
}
LENGTHS = {"part": PARTS, "sample": SAMPLES}


def _row(
    scene: Scene, table: FieldTable, rates: Rates, start: BranchPoint | None, seconds: float
) -> dict[str, Array | str]:
    if start is None:
        empty = {name: np.full([LENGTHS[d] for d in dims], np.nan) for name, (dims, _, _) in COLUMNS.items()}
        return {**empty, "kind": NONE, "averaged_end": NONE}
    there = replace(scene, frequency=start.parameter)
    state = Scales.of(there).unpack(start.state)
    slow = drift(there, table, 0.0, FLIGHT, rates, state, stokes=True)
    times = np.linspace(0.0, slow.time[-1], SAMPLES)
    flight = simulate(kicked(there, start, KICK), table, seconds, [])
    return {
        **_parts(flight),
        "kind": _kind(flight),
        "averaged_end": slow.ended_by,
        "levitated": np.array(flight.levitated_s),
        "averaged_levitated": np.array(slow.levitated_s),
        "growth": np.array(start.growth_per_s),
        "energy_error": np.array(flight.energy_error),
        "averaged_time": times,
        "averaged_distance": np.interp(times, slow.time, slow.distance),
    }


def _parts(flight: Trajectory) -> dict[str, Array]:
    """Time, and least, mean and largest distance in equal parts of a flight; NaN in parts without a sample."""
    edges = np.linspace(0.0, flight.time[-1], PARTS + 1)
    place = np.clip(np.searchsorted(edges, flight.time, side="right") - 1, 0, PARTS - 1)
    distance = -flight.lab.position[:, 2]
    found = {name: np.full(PARTS, np.nan) for name in ("lowest", "mean", "highest")}
    for part in np.unique(place):
        here = distance[place == part]
        found["lowest"][part], found["mean"][part], found["highest"][part] = here.min(), here.mean(), here.max()
    return {"time": (edges[1:] + edges[:-1]) / 2, **found}


def _kind(flight: Trajectory) -> str:
    lost_at_once = flight.ended_by != "duration" and flight.levitated_s < SHORTEST
    return SHORT if lost_at_once else flight_kind(flight)


TOLD = {115.0: "linear fall", 140.0: "stable", 150.0: "oscillating loss"}
"""The article's three flights, by frequency in Hz."""
NONE, SHORT = "no equilibrium", "lost within 3 s"
"""Of a flight that is none."""
LOST = (SHORT, "linear fall", "oscillating loss")


@styled
def flight_figure(result: xr.Dataset) -> Figure:
    """The distance in each flight, one panel for each displacement."""
    figure, (axes,) = panels(1, result.sizes["case"], (PAGE, 4.2), sharey=True)
    for panel, k in zip(axes, range(result.sizes["case"]), strict=True):
        rotor = result.isel(case=k)
        for one, color in zip(range(rotor.sizes["frequency"]), PALETTE, strict=False):
            _flight(panel, rotor.isel(frequency=one), color)
        panel.set(xlabel="time (s)", ylim=(11, 40))
        panel.set_title(rotor_label("horizontal", float(rotor["value"])))
        panel.plot([], [], "--", color="0.3", label="averaged flight")
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17))
    axes[0].set_ylabel("levitation distance (mm)")
    return figure


FIGURES = {"trajectories": flight_figure}


def _flight(axes: Axes, flight: xr.Dataset, color: str) -> None:
    kind = str(flight["kind"].values)
    text = f"{float(flight['frequency']):g} Hz: {kind}"
    if kind == NONE:
        axes.plot([], [], color=color, label=text)
        return
    time = flight["time"].values
    low, mean, high = (1e3 * flight[name].values for name in ("lowest", "mean", "highest"))
    axes.fill_between(time, low, high, color=color, alpha=0.3, lw=0)
    axes.plot(time, mean, color=color, label=text)
    axes.plot(flight["averaged_time"], 1e3 * flight["averaged_distance"], "--", color="k", lw=0.7)
    if kind in LOST:
        last = np.flatnonzero(np.isfinite(mean))[-1]
        axes.plot(time[last], min(mean[last], 34), "x", color=color)


def flight_lines(result: xr.Dataset) -> list[str]:
    """What became of each flight, simulated and averaged, beside what the article saw at that frequency."""
    lines = []
    for k in range(result.sizes["case"]):
        rotor = result.isel(case=k)
        for frequency in rotor["frequency"].values:
            one = rotor.sel(frequency=frequency)
            told = f"; the article, δx = 1 mm: {TOLD[frequency]}" if frequency in TOLD else ""
            where = f"{rotor_label('horizontal', float(rotor['value']))}, {frequency:g} Hz: {one['kind'].values}"
            if str(one["kind"].values) == NONE:
                lines.append(f"{where}{told}.")
                continue
            mean = 1e3 * one["mean"].dropna("part").values
            growth, ledger = float(one["growth"]), float(one["energy_error"])
            lines.append(
                f"{where} after {float(one['levitated']):.2f} s, from {mean[0]:.2f} mm to {mean[-2]:.2f} mm{told}. "
                f"Averaged: {one['averaged_end'].values} after {float(one['averaged_levitated']):.2f} s; "
                f"growth at the start {growth:.2g} /s, ledger of energy to {ledger:.0e}."
            )
    return lines


STUDY = Study(
    name="trajectories",
    summary="linear fall, stable and unstable flight: the distance against time, simulated and averaged",
    points=flight_points,
    compute=trajectories,
    gather=by_case,
    figures=FIGURES,
    report=flight_lines,
)
