"""The small circle on which the floater goes with the rotor: its radius in the true field, in flight and by formula."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.branch import BranchPoint
from ...dynamics.continuation.frequencies import kicked, levitating_branch
from ...dynamics.flights.flight import simulate
from ...fem.rotor.table import RotorTable
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.style import PAGE, PALETTE, panels, styled
from ..levitation import sources
from ..result import Columns, columns, variable
from ..study import Point, Study, by_case, cases_with, one_case
from .article import (
    CONFIGURATIONS,
    HIGHEST,
    LOWEST,
    QUICK,
    TITLES,
    article_scene,
    legend_name,
    levitation_of,
    plot_branch,
    rotor_color,
    rotor_label,
    side_radius,
    stable_in_flight,
    values_of,
)

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


FLOWN_HZ, TURNS = 170.0, 3
"""Of the flight in the article's figure, for δx = 1 mm: Hz, and how many of its last turns are shown."""
TOLD = (0.1, 0.3)
"""Radii that the article calls typical, mm."""


@styled
def orbit_figure(result: xr.Dataset) -> Figure:
    """The orbit of rotor and floater seen from above, and their coordinates, in one flight."""
    figure, (axes,) = panels(1, 3, (PAGE, 2.6))
    flown = cases_with(result, configuration="horizontal", value=1.0, model="fem").isel(case=0)
    _orbit(axes[0], flown)
    _coordinates(axes[1], flown, "x", np.cos)
    _coordinates(axes[2], flown, "y", np.sin)
    return figure


@styled
def radius_figure(result: xr.Dataset) -> Figure:
    """The radius of the side mode against frequency for every rotor, and the article's formula."""
    figure, (axes,) = panels(1, 3, (PAGE, 3.0), sharey=True)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        panel.axhspan(*TOLD, color="0.92", lw=0)
        for value in values_of(result, configuration):
            found = cases_with(result, configuration=configuration, value=value, model="fem").isel(case=0)
            frequency, radius, solid = (
                found["frequency"].values,
                found["radius"].values,
                stable_in_flight(found["growth"]),
            )
            color, label = rotor_color(configuration, value), legend_name(configuration, value)
            plot_branch(panel, frequency, 1e3 * radius, solid, color=color, label=label)
            panel.plot(frequency, 1e3 * found["article_radius"], ":", lw=1.6, color=color)
        panel.set(xlabel="frequency of the rotor (Hz)", xlim=(35, 255), ylim=(0, 2.1), title=TITLES[configuration])
        panel.legend(ncols=2, loc="upper right", columnspacing=1.0)
    axes[0].set_ylabel("radius of the side mode (mm)")
    key = [
        axes[0].plot([], [], ":", lw=1.6, color="0.3", label="$\\mathcal{G}/\\mu_f\\omega^2$")[0],
        axes[0].plot([], [], "--", color="0.3", label="unstable")[0],
        axes[0].fill_between([], [], [], color="0.92", label="0.1–0.3 mm, called typical in the article"),
    ]
    figure.legend(handles=key, loc="outside lower center", ncols=3)
    return figure


FIGURES = {"side-mode-orbit": orbit_figure, "side-mode-radius": radius_figure}


def _orbit(axes: Axes, flown: xr.Dataset) -> None:
    angle = np.linspace(0, 2 * np.pi, 200)
    axes.plot(np.cos(angle), np.sin(angle), color=PALETTE[1], label="rotor's cube")
    axes.plot(1e3 * flown["flight_x"], 1e3 * flown["flight_y"], color=PALETTE[0], label="floater")
    radius = 1e3 * _predicted(flown)
    axes.plot(radius * np.cos(angle), radius * np.sin(angle), ":", color="k", lw=1.6, label="circle of radius a")
    last = float(flown["flight_angle"][-1])
    axes.plot(np.cos(last), np.sin(last), "o", color=PALETTE[1], ms=4)
    axes.plot(1e3 * float(flown["flight_x"][-1]), 1e3 * float(flown["flight_y"][-1]), "o", color=PALETTE[0], ms=4)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", title=f"From above, {FLOWN_HZ:g} Hz", aspect="equal")
    axes.set(xlim=(-1.3, 1.3), ylim=(-1.2, 2.1))
    axes.legend(loc="upper right")


def _coordinates(axes: Axes, flown: xr.Dataset, axis: str, turn: np.ufunc) -> None:
    angle = flown["flight_angle"].values
    time = 1e3 * (angle - angle[0]) / (2 * np.pi * FLOWN_HZ)
    radius = 1e3 * _predicted(flown)
    axes.plot(time, turn(angle), color=PALETTE[1], label=f"${axis}_r$, rotor")
    axes.plot(time, 1e3 * flown[f"flight_{axis}"], color=PALETTE[0], label=f"${axis}_f$, floater")
    for sign in (-1, 1):
        axes.axhline(sign * radius, color="k", ls=":", lw=1.6, label="±a" if sign > 0 else None)
    axes.set(xlabel="time (ms)", ylabel=f"{axis} (mm)", title=f"{TURNS} turns", ylim=(-1.2, 2.1))
    axes.legend(loc="upper right", ncols=2)


def _predicted(flown: xr.Dataset) -> float:
    """The article's radius at the mean distance of the flight, m."""
    return float(side_radius(-float(flown["flight_z"].mean()), FLOWN_HZ))


def side_lines(result: xr.Dataset) -> list[str]:
    """The flight, and for each rotor the range of radii and how far the formula is off where it is stable."""
    lines = []
    for model, text in (("fem", "finite elements"), ("dipole", "dipole")):
        flown = cases_with(result, configuration="horizontal", value=1.0, model=model).isel(case=0)
        radius = 1e3 * np.hypot(flown["flight_x"].values, flown["flight_y"].values)
        lines.append(
            f"Flight of δx = 1 mm at {FLOWN_HZ:g} Hz, {text}: radius {radius.mean():.4f} mm "
            f"({radius.min():.4f} to {radius.max():.4f}) at {-1e3 * float(flown['flight_z'].mean()):.3f} mm; "
            f"𝒢/(μ_f ω²) = {1e3 * _predicted(flown):.4f} mm."
        )
    for configuration in CONFIGURATIONS:
        for value in values_of(result, configuration):
            words = []
            for model, text in (("fem", "finite elements"), ("dipole", "dipole")):
                found = cases_with(result, configuration=configuration, value=value, model=model).isel(case=0)
                good = stable_in_flight(found["growth"].values)
                radius, formula = 1e3 * found["radius"].values[good], 1e3 * found["article_radius"].values[good]
                if not len(radius):
                    words.append(f"{text}: stable nowhere")
                    continue
                off = 100 * (formula / radius - 1)
                span = f"{radius.min():.3f} to {radius.max():.3f} mm"
                words.append(f"{text}: {span}, formula off by {off.min():+.1f} to {off.max():+.1f} %")
            lines.append(f"{rotor_label(configuration, value)}, where it is stable, {'; '.join(words)}.")
    return lines


STUDY = Study(
    name="side-mode",
    summary="the circle on which the floater goes with the rotor, and the article's formula for its radius",
    points=side_points,
    compute=side_mode,
    gather=by_case,
    figures=FIGURES,
    report=side_lines,
)
