"""The small circle on which the floater goes with the rotor: its radius in the true field, in flight and by formula."""

import numpy as np
import xarray as xr

from ...dynamics.branches import BranchPoint, kicked, levitating_branch
from ...dynamics.flights import simulate
from ...fem.rotor_tables import RotorTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..article import CONFIGURATIONS, HIGHEST, LOWEST, QUICK, article_scene, levitation_of, side_radius
from ..one_scene import sources
from ..results import Columns, Point, Study, by_case, columns, one_case, variable
from .side_mode_figure import FIGURES, FLOWN_HZ, TURNS, side_lines

MODELS = ("dipole", "fem")
KICK, SECONDS, SAMPLES = 0.01, 2.0, 400
"""Speed upwards with which the flight begins, m/s; its duration, s; samples of its last turns that are kept."""


def side_points(quick: bool) -> list[Point]:
    """Every rotor that levitated in the article's experiment in both fields; `quick` takes three of them."""
    rotors = {name: QUICK[name] if quick else kind.levitated for name, kind in CONFIGURATIONS.items()}
    return [
        {"configuration": name, "value": value, "model": model, "step_hz": 10.0 if quick else 2.5}
        for name, values in rotors.items()
        for value in values
        for model in MODELS
    ]


def side_mode(point: Point) -> xr.Dataset:
    """Radius of the circle of one rotor's floater at all frequencies, and one flight.

    Returns
    -------
    Dataset over `frequency`: radius of the equilibrium, the article's radius at the same distance, growth of small
    motions; for δx = 1 mm over `sample`: the floater in the laboratory and its distance from the axis at `FLOWN_HZ`.
    """
    grid = np.arange(LOWEST, HIGHEST + 1e-9, point["step_hz"])
    scene = article_scene(point["configuration"], point["value"], HIGHEST)
    levitation = levitation_of(scene, point["model"])
    table = sources(levitation.table)
    branch = levitating_branch(scene, table, levitation.rates, HIGHEST)
    rows = np.array([_row(p) for p in branch.side("near", grid)])
    flown = np.full((4, SAMPLES), np.nan)
    if (point["configuration"], point["value"]) == ("horizontal", 1.0):
        start = branch.side("near", np.array([FLOWN_HZ]))[0]
        if start is not None:
            flown = _flight(scene, table, start)
    found = dict(zip(COLUMNS, (*rows.T, side_radius(rows[:, 1], grid), *flown), strict=True))
    frequency = variable(("frequency",), grid, "Hz", "frequency of the rotor")
    return one_case(point, xr.Dataset(columns(COLUMNS, found), {"frequency": frequency}))


COLUMNS: Columns = {
    "radius": (("frequency",), "m", "radius of the floater's circle"),
    "distance": (("frequency",), "m", "levitation distance"),
    "growth": (("frequency",), "1/s", "largest growth rate of a small motion"),
    "article_radius": (("frequency",), "m", "𝒢/(μ_f ω²) at the same distance"),
    "flight_angle": (("sample",), "rad", "angle of the rotor"),
    "flight_x": (("sample",), "m", "x of the floater in flight, laboratory frame"),
    "flight_y": (("sample",), "m", "y of the floater in flight, laboratory frame"),
    "flight_z": (("sample",), "m", "z of the floater in flight"),
}


def _row(point: BranchPoint | None) -> list[float]:
    if point is None:
        return [np.nan] * 3
    return [float(np.hypot(*point.position[:2])), -point.position[2], point.growth_per_s]


def _flight(scene: Scene, table: RotorTable, point: BranchPoint) -> Array:
    """Angle of the rotor and place of the floater (4, sample) in the last turns of a flight that a kick began."""
    flight = simulate(kicked(scene, point, KICK), table, SECONDS, [])
    times = flight.time[-1] - np.linspace(TURNS / FLOWN_HZ, 0.0, SAMPLES)
    place = [np.interp(times, flight.time, column) for column in flight.lab.position.T]
    return np.array([2 * np.pi * FLOWN_HZ * times, *place])


STUDY = Study(
    name="side-mode",
    summary="the circle on which the floater goes with the rotor, and the article's formula for its radius",
    points=side_points,
    compute=side_mode,
    gather=by_case,
    figures=FIGURES,
    report=side_lines,
)
