"""How exactly a rotor must be made, and which rotor leaves the largest margin."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import scipy
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from ...dynamics.continuation.branch import BranchPoint
from ...dynamics.continuation.frequencies import (
    HIGHEST,
    LONG_STEPS,
    LOWEST,
    StableRange,
    at_frequency,
    by_frequency,
    levitates,
    stability_end,
)
from ...dynamics.equilibria.balance import AXIAL, LATERAL, Balance, solve
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...dynamics.motion.equations import parameters
from ...dynamics.motion.events import rotor_gap
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.state import Scales
from ...geometry.common import MU_0, Array
from ...geometry.scene.contents import Floater, Scene
from ..cli.console import note
from ..cli.options import FieldModel
from ..figures.style import PALETTE, legend_below, styled
from ..result import Columns, variable
from ..study import Point, Study, case_with, cases_with, each_case, recorded
from .article import CONFIGURATIONS, FLOATER, REMANENCE, polar_angle
from .drawing import TITLES, by_rotor, configuration_panels, explain, rotor_panels, rotor_places, small_multiples
from .scenes import article_scene, levitated_rotors, levitation_of, stable_frequencies
from .tables import text_table, uncertain

# Which parameter matters: derivatives by each, and what realistic tolerances of all make of a rotor.
MODEL: FieldModel = "cuboid"
FRACTIONS = (0.1, 0.5, 0.9)  # Places in the range of stable frequencies at which the distance is asked for


@dataclass(frozen=True)
class Known:
    """A parameter as it is known: nominal value and half the width of an even distribution of its tolerance, SI units.

    `spread` is the standard deviation where the distribution is normal.
    """

    words: str
    nominal: float
    spread: float
    normal: bool = False


PARAMETERS = {
    "measure": Known("displacement or tilt", np.nan, 0.1, True),
    "rotor_remanence": Known("rotor's remanence", 1.305, 0.015),
    "floater_remanence": Known("floater's remanence", 1.305, 0.015),
    "density": Known("density", 7500.0, 100.0),
    "edge": Known("edge of the cube", 10e-3, 0.1e-3),
    "diameter": Known("diameter of the sphere", 12.7e-3, 0.05e-3),
    "gravity": Known("gravity", 9.81, 0.0),
    "frequency": Known("frequency", np.nan, 0.5, True),
}  # Remanence: the article's 1.29 to 1.32 T. Size: what makers of magnets give. Place of the cube: 0.1 mm, tilt 0.5°
TILT_SPREAD = 0.5
TILTS = (1.0, 2.0)  # Of the axis from the vertical, degrees
QUANTITIES = ("lowest", "highest", *(f"distance at {f:.0%}" for f in FRACTIONS))
PLACE = "frequency"
STEP = 1e-3  # Relative step of the central differences; twice that for their error
SEED = 20250706
COLUMNS: Columns = {
    "nominal": (("quantity",), "Hz or m", "as it should be"),
    "derivative": (("parameter", "quantity"), "of the quantity by SI, mm or °", "derivative"),
    "derivative_error": (("parameter", "quantity"), "as the derivative", "estimated error"),
    "sample": (("draw", "quantity"), "Hz or m", "with a draw of the tolerances"),
    "drawn": (("draw", "parameter"), "SI, mm or °", "deviation of the parameter"),
    "frequency": (("fraction",), "Hz", "frequency at which the distance is asked for"),
    "leaning_distance": (("lean",), "m", "mean distance with the axis tilted from the vertical"),
    "leaning_growth": (("lean",), "1/s", "largest growth rate with the axis tilted"),
}


@dataclass(frozen=True, eq=False)
class Nominal:
    """What one rotor does with all parameters as they should be."""

    configuration: str  # of the rotor
    model: FieldModel  # of its field
    values: dict[str, float]  # of the parameters
    range: StableRange  # its stable frequencies

    @property
    def grid(self) -> Array:
        """Frequencies at which the distance is asked for, Hz."""
        low, high = self.range.low.parameter, self.range.high.parameter
        return low + (high - low) * np.array(FRACTIONS)


def spread_of(name: str, configuration: str) -> float:
    """How well a parameter is known, as of `Known`."""
    return TILT_SPREAD if (name, configuration) == ("measure", "tilt") else PARAMETERS[name].spread


def scene_of(configuration: str, values: dict[str, float], frequency: float = 100.0) -> Scene:
    """The scene of a rotor with all parameters given by name (SI; measure: mm or °), at a frequency in Hz."""
    floater = Floater(values["diameter"] / 2, values["floater_remanence"], 1.05, values["density"])
    scene = article_scene(
        configuration, values["measure"], frequency, drag=False,
        edge=values["edge"], remanence=values["rotor_remanence"], permeability=1.0, floater=floater,
    )  # fmt: skip
    return replace(scene, gravity=np.array([0.0, 0.0, -values["gravity"]]))


def nominal(configuration: str, measure: float, model: FieldModel = MODEL) -> Nominal:
    """The rotor as it should be, its field by `model`. Raises EquilibriumError where it does not levitate."""
    values = {name: known.nominal for name, known in PARAMETERS.items() if name != PLACE} | {"measure": measure}
    scene = scene_of(configuration, values)
    found = stable_frequencies(scene, levitation_of(scene, model).rates)
    return Nominal(configuration, model, values, found)


def levitation(base: Nominal, values: dict[str, float], shift: float = 0.0) -> Array:
    """Lowest and highest frequency (Hz) and the distances (m) with other values of the parameters; NaN where none.

    Parameters
    ----------
    base : the rotor as it should be
    values : of the parameters
    shift : of the frequencies at which the distance is asked for, Hz
    """
    scene = scene_of(base.configuration, values)
    rates = levitation_of(scene, base.model).rates
    middle = base.range.near(base.grid[1])
    family, row = by_frequency(scene, rates), np.full(len(QUANTITIES), np.nan)
    try:
        row[:2] = [
            stability_end(scene, family, middle.state, middle.parameter, end, LONG_STEPS).parameter
            for end in (LOWEST, HIGHEST)
        ]
    except EquilibriumError:
        return row
    for k, frequency in enumerate(base.grid + shift, 2):
        if row[0] < frequency < row[1]:
            row[k] = at_frequency(scene, rates, middle, float(frequency), LONG_STEPS).distance
    return row


def sensitivity_points(quick: bool) -> list[Point]:
    """The rotors that levitated, how many samples of the tolerances are drawn, and steps of the differences.

    One step alone gives derivatives without an estimate of their error, which is then NaN.
    """
    more = {"field": MODEL, "samples": 4 if quick else 32, "steps": [1] if quick else [1, 2]}
    return [{**rotor, **more} for rotor in levitated_rotors(quick)]


def derivatives(base: Nominal, factors: Sequence[int] = (1, 2)) -> tuple[Array, Array]:
    """Derivatives (parameter, quantity) by each parameter in SI units (measure: mm or °), and their errors."""
    rows = []
    for name in PARAMETERS:
        size = float(base.grid[1]) if name == PLACE else base.values[name]
        slopes = [slope_by(base, name, STEP * size * factor) for factor in factors]
        # of second order: with twice the step the error is four times as large
        rows.append((slopes[0], np.abs(slopes[1] - slopes[0]) / 3 if len(slopes) > 1 else np.nan * slopes[0]))
    values, errors = np.array(rows).swapaxes(0, 1)
    return values, errors


def slope_by(base: Nominal, name: str, step: float) -> Array:
    """Derivatives (quantity,) by one parameter, as a central difference of `step` (SI; measure: mm or °)."""
    ahead, back = (_off(base, {name: sign * step}) for sign in (1, -1))
    return np.asarray((ahead - back) / (2 * step))


def _off(base: Nominal, off: dict[str, float]) -> Array:
    values = {name: value + off.get(name, 0.0) for name, value in base.values.items()}
    return levitation(base, values, off.get(PLACE, 0.0))


def sampled(base: Nominal, samples: int) -> tuple[Array, Array]:
    """What `samples` draws of the tolerances give (sample, quantity), and the draws (sample, parameter).

    A Latin hypercube: each parameter's draws are spread evenly (McKay, Beckman, Conover, Technometrics 21 (1979) 239).
    """
    generator = np.random.default_rng(SEED)
    ranks = generator.permuted(np.tile(np.arange(samples)[:, None], len(PARAMETERS)), axis=0)
    levels = (ranks + generator.random(ranks.shape)) / samples
    draws = np.zeros((samples, len(PARAMETERS)))
    for k, (name, known) in enumerate(PARAMETERS.items()):
        unit = scipy.special.ndtri(levels[:, k]) if known.normal else 2 * levels[:, k] - 1
        draws[:, k] = spread_of(name, base.configuration) * unit
    return np.array([_off(base, dict(zip(PARAMETERS, draw, strict=True))) for draw in draws]), draws


def leaning(base: Nominal) -> tuple[Array, Array]:
    """Distance (m) and largest growth (1/s) in the middle of the range, upright and with the axis tilted by `TILTS`."""
    scene = scene_of(base.configuration, base.values, float(base.grid[1]))
    levitation = levitation_of(scene, base.model)
    here = at_frequency(scene, levitation.rates, base.range.near(scene.frequency), scene.frequency)
    found = []
    for tilt in np.radians([0.0, *TILTS]):
        there = levitation.elsewhere(gravity=9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)]))
        near = (e for e in there.equilibria if abs(e.distance - here.distance) < 1e-3)
        found.append(next(((e.distance, e.growth_per_s) for e in near), (np.nan, np.nan)))
    distance, growth = np.array(found).T
    return distance, growth


def sensitivity(point: Point) -> xr.Dataset:
    """Derivatives, tolerance band and tilt of one rotor."""
    base = nominal(point["configuration"], point["measure"], point["field"])
    slopes, samples = derivatives(base, point["steps"]), sampled(base, point["samples"])
    lean = variable(("lean",), np.array([0.0, *TILTS]), "°", "tilt of the axis from the vertical")
    axes = {"parameter": list(PARAMETERS), "quantity": list(QUANTITIES), "fraction": list(FRACTIONS), "lean": lean}
    found = (levitation(base, base.values), *slopes, *samples, base.grid, *leaning(base))
    return recorded(point, COLUMNS, found, axes)


MIDDLE = QUANTITIES[3]
SCALES = {"lowest": (1.0, "Hz"), "highest": (1.0, "Hz"), MIDDLE: (1e3, "mm")}
"""Quantities of the report, with scale and unit."""
PERCENTILES = (5, 95)
BANDS = f"{PERCENTILES[0]} to {PERCENTILES[1]} % of the rotors"


def contributions(one: xr.Dataset, quantity: str) -> tuple[xr.DataArray, xr.DataArray]:
    """What one standard deviation of each parameter does to a quantity of one rotor (Hz or mm), and its error."""
    configuration = str(one["configuration"].values)
    deviation = [
        spread_of(name, configuration) / (1 if known.normal else np.sqrt(3)) for name, known in PARAMETERS.items()
    ]
    spread = xr.DataArray(deviation, {"parameter": list(PARAMETERS)}, "parameter")
    first, second = (one[name].sel(quantity=quantity) for name in ("derivative", "derivative_error"))
    return abs(SCALES[quantity][0] * first * spread), abs(SCALES[quantity][0] * second * spread)


@styled
def contributions_figure(result: xr.Dataset, quantity: str, words: str) -> Figure:
    """What one standard deviation of each parameter does to distance or lowest frequency; with errors."""
    figure, rotors = rotor_panels(result, 3.6, words, "")
    names = [name for name in PARAMETERS if name != "gravity"]
    places = np.arange(len(names))
    for axes, rotor, color in rotors:
        own = [each for panel, each, _ in rotors if panel is axes]
        k, width = next(k for k, each in enumerate(own) if each is rotor), 0.8 / len(own)
        value, error = (each.sel(parameter=names) for each in contributions(rotor.isel(case=0), quantity))
        axes.barh(places + (k + 0.5) * width - 0.4, value, width, xerr=error, color=color, error_kw={"lw": 0.7})
        axes.xaxis.set_major_locator(MaxNLocator(4))
    rotors[0][0].set_yticks(places, [PARAMETERS[name].words for name in names])
    rotors[0][0].invert_yaxis()
    return figure


@styled
def bands_figure(result: xr.Dataset, quantities: Sequence[str], words: str) -> Figure:
    """Quantities of the rotors within all tolerances together."""
    figure, rows = configuration_panels(result, 2.6, ylabel=words, sharey=True)
    for axes, configuration, part in rows:
        for name, color in zip(quantities, PALETTE, strict=False):
            middle, low, high = band(part, name)
            style: Any = {"fmt": "s", "ms": 4, "capsize": 3, "color": color, "label": name}
            axes.errorbar(rotor_places(axes, configuration, part), middle, [middle - low, high - middle], **style)
    explain(rows[0][0], {f"median, and {BANDS}": "s"}, ms=4)
    legend_below(figure)
    return figure


def band(part: xr.Dataset, quantity: str) -> Array:
    """Median and the two percentiles (3, ...) of what the tolerances give, Hz or mm."""
    values = part["sample"].sel(quantity=quantity).values
    return np.asarray(SCALES[quantity][0] * np.nanpercentile(values, [50, *PERCENTILES], axis=-1))


def sensitivity_lines(result: xr.Dataset) -> list[str]:
    slopes, bands, leading, leans = [], [], [], []
    names = [known.words for known in PARAMETERS.values()]
    for head, rotor in by_rotor(result):
        one = rotor.isel(case=0)
        slope, doubt = (one[name].sel(parameter="measure") for name in ("derivative", "derivative_error"))
        ends = [uncertain(slope.sel(quantity=q), doubt.sel(quantity=q)) for q in QUANTITIES[:2]]
        unit = CONFIGURATIONS[str(one["configuration"].values)].unit
        slopes.append((f"{head}, per {unit}", *ends, *(1e3 * slope.values[2:])))
        bands.append((head, *("{:.2f} ({:.2f} to {:.2f})".format(*band(one, name)) for name in SCALES)))
        sizes = [np.nan_to_num(contributions(one, quantity)[0]) for quantity in SCALES]
        leading.append((head, *(", ".join(f"{names[k]} {s[k]:.2g}" for k in np.argsort(-s)[:3]) for s in sizes)))
        distance, growth = 1e3 * one["leaning_distance"].values, one["leaning_growth"].values
        leans.append((head, *(f"{d:+.4f}" for d in distance[1:] - distance[0]), *(f"{g:.1e}" for g in growth[1:])))
    units = [f"{quantity} ({unit})" for quantity, (_, unit) in SCALES.items()]
    tilted = [f"{words}, {tilt:g}°" for words in ("distance (mm)", "growth (1/s)") for tilt in TILTS]
    return [
        *text_table(("derivative", "lowest (Hz)", "highest (Hz)", *(f"{q} (mm)" for q in QUANTITIES[2:])), slopes),
        *text_table((f"within tolerance: median, {BANDS}", *units), bands),
        *text_table(("leading tolerances, one standard deviation", *units), leading),
        *text_table(("change with the axis tilted from the vertical", *tilted), leans),
    ]


ONE = "by one standard deviation"
DISTANCE, FREQUENCY = f"change of the distance (mm)\n{ONE}", f"change of the lowest frequency\n(Hz) {ONE}"
ENDS = ["lowest", "highest"]
SENSITIVITY = Study(
    name="sensitivity",
    summary="which parameter matters: derivatives of distance and limits, and bands of realistic tolerances",
    points=sensitivity_points,
    compute=sensitivity,
    figures={
        "sensitivity-distance": partial(contributions_figure, quantity=MIDDLE, words=DISTANCE),
        "sensitivity-frequency": partial(contributions_figure, quantity="lowest", words=FREQUENCY),
        "sensitivity-distance-band": partial(bands_figure, quantities=[MIDDLE], words="distance in mid-range (mm)"),
        "sensitivity-frequency-band": partial(bands_figure, quantities=ENDS, words="stable frequencies (Hz)"),
    },
    report=sensitivity_lines,
)


# The search for the displacement or tilt that holds the floater at a wanted distance and frequency.
@dataclass(frozen=True, eq=False)
class Design:
    """A rotor that holds the floater where it is wanted."""

    measure: float  # displacement, mm, or tilt, °
    here: BranchPoint  # the equilibrium
    low: BranchPoint  # where its stability ends below and above the wanted frequency; `here` where it is not stable
    high: BranchPoint

    @property
    def margin(self) -> float:
        """Smallest relative change of the frequency that ends stable levitation; zero where it is not stable."""
        frequency = self.here.parameter
        return min(frequency - self.low.parameter, self.high.parameter - frequency) / frequency


def _first_guess(configuration: str, edge: float, distance: float, frequency: float) -> tuple[float, float, float]:
    """Displacement (mm) or tilt (°), side orbit's radius (m) and polar angle (rad) by the article's formulas.

    Balance of the axial force of point dipoles to first order in the polar angle, solved for the measure; gravity kept.
    """
    rate, moments = 2 * np.pi * frequency, FLOATER.moment * REMANENCE * edge**3 / MU_0
    strength = MU_0 * moments / (4 * np.pi)
    force = 3 * strength / distance**4
    angle = strength / (distance**3 * FLOATER.inertia * rate**2)
    radius = force / (FLOATER.mass * rate**2)
    pull = angle + 9.81 * FLOATER.mass / force
    if configuration == "horizontal":
        return 1e3 * (radius + distance * pull / 4), radius, angle
    if configuration == "tilt":
        return float(np.degrees((pull + 4 * radius / distance) / 2)), radius, angle
    ratio = max(2 / (pull + 4 * radius / distance), 1.0)
    return 1e3 * distance * (ratio**0.25 - 1), radius, angle


def designed(configuration: str, edge: float, distance: float, frequency: float) -> Design:
    """The measure that gives a distance (m) at a frequency (Hz) with cubes of an edge (m), by the closed form.

    Raises
    ------
    EquilibriumError : there is none, or the bodies would overlap
    """
    measure, radius, angle = _first_guess(configuration, edge, distance, frequency)
    place, moment = np.array([radius, 0.0, -distance]), np.array([np.sin(angle), 0.0, np.cos(angle)])
    known: list[tuple[float, float]] = []
    for _ in range(30):
        least = 1e3 * edge if configuration == "vertical" else 0.0
        if not least <= measure < (90 if configuration == "tilt" else 100) or measure == 0:
            raise EquilibriumError(f"The rotor would need a measure of {measure:.3g}.")
        scene = article_scene(configuration, measure, frequency, drag=False, edge=edge, permeability=1.0)
        rates = levitation_of(scene, "cuboid").rates
        place, moment, force = _lateral(scene, rates, place * distance / np.linalg.norm(place), moment)
        if known and abs(measure - known[-1][0]) < 1e-9 * measure:
            return _judged(scene, rates, measure, place, moment)
        after = 1.01 * measure
        if known:  # the secant's root
            before, missed = known[-1]
            step = -force * (measure - before) / (force - missed)
            after = measure + float(np.clip(step, -0.2 * measure, 0.2 * measure))
        known.append((measure, force))
        measure = after
    raise EquilibriumError("The search for the measure did not settle.")


def _lateral(scene: Scene, rates: Rates, place: Array, moment: Array) -> tuple[Array, Array, float]:
    """Place (3,) m at the same height and moment (3,) where all but the axial force is balanced, and that force.

    There is no fold at a given height, so that this always leads on.
    """
    balance = Balance(rates, parameters(scene, Scales.of(scene), frozen_spin=True), 0.0)
    places, moments, step = solve(balance, place[None] / scene.floater.radius, moment[None], LATERAL)
    if not step[0] < 1e-8:
        raise EquilibriumError("There is no lateral balance at the wanted distance.")
    return places[0] * scene.floater.radius, moments[0], float(balance(places, moments)[0][0, AXIAL])


def _judged(scene: Scene, rates: Rates, measure: float, place: Array, moment: Array) -> Design:
    family = by_frequency(scene, rates)
    here = family.point(place / scene.floater.radius, moment, scene.frequency)
    if rotor_gap(scene, here.position) < 0:
        raise EquilibriumError("The floater would overlap with the rotor.")
    if not levitates(here):
        return Design(measure, here, here, here)
    low, high = (stability_end(scene, family, here.state, scene.frequency, end) for end in (LOWEST, HIGHEST))
    return Design(measure, here, low, high)


EDGES = (6.0, 8.0, 10.0, 12.7, 16.0)  # Edges of the cubes that are tried, mm
RTOL = 1e-4
CLOSE_ENOUGH = 1e-6  # To which the true field shall meet the wanted distance, m


def design_points(quick: bool) -> list[Point]:
    """Wanted distances (mm) and frequencies (Hz) for each configuration."""
    wanted = [(20.0, 120.0)] if quick else [(d, f) for d in (20.0, 25.0, 30.0) for f in (80.0, 120.0)]
    edges = [10.0] if quick else list(EDGES)
    return [
        {"configuration": c, "distance_mm": d, "frequency": f, "edges_mm": edges}
        for d, f in wanted for c in CONFIGURATIONS
    ]  # fmt: skip


def _checked_by_elements(
    configuration: str, edge: float, distance: float, frequency: float, first: float, rtol: float, close: float
) -> Array:
    """Measure (mm or °) corrected for the true field, and what a forward search then gives.

    That is distance (m) and its error (m) of the equilibrium nearest to the wanted distance, 1 if it is stable, its
    growth (1/s). Raises EquilibriumError where there is none, or the corrections do not settle.
    """
    measure, step = first, 1e-5
    slope = step / (designed(configuration, edge, distance + step, frequency).measure - first)  # by the closed form
    for _ in range(5):
        scene = article_scene(configuration, measure, frequency, drag=False, edge=edge)
        found = levitation_of(scene, "fem", rtol).equilibria
        if not found:
            raise EquilibriumError("The true field has no equilibrium there.")
        best = min(found, key=lambda e: abs(e.distance - distance))
        if abs(best.distance - distance) < close:
            return np.array([measure, best.distance, best.position_error, float(best.stable), best.growth_per_s])
        measure -= (best.distance - distance) / slope
    raise EquilibriumError("The correction of the measure for the true field did not settle.")


NAMES: dict[str, Any] = {
    "measure": (("edge",), "mm or °", "displacement or tilt"),
    "margin": (("edge",), "1", "smallest relative change of frequency that ends stable levitation; 0 where unstable"),
    "lowest": (("edge",), "Hz", "lower end of stability"),
    "highest": (("edge",), "Hz", "upper end of stability"),
    "growth": (("edge",), "1/s", "largest growth rate"),
    "polar_angle": (("edge",), "°", "polar angle of the moment"),
}
CHECKED: dict[str, Any] = {
    "true_measure": ((), "mm or °", "measure corrected for the field of the finite magnets"),
    "true_distance": ((), "m", "distance that a forward search in that field gives"),
    "true_distance_error": ((), "m", "its estimated error"),
    "true_stable": ((), "1", "whether it is stable"),
    "true_growth": ((), "1/s", "largest growth rate in that field"),
    "wanted_distance": ((), "m", "wanted distance"),
    "wanted_frequency": ((), "Hz", "wanted frequency"),
    "best": ((), "1", "which edge has the largest margin; -1 if none"),
}


def design(point: Point, rtol: float = RTOL, close: float = CLOSE_ENOUGH) -> xr.Dataset:
    """Measures and margins for each edge, and a forward check of the best of them by finite elements."""
    name, distance, frequency = point["configuration"], 1e-3 * point["distance_mm"], point["frequency"]
    rows = np.full((len(point["edges_mm"]), len(NAMES)), np.nan)
    for k, edge in enumerate(point["edges_mm"]):
        with suppress(EquilibriumError):
            found = designed(name, 1e-3 * edge, distance, frequency)
            angle = float(np.degrees(polar_angle(found.here.state[6:9])))
            ends = found.low.parameter, found.high.parameter
            rows[k] = found.measure, found.margin, *ends, found.here.growth_per_s, angle
    margin = rows[:, list(NAMES).index("margin")]
    best = int(np.nanargmax(margin)) if np.isfinite(margin).any() else -1
    true = np.full(5, np.nan)
    if best >= 0 and margin[best] > 0:
        try:
            edge = 1e-3 * point["edges_mm"][best]
            true = _checked_by_elements(name, edge, distance, frequency, rows[best, 0], rtol, close)
        except EquilibriumError as error:
            note(str(error))
    edges = variable(("edge",), 1e-3 * np.array(point["edges_mm"]), "m", "edge of the cubes")
    return recorded(point, NAMES | CHECKED, (*rows.T, *true, distance, frequency, best), {"edge": edges})


def wishes(result: xr.Dataset) -> list[tuple[float, float, xr.Dataset]]:
    """The pairs of distance (m) and frequency (Hz) that were asked for, each with what the configurations answer."""
    pairs = zip(result["wanted_distance"].values, result["wanted_frequency"].values, strict=True)
    return [
        (d, f, cases_with(result, wanted_distance=d, wanted_frequency=f))
        for d, f in sorted({(float(d), float(f)) for d, f in pairs})
    ]


@styled
def design_figure(result: xr.Dataset) -> Figure:
    """Stability margin against the cubes' edge for every configuration and wish."""
    asked = wishes(result)
    titles = [f"{1e3 * distance:g} mm at {frequency:g} Hz" for distance, frequency, _ in asked]
    across = len({frequency for _, frequency, _ in asked})
    words = "edge of the cubes (mm)", "margin in frequency"
    figure, axes = small_multiples(titles, 2.3, across, *words, sharex=True)
    for panel, (_, _, answers) in zip(axes, asked, strict=True):
        for configuration, color in zip(CONFIGURATIONS, PALETTE, strict=False):
            one = case_with(answers, configuration=configuration)
            panel.plot(1e3 * one["edge"], one["margin"], "o", ms=4, color=color, label=TITLES[configuration])
        panel.yaxis.set_major_formatter(PercentFormatter(1.0))
        panel.margins(y=0.15)
        panel.set_ylim(-0.02, None)
    legend_below(figure)
    return figure


