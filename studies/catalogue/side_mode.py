"""The circle on which the floater goes with the rotor: its radius in the finite magnets' field, flown, by formula."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.frequencies import kicked, levitating_branch
from ...dynamics.flights.flight import simulate
from ...geometry.common import Array
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..result import Columns, columns, variable
from ..scene_tables import sources
from ..study import Point, Study, case_with, cases_with, one_case
from .article import (
    CONFIGURATIONS,
    HIGHEST,
    LOWEST,
    MODELS,
    QUICK,
    article_scene,
    levitation_of,
    rotor_label,
    side_radius,
    stable_in_flight,
)
from .drawing import by_configuration, configuration_panels, explain, plot_branch, rotor_colors, span, text_table

KICK, SECONDS, SAMPLES = 0.01, 2.0, 400
"""Speed upwards with which the flight begins, m/s; its duration, s; samples of its last turns that are kept."""
FLOWN_HZ, TURNS = 170.0, 3
"""Of the flight in the article's figure, for δx = 1 mm: Hz, and how many of its last turns are shown."""
FLOWN = {"configuration": "horizontal", "value": 1.0}
TYPICAL = (0.1, 0.3)  # Radii that the article calls typical, mm
COLUMNS: Columns = {
    "radius": (("frequency",), "m", "radius of the floater's circle"),
    "distance": (("frequency",), "m", "levitation distance"),
    "growth": (("frequency",), "1/s", "largest growth rate of a mode"),
    "article_radius": (("frequency",), "m", "𝒢/(μ_f ω²) at the same distance"),
    "flight_angle": (("sample",), "rad", "angle of the rotor"),
    "flight_x": (("sample",), "m", "x of the floater in flight, laboratory frame"),
    "flight_y": (("sample",), "m", "y of the floater in flight, laboratory frame"),
    "flight_z": (("sample",), "m", "z of the floater in flight"),
}


def side_points(quick: bool) -> list[Point]:
    """Every rotor that levitated in the article's experiment in both fields; `quick` takes three of them."""
    return [
        {"configuration": name, "value": value, "model": model, "step_hz": 10.0 if quick else 2.5}
        for name, kind in CONFIGURATIONS.items()
        for value in (QUICK[name] if quick else kind.levitated)
        for model in MODELS
    ]


def side_mode(point: Point) -> xr.Dataset:
    """Radius of the circle of one rotor's floater at all frequencies, and for δx = 1 mm a flight at `FLOWN_HZ`."""
    grid = np.arange(LOWEST, HIGHEST + 1e-9, point["step_hz"])
    scene = article_scene(point["configuration"], point["value"], HIGHEST)
    levitation = levitation_of(scene, point["model"])
    field = sources(levitation.table)
    branch = levitating_branch(scene, field, levitation.rates, HIGHEST)
    rows = np.full((len(grid), 3), np.nan)
    for k, there in enumerate(branch.side("near", grid)):
        if there is not None:
            rows[k] = np.hypot(*there.position[:2]), -there.position[2], there.growth_per_s
    flown = np.full((4, SAMPLES), np.nan)
    start = branch.side("near", np.array([FLOWN_HZ]))[0] if all(point[k] == v for k, v in FLOWN.items()) else None
    if start is not None:
        flight = simulate(kicked(scene, start, KICK), field, SECONDS, [])
        times = flight.time[-1] - np.linspace(TURNS / FLOWN_HZ, 0.0, SAMPLES)
        place = [np.interp(times, flight.time, column) for column in flight.lab.position.T]
        flown = np.array([2 * np.pi * FLOWN_HZ * times, *place])
    found = dict(zip(COLUMNS, (*rows.T, side_radius(rows[:, 1], grid), *flown), strict=True))
    frequency = variable(("frequency",), grid, "Hz", "frequency of the rotor")
    return one_case(point, xr.Dataset(columns(COLUMNS, found), {"frequency": frequency}))


def _predicted(flown: xr.Dataset) -> float:
    """The article's radius at the mean distance of the flight, mm."""
    return 1e3 * float(side_radius(-float(flown["flight_z"].mean()), FLOWN_HZ))


