"""Linear fall, stable and unstable flight: levitation distance against time, the article's last supplementary figure.

Its experiment had δx = 1 mm and fell at 115 Hz, stayed at 140 Hz and was lost in oscillations at 150 Hz.  Each flight
is simulated in full, from equilibrium with spin s = 0, and compared with the averaged flight along the branch of
equilibria.  In the motion are real air, eddy currents in floater and rotor, and that both magnetise each other; in that
of `quick` Stokes drag and the floater's currents alone.
"""

from dataclasses import replace

import numpy as np
import xarray as xr

from ...dynamics.branches import BranchPoint, kicked, levitating_branch
from ...dynamics.flights import Trajectory, flight_kind, simulate
from ...dynamics.motion import Rates, Scales
from ...dynamics.slow_drift import drift
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..article import FLIGHT, HIGHEST, article_scene, conducting, levitation_of
from ..results import Point, Study, by_case, one_case, variable
from .trajectories_figure import FIGURES, NONE, SHORT, flight_lines

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


STUDY = Study(
    name="trajectories",
    summary="linear fall, stable and unstable flight: the distance against time, simulated and averaged",
    points=flight_points,
    compute=trajectories,
    gather=by_case,
    figures=FIGURES,
    report=flight_lines,
)
