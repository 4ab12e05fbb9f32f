"""Distance at which the floater levitates against frequency, for every rotor of the article: its third figure.

The motion has Stokes drag, and in the field of finite elements rotor and floater magnetise each other.  Currents in
their metal do not move an equilibrium, and are left out.
"""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.branch import BranchPoint, Family
from ...dynamics.continuation.frequencies import distance_error, kicked, levitating_branch
from ...dynamics.flights.flight import simulate
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.style import styled
from ..result import Columns, columns, variable
from ..study import Point, Study, by_case, cases_with, one_case
from .article import (
    CONFIGURATIONS,
    HIGHEST,
    LOWEST as LOWEST_OF_ARTICLE,
    QUICK,
    WEIGHT,
    analytic_distance,
    article_scene,
    balanced,
    legend_name,
    levitation_of,
    one_panel_each,
    plot_branch,
    rotor_color,
    rotor_label,
    stable_in_flight,
    values_of,
)

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
    grid = np.arange(LOWEST_OF_ARTICLE, HIGHEST + 1e-9, point["step_hz"])
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


LOWEST = 8.0
"""Of the axis of distances, mm."""


@styled
def models_figure(result: xr.Dataset) -> Figure:
    """The levitation distance of every rotor by finite elements and by the dipole."""
    figure, axes = _distance_panels(4.3)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        for value in values_of(result, configuration):
            rotor = cases_with(result, configuration=configuration, value=value)
            _fields(panel, rotor, rotor_color(configuration, value), legend_name(configuration, value))
        panel.plot([], [], ":", color="0.3", lw=0.8, label="dipole")
        panel.plot([], [], "o", color="0.3", ms=3, label="fold")
        panel.set_ylim(LOWEST, 52.0)
        panel.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.17), columnspacing=1.0)
    return figure


@styled
def formulas_figure(result: xr.Dataset) -> Figure:
    """The article's formulas and simulated flights beside the dipole's equilibrium, for the rotors that levitated."""
    figure, axes = _distance_panels(3.2)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        for value in values_of(result, configuration):
            if value in CONFIGURATIONS[configuration].levitated:
                rotor = cases_with(result, configuration=configuration, value=value)
                color = rotor_color(configuration, value)
                _formulas(panel, rotor, color=color)
                panel.plot([], [], color=color, label=rotor_label(configuration, value))
        panel.set_ylim(LOWEST, 62.0)
        if configuration != "horizontal" and panel.get_legend_handles_labels()[0]:
            panel.legend(loc="upper right")
    _key(axes[0])
    return figure


FIGURES = {"levitation-distance-models": models_figure, "levitation-distance-formulas": formulas_figure}


def _distance_panels(height: float) -> tuple[Figure, Any]:
    figure, axes = one_panel_each(height, sharey=True)
    for panel in axes:
        panel.set(xlabel="frequency of the rotor (Hz)", xlim=(25, 255))
    axes[0].set_ylabel("levitation distance (mm)")
    return figure, axes


def _key(axes: Axes) -> None:
    for style, text in (
        ("-", "dipole, stable"),
        ("--", "dipole, unstable"),
        (":", "semi-analytic formula"),
        ("-.", "analytic formula, no gravity"),
    ):
        axes.plot([], [], style, color="0.3", lw=1.6 if style == ":" else 0.8, label=text)
    axes.plot([], [], "x", color="0.3", label="simulated flight, mean")
    axes.legend()


def _fields(axes: Axes, rotor: xr.Dataset, color: Any, label: str) -> None:
    frequency = rotor["frequency"].values
    for side, name in (("near", label), ("far", None)):
        distance, growth = _side(rotor, "fem", side)
        plot_branch(axes, frequency, 1e3 * distance, stable_in_flight(growth), color=color, label=name)
        axes.plot(frequency, 1e3 * _side(rotor, "dipole", side)[0], ":", color=color, lw=0.8)
    found = cases_with(rotor, model="fem").isel(case=0)
    axes.plot(float(found["fold_frequency"]), 1e3 * float(found["fold_distance"]), "o", color=color, ms=3)
    near, error = (1e3 * found[name].sel(side="near").values for name in ("distance", "distance_error"))
    axes.fill_between(frequency, near - error, near + error, color=color, alpha=0.3, lw=0)