def design_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for distance, frequency, answers in wishes(result):
        for one in each_case(answers):
            name, best = str(one["configuration"].values), int(one["best"])
            head = f"{1e3 * distance:g} mm at {frequency:g} Hz, {name}"
            if best < 0 or not float(one["margin"][best]) > 0:
                rows.append((head, "none is stable", *[""] * 6))
                continue
            at, kind = one.isel(edge=best), CONFIGURATIONS[name]
            found = [f"{kind.symbol} = {float(at[key]):.3f} {kind.unit}" for key in ("measure", "true_measure")]
            ends = f"{float(at['lowest']):.1f} to {float(at['highest']):.1f}"
            cells = [f"{1e3 * float(at['edge']):g} mm", found[0], f"{100 * float(at['margin']):.1f} %", ends]
            if np.isfinite(one["true_distance"]):
                met = uncertain(*(1e3 * float(one[key]) for key in ("true_distance", "true_distance_error")))
                state = "stable" if float(one["true_stable"]) else f"grows at {float(one['true_growth']):.2g} 1/s"
                cells += [found[1], met, state]
            rows.append((head, *cells, *["not met"] * (7 - len(cells))))
    return text_table(
        ("wanted, by", "edge", "closed form", "margin", "stable (Hz)", "finite magnets", "distance (mm)", ""), rows
    )


DESIGN = Study(
    name="design",
    summary="which displacement, tilt and magnet size give a wanted distance and frequency with the largest margin",
    points=design_points,
    compute=design,
    figures={"design": design_figure},
    report=design_lines,
)
