"""Distance at which the floater levitates against frequency, for every rotor of the article: its third figure.

The motion has Stokes drag, and in the field of finite elements rotor and floater magnetise each other.  Currents in
their metal do not move an equilibrium, and are left out.
"""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...dynamics.continuation.branch import BranchPoint, Family
from ...dynamics.continuation.frequencies import by_frequency, distance_error, kicked, levitating_branch
from ...dynamics.flights.flight import simulate
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.style import legend_below, styled
from ..result import Columns, columns, variable
from ..study import Point, Study, case_with, cases_with, one_case
from .article import (
    CONFIGURATIONS,
    HIGHEST,
    LOWEST,
    QUICK,
    WEIGHT,
    analytic_distance,
    article_scene,
    balanced,
    levitation_of,
    polar_angle,
    rotor_label,
    stable_in_flight,
)
from .drawing import by_configuration, configuration_panels, explain, plot_branch, rotor_colors, span, text_table

SIDES = ("near", "far")
FORMULAS, FIELDS = ("semi-analytic", "analytic"), ("dipole", "fem")
FLOWN = "dipole"  # The field of the simulated flights, which are spread over a rotor's stable frequencies
KICK, SECONDS = 0.01, 1.0
"""Speed with which a simulated floater leaves its equilibrium upwards, m/s, and duration of the flight."""
BOTH: tuple[str, ...] = ("frequency", "side")
COLUMNS: Columns = {
    "distance": (BOTH, "m", "levitation distance"),
    "distance_error": (BOTH, "m", "what the field's estimated error changes of the distance"),
    "growth": (BOTH, "1/s", "largest growth rate of a mode"),
    "polar_angle": (BOTH, "rad", "polar angle of the moment"),
    "fold_frequency": ((), "Hz", "lowest frequency with an equilibrium"),
    "fold_distance": ((), "m", "levitation distance there"),
    "flight_frequency": (("flight",), "Hz", "frequency of a simulated flight"),
    "flight_distance": (("flight",), "m", "mean levitation distance of a simulated flight"),
    "flight_error": (("flight",), "m", "difference between the flight's halves"),
}


def distance_points(quick: bool) -> list[Point]:
    """Every rotor by every formula and field; `quick` takes three rotors, a coarser grid and a rigid floater."""
    step, flights, interaction = (10.0, 1, "rigid") if quick else (2.5, 3, "auto")
    more = {"step_hz": step, "flights": flights, "interaction": interaction}
    return [
        {"configuration": name, "value": value, "model": model, **more}
        for name, kind in CONFIGURATIONS.items()
        for value in (QUICK[name] if quick else kind.tested)
        for model in (*FORMULAS, *FIELDS)
        if (name, model) != ("vertical", "analytic")
    ]


def levitation_distance(point: Point) -> xr.Dataset:
    """Distances of one rotor by one formula, or in one field, at all frequencies, see `COLUMNS`."""
    grid = np.arange(LOWEST, HIGHEST + 1e-9, point["step_hz"])
    found = _by_formula(point, grid) if point["model"] in FORMULAS else _in_field(point, grid)
    data = columns(COLUMNS, found, frequency=len(grid), side=len(SIDES), flight=point["flights"])
    frequency = variable(("frequency",), grid, "Hz", "frequency of the rotor")
    return one_case(point, xr.Dataset(data, {"side": list(SIDES), "frequency": frequency}))


def _by_formula(point: Point, grid: Array) -> dict[str, Array]:
    rotor = point["configuration"], point["value"]
    if point["model"] == "semi-analytic":
        return {"distance": np.array([balanced(*rotor, frequency, WEIGHT) for frequency in grid])}
    near = analytic_distance(*rotor, grid)
    return {"distance": np.stack([near, np.full(near.shape, np.nan)], axis=1)}