@styled
def orbit_figure(result: xr.Dataset) -> Figure:
    """The orbit of rotor and floater seen from above, and their coordinates, in one flight."""
    figure, (axes,) = panels(1, 3, (PAGE, 2.9))
    flown = case_with(result, model="fem", **FLOWN)
    angle, radius = np.linspace(0, 2 * np.pi, 200), _predicted(flown)
    place = {axis: 1e3 * flown[f"flight_{axis}"].values for axis in "xy"}
    turned = flown["flight_angle"].values
    above = axes[0]
    above.plot(np.cos(angle), np.sin(angle), color=PALETTE[1], label="rotor's cube")
    above.plot(place["x"], place["y"], color=PALETTE[0], label="floater")
    above.plot(radius * np.cos(angle), radius * np.sin(angle), ":k", lw=1.6, label="radius a of the formula")
    above.plot(np.cos(turned[-1]), np.sin(turned[-1]), "o", color=PALETTE[1], ms=4, label="at one time")
    above.plot(place["x"][-1], place["y"][-1], "o", color=PALETTE[0], ms=4)
    above.set(xlabel="x (mm)", ylabel="y (mm)", title=f"From above, {FLOWN_HZ:g} Hz", aspect="equal")
    for panel, (axis, turn) in zip(axes[1:], (("x", np.cos), ("y", np.sin)), strict=True):
        _coordinate(panel, turned, turn(turned), place[axis], radius)
        panel.set(ylabel=f"{axis} (mm)", title=f"{TURNS} turns")
    legend_below(figure, above)
    return figure


def _coordinate(axes: Axes, angle: Array, rotor: Array, floater: Array, radius: float) -> None:
    time = 1e3 * (angle - angle[0]) / (2 * np.pi * FLOWN_HZ)
    axes.plot(time, rotor, color=PALETTE[1])
    axes.plot(time, floater, color=PALETTE[0])
    for sign in (-1, 1):
        axes.axhline(sign * radius, color="k", ls=":", lw=1.6)
    axes.set_xlabel("time (ms)")


@styled
def radius_figure(result: xr.Dataset) -> Figure:
    """The radius of the side mode against frequency for every rotor, and the article's formula."""
    figure, rows = configuration_panels(
        result, 3.2, "frequency of the rotor (Hz)", "radius of the side mode (mm)", sharey=True
    )
    for axes, configuration, part in rows:
        axes.axhspan(*TYPICAL, color="0.92", lw=0, label="called typical in the article")
        for value, color in rotor_colors(figure, axes, configuration, part["value"]).items():
            found = case_with(part, value=value, model="fem")
            frequency, stable = found["frequency"].values, stable_in_flight(found["growth"])
            plot_branch(axes, frequency, 1e3 * found["radius"].values, stable, color=color)
            axes.plot(frequency, 1e3 * found["article_radius"], ":", lw=1.6, color=color)
        axes.set(xlim=(35, 255), ylim=(0, None))
    explain(rows[0][0], {"stable": "-", "unstable": "--", "$\\mathcal{G}/\\mu_f\\omega^2$ of the article": ":"})
    legend_below(figure, rows[0][0])
    return figure


FIGURES = {"side-mode-orbit": orbit_figure, "side-mode-radius": radius_figure}


def side_lines(result: xr.Dataset) -> list[str]:
    """The flight, and for each rotor the range of radii and how far the formula is off where it is stable."""
    lines, rows = [], []
    for flown in (case_with(result, model=model, **FLOWN) for model in MODELS):
        radius = 1e3 * np.hypot(flown["flight_x"].values, flown["flight_y"].values)
        lines.append(
            f"Flight of δx = 1 mm at {FLOWN_HZ:g} Hz, {flown['model'].item()}: radius {radius.mean():.4f} mm "
            f"({span(radius, '.4f')}) at {-1e3 * float(flown['flight_z'].mean()):.3f} mm; "
            f"𝒢/(μ_f ω²) = {_predicted(flown):.4f} mm."
        )
    for configuration, part in by_configuration(result):
        for value in np.unique(part["value"].values):
            cells = []
            for model in MODELS:
                found = case_with(cases_with(part, value=value), model=model)
                good = stable_in_flight(found["growth"])
                radius, formula = found["radius"].values[good], found["article_radius"].values[good]
                cells += [span(1e3 * radius, ".3f"), span(100 * (formula / radius - 1), "+.1f")]
            rows.append((rotor_label(configuration, value), *cells))
    head = ("where stable", *(f"{model} {words}" for model in MODELS for words in ("(mm)", "formula off (%)")))
    return [*lines, *text_table(head, rows)]


STUDY = Study(
    name="side-mode",
    summary="the circle on which the floater goes with the rotor, and the article's formula for its radius",
    points=side_points,
    compute=side_mode,
    figures=FIGURES,
    report=side_lines,
)
