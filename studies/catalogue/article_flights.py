"""The article's figures of levitation distances and of trajectories."""

from dataclasses import replace
from typing import Any

import numpy as np
import scipy
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ...dynamics.continuation.branch import BranchPoint
from ...dynamics.continuation.frequencies import by_frequency, distance_error, kicked, levitating_branch
from ...dynamics.continuation.slow_drift import drift
from ...dynamics.flights.flight import simulate
from ...dynamics.flights.trajectory import flight_kind
from ...dynamics.motion.state import Scales, polar_angle
from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.style import PALETTE, plot_branch
from ..levitation import Levitation
from ..result import Columns, variable
from ..study import Point, Study, case_with, cases_with, each_case, recorded
from . import article, showing
from .article import analytic_distance, balanced
from .showing import each, small_multiples

# Distance at which the floater levitates against frequency, for every rotor of the article: its third figure.
#
# The motion has Stokes drag, and in the field of finite elements rotor and floater magnetise each other.  Currents in
# their metal do not move an equilibrium, and are left out.
SIDES = ("near", "far")
FORMULAS, FIELDS = ("semi-analytic", "analytic"), ("dipole", "fem")
SIMULATED = "dipole"  # The field of the simulated trajectories, which are spread over a rotor's stable frequencies
DISTANCE_KICK, SECONDS = 0.01, 1.0
"""Speed with which a simulated floater leaves its equilibrium upwards, m/s, and duration of the trajectory."""
COARSE = {"step_hz": 10.0, "flights": 1, "interaction": "rigid"}
FINE = {"step_hz": 2.5, "flights": 3, "interaction": "auto"}
BOTH: tuple[str, ...] = ("frequency", "side")
DISTANCE_COLUMNS: Columns = {
    "distance": (BOTH, "m", "levitation distance"),
    "distance_error": (BOTH, "m", "what the field's estimated error changes of the distance"),
    "growth": (BOTH, "1/s", "largest growth rate of a mode"),
    "polar_angle": (BOTH, "rad", "polar angle of the moment"),
    "fold_frequency": ((), "Hz", "lowest frequency with an equilibrium"),
    "fold_distance": ((), "m", "levitation distance there"),
    "flight_frequency": (("flight",), "Hz", "frequency of a simulated trajectory"),
    "flight_distance": (("flight",), "m", "mean levitation distance of a simulated trajectory"),
    "flight_error": (("flight",), "m", "difference between the trajectory's halves"),
}


def levitation_distance(point: Point) -> xr.Dataset:
    grid = np.arange(article.LOWEST, article.HIGHEST + 1e-9, point["step_hz"])
    rotor = point["configuration"], point["value"]
    if point["model"] == "semi-analytic":
        found = {"distance": np.array([balanced(*rotor, frequency, article.WEIGHT) for frequency in grid])}
    elif point["model"] == "analytic":
        near = analytic_distance(*rotor, grid)
        found = {"distance": np.stack([near, np.full(near.shape, np.nan)], axis=1)}
    else:
        found = _in_field(point, grid)
    frequency = variable(("frequency",), grid, "Hz", "frequency of the rotor")
    axes, sizes = {"side": list(SIDES), "frequency": frequency}, {"frequency": len(grid), "side": len(SIDES)}
    return recorded(point, DISTANCE_COLUMNS, found, axes, **sizes, flight=point["flights"])