def _in_field(point: Point, grid: Array) -> dict[str, Array]:
    scene = article_scene(point["configuration"], point["value"], HIGHEST)
    levitation = levitation_of(scene, point["model"], interaction=point.get("interaction", "rigid"))
    field = levitation.interaction
    branch = levitating_branch(scene, field, levitation.rates, HIGHEST)
    found = [branch.side(side, grid) for side in SIDES]
    family = by_frequency(scene, levitation.rates)
    rows = np.array([[_row(scene, field, family, p) for p in side] for side in found])
    fold = branch.fold
    flown = found[0] if point["model"] == FLOWN else []
    known = [p for p in flown if p is not None and stable_in_flight(p.growth_per_s)]
    places = np.unique(np.linspace(0, len(known) - 1, point["flights"] if known else 0).astype(int))
    flights = np.full((3, point["flights"]), np.nan)
    for k, place in enumerate(places):
        flights[:, k] = known[place].parameter, *mean_height(scene, field, known[place])
    return dict(zip(COLUMNS, (*rows.T, fold.parameter, -fold.position[2], *flights), strict=True))


def _row(scene: Scene, field: FieldTable, family: Family, point: BranchPoint | None) -> list[float]:
    if point is None:
        return [np.nan] * 4
    error = distance_error(scene, field, family, point)
    return [-point.position[2], error, point.growth_per_s, float(polar_angle(point.state[6:9]))]


def mean_height(scene: Scene, field: FieldTable, point: BranchPoint) -> tuple[float, float]:
    """Mean distance along the axis (m) of a flight that a kick began, and by how much its halves differ.

    Means are weighted by sin², which takes out the axial mode; NaN where the flight did not last.
    """
    flight = simulate(kicked(scene, point, KICK), field, SECONDS, [])
    if flight.ended_by != "duration":
        return np.nan, np.nan
    height = -flight.lab.position[:, 2]
    halves = [_smooth_mean(part) for part in np.array_split(height, 2)]
    return _smooth_mean(height), abs(halves[1] - halves[0])


def _smooth_mean(values: Array) -> float:
    return float(np.average(values, weights=np.sin(np.pi * (np.arange(len(values)) + 0.5) / len(values)) ** 2))


AXES = {"xlabel": "frequency of the rotor (Hz)", "ylabel": "levitation distance (mm)"}


@styled
def models_figure(result: xr.Dataset) -> Figure:
    """The levitation distance of every rotor by finite elements and by the dipole."""
    figure, rows = configuration_panels(result, 4.0, **AXES, sharey=True)
    for axes, configuration, part in rows:
        for value, color in rotor_colors(figure, axes, configuration, part["value"]).items():
            rotor = cases_with(part, value=value)
            width = 1.8 if value in CONFIGURATIONS[configuration].levitated else 0.8
            for side in SIDES:
                frequency, distance, stable = _side(rotor, "fem", side)
                plot_branch(axes, frequency, 1e3 * distance, stable, color=color, lw=width)
                axes.plot(frequency, 1e3 * _side(rotor, "dipole", side)[1], ":", color=color, lw=0.8)
            found = case_with(rotor, model="fem")
            axes.plot(found["fold_frequency"], 1e3 * found["fold_distance"], "o", color=color, ms=3)
        axes.set_ylim(8, 52)
    key = {"finite elements, stable": "-", "unstable": "--", "point dipole": ":", "lowest frequency (fold)": "o"}
    explain(rows[0][0], key, ms=3)
    explain(rows[0][0], {"thick: levitated in the experiment": "-"}, lw=1.8)
    legend_below(figure, rows[0][0], columns=3)
    return figure


