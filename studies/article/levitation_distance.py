"""Distance at which the floater levitates against frequency, for every rotor of the article: its third figure.

The motion has Stokes drag, and in the field of finite elements rotor and floater magnetise each other.  Currents in
their metal do not move an equilibrium, and are left out.
"""

import numpy as np
import xarray as xr

from ...dynamics.branches import BranchPoint, Family, distance_error, kicked, levitating_branch
from ...dynamics.flights import simulate
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..results import Columns, Point, Study, by_case, columns, one_case, variable
from .article import CONFIGURATIONS, HIGHEST, LOWEST, QUICK, WEIGHT, article_scene, levitation_of, stable_in_flight
from .article_formulas import analytic_distance, balanced
from .levitation_distance_figure import FIGURES, distance_lines

SIDES = ("near", "far")
FORMULAS, FIELDS = ("semi-analytic", "analytic"), ("dipole", "fem")
FLOWN = "dipole"
"""The field of the simulated flights, which are spread over a rotor's stable frequencies."""
KICK, SECONDS = 0.01, 1.0
"""Speed with which a simulated floater leaves its equilibrium upwards, m/s, and duration of the flight."""
BOTH: tuple[str, ...] = ("frequency", "side")
COLUMNS: Columns = {
    "distance": (BOTH, "m", "levitation distance"),
    "distance_error": (BOTH, "m", "what the field's estimated error changes of the distance"),
    "growth": (BOTH, "1/s", "largest growth rate of a small motion"),
    "polar_angle": (BOTH, "rad", "polar angle of the moment"),
    "fold_frequency": ((), "Hz", "lowest frequency with an equilibrium"),
    "fold_distance": ((), "m", "levitation distance there"),
    "flight_frequency": (("flight",), "Hz", "frequency of a simulated flight"),
    "flight_distance": (("flight",), "m", "mean levitation distance of a simulated flight"),
    "flight_error": (("flight",), "m", "difference between the flight's halves"),
}


def distance_points(quick: bool) -> list[Point]:
    """Every rotor of the article by every formula and field.

    `quick` takes three rotors, a coarser grid and a rigid floater.
    """
    step, flights, interaction = (10.0, 1, "rigid") if quick else (2.5, 3, "auto")
    rotors = {name: QUICK[name] if quick else kind.tested for name, kind in CONFIGURATIONS.items()}
    return [
        {
            "configuration": name,
            "value": value,
            "model": model,
            "step_hz": step,
            "flights": flights,
            "interaction": interaction,
        }
        for name, values in rotors.items()
        for value in values
        for model in (*FORMULAS, *FIELDS)
        if (name, model) != ("vertical", "analytic")
    ]


def levitation_distance(point: Point) -> xr.Dataset:
    """Distances of one rotor by one formula, or in one field, at all frequencies.

    Returns
    -------
    Dataset over `frequency` and `side`: distance along the axis of the near and of the far equilibrium, NaN where there
    is none, and in a field also its error by the table, growth of small motions and polar angle; where the two sides
    meet; in the dipole's field some simulations.
    """
    grid = np.arange(LOWEST, HIGHEST + 1e-9, point["step_hz"])
    found = _by_formula(point, grid) if point["model"] in FORMULAS else _in_field(point, grid)
    data = columns(COLUMNS, found, frequency=len(grid), side=len(SIDES), flight=point["flights"])
    frequency = variable(("frequency",), grid, "Hz", "frequency of the rotor")
    return one_case(point, xr.Dataset(data, {"side": list(SIDES), "frequency": frequency}))


def _by_formula(point: Point, grid: Array) -> dict[str, Array]:
    configuration, value = point["configuration"], point["value"]
    if point["model"] == "semi-analytic":
        return {"distance": np.array([balanced(configuration, value, frequency, WEIGHT) for frequency in grid])}
    near = analytic_distance(configuration, value, grid)
    return {"distance": np.stack([near, np.full(near.shape, np.nan)], axis=1)}


def _in_field(point: Point, grid: Array) -> dict[str, Array]:
    scene = article_scene(point["configuration"], point["value"], HIGHEST)
    levitation = levitation_of(scene, point["model"], interaction=point.get("interaction", "rigid"))
    table = levitation.interaction
    branch = levitating_branch(scene, table, levitation.rates, HIGHEST)
    found = [branch.side(side, grid) for side in SIDES]
    rows = np.array([[_row(scene, table, branch.family, p) for p in side] for side in found])
    fold = branch.fold
    flown = found[0] if point["model"] == FLOWN else []
    known = [p for p in flown if p is not None and stable_in_flight(p.growth_per_s)]
    places = np.unique(np.linspace(0, len(known) - 1, point["flights"] if known else 0).astype(int))
    flights = np.full((3, point["flights"]), np.nan)
    for k, place in enumerate(places):
        flights[:, k] = known[place].parameter, *mean_height(scene, table, known[place])
    return dict(zip(COLUMNS, (*rows.T, fold.parameter, -fold.position[2], *flights), strict=True))


def _row(scene: Scene, table: FieldTable, family: Family, point: BranchPoint | None) -> list[float]:
    if point is None:
        return [np.nan] * 4
    angle = float(np.arctan2(np.hypot(*point.state[6:8]), point.state[8]))
    return [-point.position[2], distance_error(scene, table, family, point), point.growth_per_s, angle]


def mean_height(scene: Scene, table: FieldTable, point: BranchPoint) -> tuple[float, float]:
    """Mean distance along the axis (m) of a flight that a kick began, and by how much its halves differ.

    Means are weighted by sin², which takes out the bounce; NaN where the flight did not last.
    """
    flight = simulate(kicked(scene, point, KICK), table, SECONDS, [])
    if flight.ended_by != "duration":
        return np.nan, np.nan
    height = -flight.lab.position[:, 2]
    halves = [_smooth_mean(part) for part in np.array_split(height, 2)]
    return _smooth_mean(height), abs(halves[1] - halves[0])


def _smooth_mean(values: Array) -> float:
    return float(np.average(values, weights=np.sin(np.pi * (np.arange(len(values)) + 0.5) / len(values)) ** 2))


STUDY = Study(
    name="levitation-distance",
    summary="distance against frequency for every rotor of the article: equilibria, its formulas, simulated flights",
    points=distance_points,
    compute=levitation_distance,
    gather=by_case,
    figures=FIGURES,
    report=distance_lines,
)
