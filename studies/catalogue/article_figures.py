"""The article's figures of field, force along the axis and side mode, beside those of the finite magnets."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

from ...dynamics.continuation.frequencies import kicked, levitating_branch
from ...dynamics.flights.flight import simulate
from ...dynamics.motion.state import polar_angle
from ...geometry.common import Array
from ..figures.style import DASHES, NAMES, PALETTE, drawn, panels, plain_log, plot_branch
from ..levitation import Levitation
from ..plan import sources
from ..result import Columns, variable
from ..study import Point, Study, case_with, cases_with, recorded
from . import article, showing
from .article import force, side_radius

# On-axis and off-axis field at several places of the floater against the parameter of each of the article's rotors.
DISTANCES = np.array([15e-3, 20e-3, 25e-3, 30e-3, 40e-3])  # Below the rotor, m; the article does not give its own
FIELD_MODELS = ("article", "dipole", "cuboid", "fem")
FIELD_COLUMNS: Columns = {
    "off_axis": (("distance",), "T", "field across the axis"),
    "on_axis": (("distance",), "T", "field along the axis"),
    "field_error": (("distance",), "T", "estimated error of the field"),
}


def field_components(point: Point) -> xr.Dataset:
    rotor = point["configuration"], point["value"]
    if point["model"] == "article":
        across, along = article.INTERACTION / article.FLOATER.moment * article.parts(*rotor, DISTANCES, 0.0)[:2]
        across, error = np.abs(across), 0 * DISTANCES
    else:
        model = sources(article.levitation_of(article.rotor_scene(*rotor), point["model"]).table)
        places = DISTANCES[:, None] * np.array([0.0, 0.0, -1.0])
        b, _ = model.evaluate(places)
        across, along, error = np.hypot(b[:, 0], b[:, 1]), b[:, 2], model.absolute_error(places)[0]
    there = variable(("distance",), DISTANCES, "m", "distance from the rotor's origin along the axis")
    return recorded(point, FIELD_COLUMNS, (across, along, error), {"distance": there})


def deviations(part: xr.Dataset) -> dict[str, Any]:
    """|B - B_fem| / |B_fem| (case, distance) of each simpler model, and the finite elements' own error."""
    true = cases_with(part, model="fem")
    size = np.hypot(true["off_axis"], true["on_axis"])
    found: dict[str, Any] = {"fem": true["field_error"] / size}
    for model in FIELD_MODELS[:-1]:
        off_axis, on_axis = (cases_with(part, model=model)[name] - true[name] for name in COMPONENTS)
        found[model] = np.hypot(off_axis, on_axis) / size
    return found


COMPONENTS = {"off_axis": r"off-axis field $B_\perp$ (mT)", "on_axis": r"on-axis field $B_z$ (mT)"}


@drawn
def components_figure(result: xr.Dataset) -> Figure:
    """Both components of the field below the rotor against the parameter of each configuration."""
    styles = {"fem": DASHES["fem"], "dipole": DASHES["dipole"], "article": "+"}
    configurations = dict(showing.by_configuration(result))
    figure, axes = panels(2, len(configurations), 2.5)
    for row, (quantity, label) in zip(axes, COMPONENTS.items(), strict=True):
        values = 1e3 * result[quantity]
        row[0].set_ylabel(label)
        for panel, (configuration, part) in zip(row, configurations.items(), strict=True):
            for model, style in styles.items():
                found = cases_with(part, model=model)
                for k, color in zip(range(found.sizes["distance"]), PALETTE, strict=False):
                    panel.plot(found["value"], 1e3 * found[quantity][:, k], style, color=color, ms=4)
            plain_log(panel.yaxis)
            panel.set(xlabel=article.label_of(configuration), ylim=(0.8 * values.min(), 1.25 * values.max()))
    names = {**NAMES, "article": "formulas of the article"}
    _explain(axes[0, 0], result, {names[model]: style for model, style in styles.items()})
    return figure