def _in_field(point: Point, grid: Array) -> dict[str, Any]:
    scene = article.rotor_scene(point["configuration"], point["value"], article.HIGHEST)
    levitation = article.levitation_of(scene, point["model"], interaction=point.get("interaction", "rigid"))
    field, family = levitation.interaction, by_frequency(scene, levitation.rates)
    branch = levitating_branch(scene, field, levitation.rates, article.HIGHEST)
    rows, flights = np.full((len(SIDES), len(grid), 4), np.nan), np.full((3, point["flights"]), np.nan)
    for side, row in zip(SIDES, rows, strict=True):
        known = [(k, there) for k, there in enumerate(branch.side(side, grid)) if there is not None]
        for k, there in known:
            error = distance_error(scene, field, family, there)
            row[k] = -there.position[2], error, there.growth_per_s, polar_angle(there.state[6:9])
        stable = [there for _, there in known if article.stable_in_flight(there.growth_per_s)]
        if side == "near" and point["model"] == SIMULATED and stable:
            places = np.unique(np.linspace(0, len(stable) - 1, point["flights"]).astype(int))
            for k, place in enumerate(places):
                flights[:, k] = stable[place].parameter, *mean_height(scene, field, stable[place])
    fold = branch.fold.parameter, -branch.fold.position[2]
    return dict(zip(DISTANCE_COLUMNS, (*rows.transpose(2, 1, 0), *fold, *flights), strict=True))


def mean_height(scene: Scene, field: FieldTable, point: BranchPoint) -> tuple[float, float]:
    """Mean distance (m) in a `scene` and `field` after a kick at `point`, and by how much halves differ; NaN if lost.

    Means are weighted by sin², which takes out the axial mode.
    """
    flight = simulate(kicked(scene, point, DISTANCE_KICK), field, SECONDS, [])
    if flight.ended_by != "duration":
        return np.nan, np.nan
    height = -flight.lab.position[:, 2]
    whole, first, last = (
        float(np.average(part, weights=np.sin(np.pi * (np.arange(len(part)) + 0.5) / len(part)) ** 2))
        for part in (height, *np.array_split(height, 2))
    )
    return whole, abs(last - first)


AXES = "frequency of the rotor (Hz)", "levitation distance (mm)"


def _levitated(rotor: xr.Dataset) -> bool:
    configuration, value = (rotor[name].values.flat[0] for name in ("configuration", "value"))
    return value in article.CONFIGURATIONS[configuration].levitated


@each(showing.rotor_panels, 4.0, *AXES, sharex=True)
def models_figure(axes: Axes, rotor: xr.Dataset, color: Any) -> None:
    """The levitation distance of every rotor by finite elements and by the dipole."""
    frequency, distance, stable = _branch(rotor, "fem")
    plot_branch(axes, frequency, distance, stable, color=color, lw=1.8 if _levitated(rotor) else 0.8)
    axes.plot(*_branch(rotor, "dipole")[:2], ":", color=color, lw=0.8)
    found = case_with(rotor, model="fem")
    axes.plot(found["fold_frequency"], 1e3 * found["fold_distance"], "o", color=color, ms=3)
    axes.set_ylim(8, 52)
    key = {"finite elements, stable": "-", "unstable": "--", "point dipole": ":", "lowest frequency (fold)": "o"}
    showing.explain(axes, key, ms=3)
    showing.explain(axes, {"thick: levitated in the experiment": "-"}, lw=1.8)


@each(showing.rotor_panels, 3.4, *AXES, of=lambda r: r.isel(case=list(map(_levitated, each_case(r)))), sharex=True)
def formulas_figure(axes: Axes, rotor: xr.Dataset, color: Any) -> None:
    """The article's formulas and simulated trajectories beside the dipole's equilibrium, for rotors that levitated."""
    plot_branch(axes, *_side(rotor, "dipole", "near"), lw=0.8, color=color)
    for model, style in (("semi-analytic", ":"), ("analytic", "-.")):
        if model in rotor["model"]:
            axes.plot(*_side(rotor, model, "near")[:2], style, color=color)
    simulated = case_with(rotor, model=SIMULATED)
    axes.plot(simulated["flight_frequency"], 1e3 * simulated["flight_distance"], "x", ms=4, color=color)
    axes.set_ylim(8, 62)
    key = {"point dipole, stable": "-", "unstable": "--", "semi-analytic formula": ":"}
    showing.explain(axes, key | {"analytic formula, no gravity": "-.", "simulated trajectory, mean": "x"})