def _formulas(axes: Axes, rotor: xr.Dataset, **style: Any) -> None:
    frequency = rotor["frequency"].values
    distance, growth = _side(rotor, "dipole", "near")
    plot_branch(axes, frequency, 1e3 * distance, stable_in_flight(growth), lw=0.8, **style)
    axes.plot(frequency, 1e3 * _side(rotor, "semi-analytic", "near")[0], ":", lw=1.6, **style)
    if "analytic" in rotor["model"].values:
        axes.plot(frequency, 1e3 * _side(rotor, "analytic", "near")[0], "-.", lw=0.6, **style)
    flights = cases_with(rotor, model="dipole")
    axes.plot(flights["flight_frequency"].values[0], 1e3 * flights["flight_distance"].values[0], "x", ms=4, **style)


def _side(rotor: xr.Dataset, model: str, side: str) -> tuple[Array, Array]:
    """Distance (m) and growth (1/s) on one side, by one model."""
    found = cases_with(rotor, model=model).isel(case=0).sel(side=side)
    return found["distance"].values, found["growth"].values


def distance_lines(result: xr.Dataset) -> list[str]:
    """For each rotor: where it levitates, and how far formulas and simulations are from the equilibrium."""
    lines = []
    for configuration, kind in CONFIGURATIONS.items():
        values = values_of(result, configuration)
        for model, text in (("fem", "finite elements"), ("dipole", "dipole")):
            found = cases_with(result, configuration=configuration, model=model).sortby("value")
            flown = found.isel(case=np.isin(found["value"].values, kind.levitated))["fold_frequency"].values
            if len(flown) > 1:
                words = f"{configuration}, {text}: from {flown.max():.1f} down to {flown.min():.1f} Hz"
                lines.append(f"{words} by the parameters that levitated, a factor of {flown.max() / flown.min():.2f}.")
        for value in values:
            rotor = cases_with(result, configuration=configuration, value=value)
            lines.append(f"{rotor_label(configuration, value)}: " + "; ".join(_sentences(rotor)) + ".")
    return lines


def _sentences(rotor: xr.Dataset) -> list[str]:
    words = []
    for model, text in (("fem", "finite elements"), ("dipole", "dipole")):
        found = cases_with(rotor, model=model).isel(case=0)
        near, growth = _side(rotor, model, "near")
        good = stable_in_flight(growth)
        fold = f"{text}: none below {float(found['fold_frequency']):.2f} Hz"
        if good.any():
            kept = rotor["frequency"].values[good]
            span = f"{1e3 * near[good].max():.2f}–{1e3 * near[good].min():.2f} mm"
            fold += f", stable at {kept[0]:g}–{kept[-1]:g} Hz, {span}"
            if len(kept) > 2:
                fold += f", d ~ f^{np.polyfit(np.log(kept), np.log(near[good]), 1)[0]:.2f}"
        words.append(fold if good.any() else fold + ", stable nowhere")
    near, growth = _side(rotor, "dipole", "near")
    good = stable_in_flight(growth)
    true = _side(rotor, "fem", "near")[0]
    if good.any():
        words.append(f"dipole less finite elements {_range(1e3 * (near - true)[good])} mm")
        for model in ("semi-analytic", "analytic"):
            if model in rotor["model"].values:
                off = 100 * (_side(rotor, model, "near")[0] / near - 1)[good]
                words.append(f"{model} off the dipole by {_range(off)} %")
    flights = cases_with(rotor, model="dipole").isel(case=0)
    apart = flights["flight_distance"].values - np.interp(
        flights["flight_frequency"].values, rotor["frequency"].values, near
    )
    if np.isfinite(apart).any():
        words.append(f"simulated flights within {1e6 * np.nanmax(np.abs(apart)):.2g} µm")
    return words


def _range(values: Array) -> str:
    known = values[np.isfinite(values)]
    if not len(known):
        return "unknown"
    return f"{known.min():+.2f} to {known.max():+.2f}" if len(known) > 1 else f"{known[0]:+.2f}"


STUDY = Study(
    name="levitation-distance",
    summary="distance against frequency for every rotor of the article: equilibria, its formulas, simulated flights",
    points=distance_points,
    compute=levitation_distance,
    gather=by_case,
    figures=FIGURES,
    report=distance_lines,
)