@drawn
def differences_figure(result: xr.Dataset) -> Figure:
    """How far the simpler models are from the finite elements."""
    figure, rows = showing.configuration_panels(result, 2.7, ylabel="deviation |ΔB| / |B| (%)")
    worst = 0.0
    for axes, part in rows:
        value, off = cases_with(part, model="fem")["value"], deviations(part)
        for k, color in zip(range(part.sizes["distance"]), PALETTE, strict=False):
            for model in ("dipole", "cuboid"):
                axes.plot(value, 100 * off[model][:, k], DASHES[model], color=color)
        worst = max(worst, 100 * float(off["fem"].max()))
        axes.set_ylim(0, None)
    names = {NAMES[model]: DASHES[model] for model in ("dipole", "cuboid")}
    _explain(rows[0][0], result, names | {f"error of the finite elements: at most {worst:.1g} %": " "})
    return figure


def _explain(axes: Axes, result: xr.Dataset, models: dict[str, str]) -> None:
    places = {f"distance {1e3 * distance:g} mm": f"C{k}-" for k, distance in enumerate(result["distance"].values)}
    showing.explain(axes, places | models)


def _components_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for configuration, part in showing.by_configuration(result):
        true, off = cases_with(part, model="fem"), deviations(part)
        for k, distance in enumerate(1e3 * result["distance"].values):
            ends = [" to ".join(f"{1e3 * true[q].values[n, k]:.3f}" for n in (0, -1)) for q in ("off_axis", "on_axis")]
            worst = [f"{100 * float(off[name][:, k].max()):.2g}" for name in ("dipole", "cuboid", "article", "fem")]
            rows.append((f"{configuration}, {distance:g} mm", *ends, *worst))
    head = ("rotors, distance", "off-axis (mT)", "on-axis (mT)", "dipole", "μr = 1", "formula", "error")
    last = "Largest deviations from the finite elements, and their own estimated error, in per cent of |B|."
    return [*showing.text_table(head, rows), last]