def _side(rotor: xr.Dataset, model: str, side: str) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Frequency (Hz), distance (mm) and whether it is stable on one side, by one model."""
    found = case_with(rotor, model=model).sel(side=side)
    return found["frequency"].values, 1e3 * found["distance"].values, article.stable_in_flight(found["growth"])


def _branch(rotor: xr.Dataset, model: str) -> tuple[Array, Array, NDArray[np.bool_]]:
    """As of `_side`, from the highest frequency on the far side through the fold to the highest on the near one."""
    fold, (near, far) = case_with(rotor, model=model), (_side(rotor, model, side) for side in SIDES)
    middle = [fold["fold_frequency"]], [1e3 * fold["fold_distance"]], [near[2][np.isfinite(near[1])][:1].any()]
    found = [np.concatenate([f[::-1], m, n]) for f, m, n in zip(far, middle, near, strict=True)]
    frequency, distance, stable = (values[np.isfinite(found[1])] for values in found)
    return frequency, distance, stable.astype(bool)


def _distance_lines(result: xr.Dataset) -> list[str]:
    rows, lines = [], []
    for label, rotor in showing.by_rotor(result):
        frequency, near, stable = _side(rotor, "dipole", "near")
        other = {name: _side(rotor, name, "near")[1] for name in rotor["model"].values}
        apart = [near - other["fem"], *(other.get(name, np.nan) - near for name in FORMULAS)]
        for model in FIELDS:
            _, distance, good = _side(rotor, model, "near")
            power = np.polyfit(np.log(frequency[good]), np.log(distance[good]), 1)[0] if good.sum() > 2 else np.nan
            lowest = f"{float(case_with(rotor, model=model)['fold_frequency']):.2f}"
            off = [showing.span(by[stable], "+.2f") for by in apart] if model == "dipole" else [""] * 3
            spans = showing.span(frequency[good]), showing.span(distance[good], ".2f")
            rows.append((f"{label}, {model}", lowest, *spans, power, *off))
    for configuration, part in showing.by_configuration(result):
        levitated = article.CONFIGURATIONS[configuration].levitated
        for model in FIELDS:
            found = cases_with(part, model=model)
            folds = found["fold_frequency"].values[np.isin(found["value"], levitated)]
            if len(folds) > 1:
                lines.append(
                    f"{configuration}, {model}: the levitated rotors lower the lowest frequency from {folds.max():.1f} "
                    f"to {folds.min():.1f} Hz, a factor of {folds.max() / folds.min():.2f}."
                )
    off_mean = [
        one["flight_distance"] - np.interp(one["flight_frequency"], one["frequency"], one["distance"].sel(side="near"))
        for one in each_case(cases_with(result, model=SIMULATED))
    ]
    if np.isfinite(off_mean).any():
        worst = 1e6 * np.nanmax(np.abs(off_mean))
        lines.append(f"Means of simulated trajectories agree with the equilibria within {worst:.3g} µm.")
    head = ("rotor, model", "lowest (Hz)", "stable (Hz)", "distance (mm)", "power of f")
    last = "Last columns: point dipole less finite elements, and each formula less the point dipole, in mm."
    return [*showing.text_table((*head, "- fem (mm)", "semi-an.", "analytic"), rows), last, *lines]


LEVITATION_DISTANCE = Study(
    name="levitation-distance",
    summary="distance against frequency for every rotor of the article: equilibria, its formulas, simulations",
    quick="all but one rotor of each kind, mutual magnetisation, two of three trajectories; steps of 10 not 2.5 Hz",
    points=lambda quick: [
        {"configuration": name, "value": value, "model": model, **(COARSE if quick else FINE)}
        for name, kind in article.CONFIGURATIONS.items()
        for value in (article.QUICK[name] if quick else kind.tested)
        for model in (*FORMULAS, *FIELDS)
        if (name, model) != ("vertical", "analytic")
    ],
    compute=levitation_distance,
    figures={"levitation-distance-models": models_figure, "levitation-distance-formulas": formulas_figure},
    report=_distance_lines,
)


# Linear fall, stable and unstable trajectory: distance against time, the article's last supplementary figure.
#
# Its experiment had δx = 1 mm and fell at 115 Hz, stayed at 140 Hz and was lost in oscillations at 150 Hz.  Each
# trajectory is simulated in full, from equilibrium with spin s = 0, and compared with the averaged one along the branch
# of equilibria.  In the motion are real air, eddy currents in floater and rotor, and mutual magnetisation; in that of
# `quick` Stokes drag and the floater's currents alone.
FREQUENCIES = np.array([115.0, 140.0, 150.0, 160.0, 170.0, 200.0])
ROUGHLY, WHOLLY = {"model": "dipole", "complete": False}, {"model": "fem", "complete": True}
# δx in mm: as in the experiment, what gives its fall at 115 Hz, and what is lost in oscillations within these
DISPLACEMENTS = (1.0, 1.5, 2.0)
KICK = 1e-3  # Speed with which a trajectory begins upwards, m/s
PARTS, SAMPLES = 400, 100
SHORTEST = 3.0  # What lasts for less, the article does not call levitation, s
REPORTED = {115.0: "linear fall", 140.0: "stable", 150.0: "oscillating loss"}  # The article's three, by Hz
NONE, SHORT = "no equilibrium", "lost within 3 s"  # Of a trajectory that is none
FLIGHT_COLUMNS: Columns = {
    "levitated": (("frequency",), "s", "time until the loss in the simulated trajectory, or its duration"),
    "averaged_levitated": (("frequency",), "s", "the same in the averaged trajectory; infinite for a balance"),
    "growth": (("frequency",), "1/s", "largest growth rate of a mode at the start"),
    "energy_error": (("frequency",), "1", "largest violation of the energy balance"),
    "time": (("frequency", "part"), "s", "middle of a part of the simulated trajectory"),
    "lowest": (("frequency", "part"), "m", "least distance in the part"),
    "mean": (("frequency", "part"), "m", "mean distance in the part"),
    "highest": (("frequency", "part"), "m", "largest distance in the part"),
    "averaged_time": (("frequency", "sample"), "s", "time of the averaged trajectory"),
    "averaged_distance": (("frequency", "sample"), "m", "distance of the averaged trajectory"),
    "kind": (("frequency",), "", "what became of the simulated trajectory"),
    "averaged_end": (("frequency",), "", "what ended the averaged trajectory"),
}


def trajectories(point: Point) -> xr.Dataset:
    complete = point.get("complete", False)
    scene = article.rotor_scene(point["configuration"], point["value"], article.HIGHEST)
    scene = replace(scene, **article.losses(scene, complete, complete))
    levitation = article.levitation_of(scene, point["model"], interaction="auto" if complete else "rigid")
    branch = levitating_branch(scene, levitation.interaction, levitation.rates, article.HIGHEST)
    sizes = {"frequency": len(FREQUENCIES), "part": PARTS, "sample": SAMPLES}
    found = {
        name: np.full([sizes[d] for d in dims], np.nan if unit else NONE, float if unit else "U20")
        for name, (dims, unit, _) in FLIGHT_COLUMNS.items()
    }
    for k, start in enumerate(branch.side("near", FREQUENCIES)):
        if start is not None:
            row = _flight_row(scene, levitation, start, point["duration_s"])
            for values, value in zip(found.values(), row, strict=True):
                values[k] = value
    frequency = variable(("frequency",), FREQUENCIES, "Hz", "frequency of the rotor")
    return recorded(point, FLIGHT_COLUMNS, found, {"frequency": frequency})


def _flight_row(scene: Scene, levitation: Levitation, start: BranchPoint, seconds: float) -> tuple[Any, ...]:
    there, field = replace(scene, frequency=start.parameter), levitation.interaction
    slow = drift(there, field, 0.0, article.FLIGHT, levitation.rates, Scales.of(there).unpack(start.state), stokes=True)
    times = np.linspace(0.0, slow.time[-1], SAMPLES)
    flight = simulate(kicked(there, start, KICK), field, seconds, [])
    lost_at_once = flight.ended_by != "duration" and flight.levitated_s < SHORTEST
    edges, distance = np.linspace(0.0, flight.time[-1], PARTS + 1), -flight.lab.position[:, 2]
    parts = [
        scipy.stats.binned_statistic(flight.time, distance, kind, edges).statistic for kind in ("min", "mean", "max")
    ]
    numbers = flight.levitated_s, slow.levitated_s, start.growth_per_s, flight.energy_error
    averaged, kind = np.interp(times, slow.time, slow.distance), SHORT if lost_at_once else flight_kind(flight)
    return *numbers, (edges[1:] + edges[:-1]) / 2, *parts, times, averaged, kind, slow.ended_by


@each(small_multiples, 3.6, 3, "time (s)", "levitation distance (mm)", of=showing.rotor_cases, sharey=True)
def flight_figure(panel: Axes, rotor: xr.Dataset) -> None:
    """The distance in each trajectory, one panel for each displacement."""
    showing.explain(panel, {f"{frequency:g} Hz": f"C{k}-" for k, frequency in enumerate(rotor["frequency"].values)})
    for k, color in zip(range(rotor.sizes["frequency"]), PALETTE, strict=False):
        one = rotor.isel(frequency=k)
        if one["kind"] == NONE:
            continue
        time, mean = one["time"], 1e3 * one["mean"]
        panel.fill_between(time, 1e3 * one["lowest"], 1e3 * one["highest"], color=color, alpha=0.3, lw=0)
        panel.plot(time, mean, color=color)
        panel.plot(one["averaged_time"], 1e3 * one["averaged_distance"], "--", color="k", lw=0.7)
        # an averaged trajectory that ends at the fold falls; what is lost otherwise is lost in an oscillation
        if one["kind"] not in ("stable", "drifting"):
            last = int(np.flatnonzero(np.isfinite(mean))[-1])
            mark = "v" if one["averaged_end"] == "fold" else "x"
            panel.plot(time[last], np.clip(mean[last], 12, 34), mark, color=color, ms=5)
    panel.set_ylim(11, 40)
    showing.explain(panel, {"averaged trajectory": "--", "lost at the fold": "v", "lost in oscillations": "x"}, ms=4)


def _flight_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for rotor in each_case(result):
        for k, frequency in enumerate(rotor["frequency"].values):
            one = rotor.isel(frequency=k)
            mean = 1e3 * one["mean"].dropna("part").values
            ends = "–" if not len(mean) else f"{mean[0]:.2f} to {mean[-1]:.2f}"
            numbers = [float(one[key]) for key in ("averaged_levitated", "growth", "energy_error")]
            cells = (one["kind"].item(), float(one["levitated"]), ends, one["averaged_end"].item(), *numbers)
            name = f"{article.rotor_label('horizontal', float(rotor['value']))}, {frequency:g} Hz"
            rows.append((name, *cells, REPORTED.get(float(frequency), "")))
    head = ("rotor", "simulated", "for (s)", "mean distance (mm)", "averaged", "for (s)", "growth (s⁻¹)", "energy")
    last = "Energy: violation of its balance. Article: what it reports for δx = 1 mm."
    return [*showing.text_table((*head, "article"), rows), last]


TRAJECTORIES = Study(
    name="trajectories",
    summary="linear fall, stable and unstable trajectory: the distance against time, simulated and averaged",
    quick="finite elements (point dipoles instead), eddy currents in the rotor, real air, mutual magnetisation",
    points=lambda quick: [
        {"configuration": "horizontal", **(ROUGHLY if quick else WHOLLY), "duration_s": 60.0, "value": value}
        for value in DISPLACEMENTS
    ],
    compute=trajectories,
    figures={"trajectories": flight_figure},
    report=_flight_lines,
)