@styled
def formulas_figure(result: xr.Dataset) -> Figure:
    """The article's formulas and simulated flights beside the dipole's equilibrium, for the rotors that levitated."""
    figure, rows = configuration_panels(result, 3.4, **AXES, sharey=True)
    for axes, configuration, part in rows:
        levitated = [v for v in CONFIGURATIONS[configuration].levitated if v in part["value"]]
        for value, color in rotor_colors(figure, axes, configuration, levitated).items():
            rotor = cases_with(part, value=value)
            frequency, distance, stable = _side(rotor, "dipole", "near")
            plot_branch(axes, frequency, 1e3 * distance, stable, lw=0.8, color=color)
            for model, style in (("semi-analytic", ":"), ("analytic", "-.")):
                if model in rotor["model"].values:
                    axes.plot(frequency, 1e3 * _side(rotor, model, "near")[1], style, color=color)
            flown = case_with(rotor, model=FLOWN)
            axes.plot(flown["flight_frequency"], 1e3 * flown["flight_distance"], "x", ms=4, color=color)
        axes.set_ylim(8, 62)
    key = {"point dipole, stable": "-", "unstable": "--", "semi-analytic formula": ":"}
    explain(rows[0][0], key | {"analytic formula, no gravity": "-.", "simulated flight, mean": "x"})
    legend_below(figure, rows[0][0], columns=3)
    return figure


FIGURES = {"levitation-distance-models": models_figure, "levitation-distance-formulas": formulas_figure}


def _side(rotor: xr.Dataset, model: str, side: str) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Frequency (Hz), distance (m) and whether it is stable on one side, by one model."""
    found = case_with(rotor, model=model).sel(side=side)
    return found["frequency"].values, found["distance"].values, stable_in_flight(found["growth"])


def distance_lines(result: xr.Dataset) -> list[str]:
    """For each rotor: where it levitates, and how far formulas and simulations are from the equilibrium."""
    rows, lines = [], []
    for configuration, part in by_configuration(result):
        for value in np.unique(part["value"].values):
            rotor = cases_with(part, value=value)
            frequency, near, stable = _side(rotor, "dipole", "near")
            for model in FIELDS:
                _, distance, good = _side(rotor, model, "near")
                power = np.polyfit(np.log(frequency[good]), np.log(distance[good]), 1)[0] if good.sum() > 2 else np.nan
                lowest = float(case_with(rotor, model=model)["fold_frequency"])
                where = (f"{lowest:.2f}", span(frequency[good]), span(1e3 * distance[good], ".2f"), power)
                off = [""] * 3
                if model == "dipole":
                    others = ((name, _side(rotor, name, "near")[1]) for name in rotor["model"].values if name != model)
                    apart = {
                        name: 1e3 * (other - near if name != "fem" else near - other)[stable] for name, other in others
                    }
                    off = [span(apart.get(name, np.nan), "+.2f") for name in ("fem", *FORMULAS)]
                rows.append((f"{rotor_label(configuration, value)}, {model}", *where, *off))
        for model in FIELDS:
            found = cases_with(part, model=model)
            folds = found["fold_frequency"].values[np.isin(found["value"], CONFIGURATIONS[configuration].levitated)]
            if len(folds) > 1:
                ratio = folds.max() / folds.min()
                lines.append(
                    f"{configuration}, {model}: the levitated rotors lower the lowest frequency from {folds.max():.1f} "
                    f"to {folds.min():.1f} Hz, a factor of {ratio:.2f}."
                )
    head = (
        "rotor, model",
        "lowest (Hz)",
        "stable (Hz)",
        "distance (mm)",
        "power of f",
        "- fem (mm)",
        "semi-an.",
        "analytic",
    )
    last = "Last columns: point dipole less finite elements, and each formula less the point dipole, in mm."
    return [*text_table(head, rows), last, *lines, *_flights(result)]


def _flights(result: xr.Dataset) -> list[str]:
    """How far the means of simulated flights are from the equilibria."""
    flown = cases_with(result, model=FLOWN)
    apart = [
        one["flight_distance"].values
        - np.interp(one["flight_frequency"], one["frequency"], one["distance"].sel(side="near"))
        for one in (flown.isel(case=k) for k in range(flown.sizes["case"]))
    ]
    if not np.isfinite(apart).any():
        return []
    return [f"Means of simulated flights agree with the equilibria within {1e6 * np.nanmax(np.abs(apart)):.3g} µm."]


STUDY = Study(
    name="levitation-distance",
    summary="distance against frequency for every rotor of the article: equilibria, its formulas, simulated flights",
    points=distance_points,
    compute=levitation_distance,
    figures=FIGURES,
    report=distance_lines,
)