FIELD_COMPONENTS = Study(
    name="field-components",
    summary="off-axis and on-axis field against the parameter of each rotor of the article, by four models",
    quick="all but three rotors of each kind",
    points=lambda quick: [
        {"configuration": name, "value": value, "model": model}
        for name, kind in article.CONFIGURATIONS.items()
        for value in (kind.tested[:: (len(kind.tested) - 1) // 2] if quick else kind.tested)
        for model in FIELD_MODELS
    ],
    compute=field_components,
    figures={"field-components": components_figure, "field-components-differences": differences_figure},
    report=_components_lines,
)


# Force along the axis against distance, with its repelling and its attracting part: the article's second figure.
ROTOR = {"configuration": "horizontal", "value": 1.0}  # Of the article's figure; its text does not give the frequency
COARSE = {"frequencies_hz": [170.0], "spacing": 5e-4}
FINE = {"frequencies_hz": [165.0, 170.0, 185.0, 200.0], "spacing": 1e-4}
FORCE_MODELS = ("semi-analytic", "small angles", "dipole", "fem")
# θ at the tipping point nearest to the rotor, °, in the article's text, and where that calls it almost zero, m
REPORTED_ANGLE, REPORTED_DISTANCE = 9.0, 0.04
BOTH, ONE = ("frequency", "distance"), ("frequency",)
FORCE_COLUMNS: Columns = {
    "attracting": (BOTH, "N", "force by the on-axis field, upwards"),
    "repelling": (BOTH, "N", "force by the rotating field, upwards"),
    "force_error": (BOTH, "N", "error of the force by the field's own estimate"),
    "polar_angle": (BOTH, "rad", "polar angle of the moment"),
    "equilibrium": (ONE, "m", "stable point"),
    "far_tipping": (ONE, "m", "tipping point far from the rotor"),
    "near_tipping": (ONE, "m", "tipping point near the rotor: released there the floater just reaches the far one"),
    "angle_near": (ONE, "rad", "polar angle at the near tipping point"),
    "angle_equilibrium": (ONE, "rad", "polar angle at the stable point"),
}


def force_curve(point: Point) -> xr.Dataset:
    grid, rotor = np.arange(article.CONTACT, 0.0451, point["spacing"]), (point["configuration"], point["value"])
    frequencies = np.asarray(point["frequencies_hz"], float)
    if point["model"] in FORCE_MODELS[:2]:
        found = [force(*rotor, grid, frequency, point["model"] == "small angles") for frequency in frequencies]
        rows = np.array([[one.attracting, one.repelling, np.zeros_like(grid), one.polar_angle] for one in found])
    else:
        shared = article.levitation_of(article.rotor_scene(*rotor, frequencies[0]), point["model"])
        rows = np.array([_along_curve(shared.elsewhere(frequency=float(f)), grid) for f in frequencies])
    marks = np.array([_balance_points(grid, row[0] + row[1], row[3]) for row in rows])
    frequency = variable(ONE, frequencies, "Hz", "frequency of the rotor")
    axes = {"frequency": frequency, "distance": variable(("distance",), grid, "m", "distance along the axis")}
    return recorded(point, FORCE_COLUMNS, (*rows.swapaxes(0, 1), *marks.T), axes)


def _along_curve(levitation: Levitation, grid: Array) -> Array:
    """The first four columns (4, n) on the curve of the stable equilibrium, where the moment is nearest to upright."""
    model, curves = sources(levitation.table), levitation.without_plate.curves
    curve = max(curves, key=lambda curve: float(curve.moment[:, 2].max()))
    parts = article.FLOATER.moment * curve.moment * model.evaluate(curve.position)[1][:, :, 2]
    error = article.FLOATER.moment * model.absolute_error(curve.position)[1]
    found = np.stack([parts[:, 2], parts[:, 0] + parts[:, 1], error, polar_angle(curve.moment)])
    order = np.argsort(-curve.position[:, 2])
    return np.asarray(CubicSpline(-curve.position[order, 2], found[:, order], axis=1, extrapolate=False)(grid))


def _balance_points(distance: Array, magnetic: Array, angle: Array) -> tuple[float, float, float, float, float]:
    """Stable point, far and near tipping points (m), θ at the near and at the stable one; NaN where there is none."""
    known = np.isfinite(magnetic)
    rest = PchipInterpolator(distance[known], magnetic[known] - article.WEIGHT)
    roots = rest.roots(extrapolate=False)
    if np.isfinite(roots).sum() < 2:
        return (np.nan,) * 5
    stable, far = roots[np.isfinite(roots)][-2:].tolist()
    # released at the near one, the floater comes to rest at the far one
    work, low, near = rest.antiderivative(), distance[known][0], np.nan
    if work(far) < work(low):
        near = brentq(lambda d: work(far) - work(d), low, stable)
    theta = PchipInterpolator(distance[known], angle[known])
    return stable, far, near, float(theta(near)), float(theta(stable))


STYLES = {"fem": ("-", "finite elements"), "dipole": ("--", "point dipole")}
STYLES |= {"semi-analytic": (":", "article, semi-analytic"), "small angles": ("-.", "article, small angles")}
POINTS = {"near_tipping": ("<", "near tipping point"), "equilibrium": ("o", "stable")}
POINTS["far_tipping"] = (">", "far tipping point")


@drawn
def parts_figure(result: xr.Dataset) -> Figure:
    """Attraction, repulsion and net force at one frequency by each way of computing, and how far these are apart."""
    figure, ((left, right),) = panels(1, 2, 3.9)
    one = result.isel(frequency=min(1, result.sizes["frequency"] - 1))
    true = case_with(one, model="fem")
    for model, (style, _) in STYLES.items():
        found = case_with(one, model=model)
        for part, color in (("attracting", PALETTE[0]), ("repelling", PALETTE[1])):
            _plot(left, found, found[part], style, color=color, lw=1.0)
            if model != "fem":
                # in units of the weight: the parts themselves cross zero
                _plot(right, found, 100e-3 * (found[part] - true[part]) / article.WEIGHT, style, color=color)
        _plot(left, found, _net(found), style, color="k")
    _mark(left, true, PALETTE[2])
    key = {text: style for style, text in STYLES.values()} | {"attracting part": "C0-", "repelling part": "C1-"}
    key |= {"net force, with gravity": "k-", **{words: symbol for symbol, words in POINTS.values()}}
    showing.explain(left, key, ms=5)
    left.axhline(0.0, color="0.3", lw=0.6)
    left.set(ylabel="force, upwards (mN)", ylim=(-470, 350), title=f"(a) δx = 1 mm, {float(one['frequency']):g} Hz")
    right.set(ylabel="deviation from finite elements\n(% of the weight)", ylim=(-25, 25))
    return figure


@drawn
def net_figure(result: xr.Dataset) -> Figure:
    """The net force at every frequency, and the polar angle that goes with it."""
    figure, ((net, angle),) = panels(1, 2, 3.2)
    for k, color in zip(range(result.sizes["frequency"]), PALETTE, strict=False):
        for model in ("dipole", "fem"):
            found = case_with(result, model=model).isel(frequency=k)
            _plot(net, found, _net(found), STYLES[model][0], color=color)
        _mark(net, found, color)
        _plot(angle, found, 1e-3 * np.degrees(found["polar_angle"].values), "-", color=color)
        showing.explain(net, {f"{float(found['frequency']):g} Hz": f"C{k}-"})
    showing.explain(net, {text: style for style, text in [*list(STYLES.values())[:2], *POINTS.values()]}, ms=5)
    net.axhline(0.0, color="0.3", lw=0.6)
    net.set(ylabel="net force, with gravity (mN)", ylim=(-60, 1.1e3 * float(_net(result).max())))
    angle.axhline(REPORTED_ANGLE, color="0.4", lw=0.8, ls="-.", label="near tipping point in the article")
    angle.set(ylabel="polar angle θ (°)", ylim=(0, 20))
    return figure


def _net(found: xr.Dataset) -> xr.DataArray:
    return found["attracting"] + found["repelling"] - article.WEIGHT


def _plot(axes: Axes, found: xr.Dataset, values: ArrayLike, style: str, **more: Any) -> None:
    axes.plot(1e3 * found["distance"], 1e3 * np.asarray(values), style, **more)
    axes.set(xlabel="distance along the axis (mm)", xlim=(11, 45))


def _mark(axes: Axes, found: xr.Dataset, color: str) -> None:
    for name, (symbol, _) in POINTS.items():
        axes.plot(1e3 * float(found[name]), 0.0, symbol, color=color, ms=5)


def _force_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for k, frequency in enumerate(result["frequency"].values):
        for model, (_, text) in STYLES.items():
            found = case_with(result, model=model).isel(frequency=k)
            far = np.interp(REPORTED_DISTANCE, result["distance"], found["polar_angle"])
            places = [f"{1e3 * float(found[name]):.3f}" for name in POINTS]
            angles = [f"{np.degrees(float(a)):.2f}" for a in (found["angle_near"], found["angle_equilibrium"], far)]
            rows.append((f"{frequency:g} Hz, {text}", *places, *angles))
    head = ("δx = 1 mm", "near tipping (mm)", "stable (mm)", "far tipping (mm)", "θ near (°)", "θ stable", "θ at 40 mm")
    return [*showing.text_table(head, rows), "The article: θ = 9° at the near tipping point, almost zero at 40 mm."]


FORCE_CURVE = Study(
    name="force-curve",
    summary="force along the axis with its parts, stable and tipping points; the article's formulas and full fields",
    quick="all but one of four frequencies; distances 0.5 mm apart instead of 0.1 mm",
    points=lambda quick: [{**ROTOR, **(COARSE if quick else FINE), "model": model} for model in FORCE_MODELS],
    compute=force_curve,
    figures={"force-curve-parts": parts_figure, "force-curve-net": net_figure},
    report=_force_lines,
)


# The circle on which the floater goes with the rotor: its radius in the finite magnets' field, simulated, by formula.
# Speed upwards with which the trajectory begins, m/s; its duration, s; samples of its last turns that are kept
KICK, SECONDS, SAMPLES = 0.01, 2.0, 400
# Of the trajectory of `ROTOR` in the article's figure: Hz, and how many of its last turns are shown
SIMULATED_HZ, TURNS = 170.0, 3
TYPICAL = (0.1, 0.3)  # Radii that the article calls typical, mm
SIDE_COLUMNS: Columns = {
    "radius": (("frequency",), "m", "radius of the floater's circle"),
    "distance": (("frequency",), "m", "levitation distance"),
    "growth": (("frequency",), "1/s", "largest growth rate of a mode"),
    "article_radius": (("frequency",), "m", "𝒢/(μ_f ω²) at the same distance"),
    "flight_angle": (("sample",), "rad", "angle of the rotor"),
    "flight_x": (("sample",), "m", "x of the simulated floater, laboratory frame"),
    "flight_y": (("sample",), "m", "y of the simulated floater, laboratory frame"),
    "flight_z": (("sample",), "m", "z of the simulated floater"),
}


def side_mode(point: Point) -> xr.Dataset:
    grid = np.arange(article.LOWEST, article.HIGHEST + 1e-9, point["step_hz"])
    scene = article.rotor_scene(point["configuration"], point["value"], article.HIGHEST)
    levitation = article.levitation_of(scene, point["model"])
    field = sources(levitation.table)
    branch = levitating_branch(scene, field, levitation.rates, article.HIGHEST)
    rows = np.full((len(grid), 3), np.nan)
    for row, there in zip(rows, branch.side("near", grid), strict=True):
        if there is not None:
            row[:] = np.hypot(*there.position[:2]), -there.position[2], there.growth_per_s
    simulated = np.full((4, SAMPLES), np.nan)
    (start,) = branch.side("near", np.array([SIMULATED_HZ]))
    if start is not None and ROTOR.items() <= point.items():
        flight = simulate(kicked(scene, start, KICK), field, SECONDS, [])
        times = flight.time[-1] - np.linspace(TURNS / SIMULATED_HZ, 0.0, SAMPLES)
        place = [np.interp(times, flight.time, column) for column in flight.lab.position.T]
        simulated = np.array([2 * np.pi * SIMULATED_HZ * times, *place])
    frequency = variable(("frequency",), grid, "Hz", "frequency of the rotor")
    found = (*rows.T, side_radius(rows[:, 1], grid), *simulated)
    return recorded(point, SIDE_COLUMNS, found, {"frequency": frequency})


def _predicted(simulated: xr.Dataset) -> float:
    return 1e3 * float(side_radius(-float(simulated["flight_z"].mean()), SIMULATED_HZ))


@drawn
def orbit_figure(result: xr.Dataset) -> Figure:
    """The orbit of rotor and floater seen from above, and their coordinates, in one trajectory."""
    figure, ((above, *others),) = panels(1, 3, 2.9)
    simulated = case_with(result, model="fem", **ROTOR)
    circle, radius = np.linspace(0, 2 * np.pi, 200), _predicted(simulated)
    x, y, turned = 1e3 * simulated["flight_x"], 1e3 * simulated["flight_y"], simulated["flight_angle"].values
    above.plot(np.cos(circle), np.sin(circle), color=PALETTE[1], label="rotor's cube")
    above.plot(x, y, color=PALETTE[0], label="floater")
    above.plot(radius * np.cos(circle), radius * np.sin(circle), ":k", lw=1.6, label="radius a of the formula")
    above.plot(np.cos(turned[-1]), np.sin(turned[-1]), "o", color=PALETTE[1], ms=4, label="at one time")
    above.plot(x[-1], y[-1], "o", color=PALETTE[0], ms=4)
    above.set(xlabel="x (mm)", ylabel="y (mm)", title=f"(a) from above, {SIMULATED_HZ:g} Hz", aspect="equal")
    time = 1e3 * (turned - turned[0]) / (2 * np.pi * SIMULATED_HZ)
    for panel, name, floater, turn in zip(others, "xy", (x, y), (np.cos, np.sin), strict=True):
        panel.plot(time, turn(turned), color=PALETTE[1])
        panel.plot(time, floater, color=PALETTE[0])
        for sign in (-1, 1):
            panel.axhline(sign * radius, color="k", ls=":", lw=1.6)
        panel.set(xlabel="time (ms)", ylabel=f"{name} (mm)")
    return figure


@showing.each(showing.rotor_panels, 3.2, "frequency of the rotor (Hz)", "radius of the side mode (mm)")
def radius_figure(axes: Axes, rotor: xr.Dataset, color: Any) -> None:
    """The radius of the side mode against frequency for every rotor, and the article's formula."""
    axes.axhspan(*TYPICAL, color="0.92", lw=0, label="called typical in the article")
    found = case_with(rotor, model="fem")
    frequency, stable = found["frequency"], article.stable_in_flight(found["growth"])
    plot_branch(axes, frequency, 1e3 * found["radius"], stable, color=color)
    axes.plot(frequency, 1e3 * found["article_radius"], ":", lw=1.6, color=color)
    axes.set_xlim(35, 255)
    plain_log(axes.yaxis)
    key = {"stable": "-", "unstable": "--", "$\\mathcal{G}/\\mu_f\\omega^2$ of the article": ":"}
    showing.explain(axes, key)


def _side_lines(result: xr.Dataset) -> list[str]:
    lines, rows = [], []
    for simulated in (case_with(result, model=model, **ROTOR) for model in article.MODELS):
        radius = 1e3 * np.hypot(simulated["flight_x"].values, simulated["flight_y"].values)
        lines.append(
            f"Simulated δx = 1 mm at {SIMULATED_HZ:g} Hz, {simulated['model'].item()}: radius {radius.mean():.4f} mm "
            f"({showing.span(radius, '.4f')}) at {-1e3 * float(simulated['flight_z'].mean()):.3f} mm; "
            f"𝒢/(μ_f ω²) = {_predicted(simulated):.4f} mm."
        )
    for label, rotor in showing.by_rotor(result):
        cells = []
        for found in (case_with(rotor, model=model) for model in article.MODELS):
            radius = found["radius"].where(article.stable_in_flight(found["growth"]))
            off = 100 * (found["article_radius"] / radius - 1)
            cells += [showing.span(1e3 * radius, ".3f"), showing.span(off, "+.1f")]
        rows.append((label, *cells))
    head = ("where stable", *(f"{model} {words}" for model in article.MODELS for words in ("(mm)", "formula off (%)")))
    return [*lines, *showing.text_table(head, rows)]


SIDE_MODE = Study(
    name="side-mode",
    summary="the circle on which the floater goes with the rotor, and the article's formula for its radius",
    quick="all but one rotor of each kind; frequencies 10 Hz apart instead of 2.5 Hz",
    points=lambda quick: [
        {"configuration": name, "value": value, "model": model, "step_hz": 10.0 if quick else 2.5}
        for name, kind in article.CONFIGURATIONS.items()
        for value in (article.QUICK[name] if quick else kind.levitated)
        for model in article.MODELS
    ],
    compute=side_mode,
    figures={"side-mode-orbit": orbit_figure, "side-mode-radius": radius_figure},
    report=_side_lines,
)
