"""How exactly a rotor must be made, and which rotor leaves the largest margin."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
from scipy.special import ndtri

from ...dynamics.continuation.branch import BranchPoint
from ...dynamics.continuation.frequencies import (
    BORDER,
    HIGHEST,
    LONG_STEPS,
    LOWEST,
    StableRange,
    at_frequency,
    by_frequency,
    levitates,
    levitating_ranges,
    stability_end,
)
from ...dynamics.equilibria.balance import AXIAL, LATERAL, Balance, solve
from ...dynamics.equilibria.equilibrium import Equilibrium, EquilibriumError
from ...dynamics.equilibria.orbits import ForcedMotion
from ...dynamics.motion.equations import parameters
from ...dynamics.motion.events import rotor_gap
from ...dynamics.motion.state import Scales
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.scene.files import scene as written_scene
from ...geometry.scene.floater import Floater
from ...geometry.scene.making import sphere
from ..cli.console import note
from ..cli.options import FieldModel
from ..figures.style import PALETTE, plain_log
from ..gradient import Gradient, equilibrium_at
from ..result import Columns, variable
from ..study import Point, Study, case_with, cases_with, each_case, recorded
from . import article, showing

# Which parameter matters: derivatives by each, and what realistic tolerances of all make of a rotor.
FRACTIONS = (0.1, 0.5, 0.9)  # Places in the range of stable frequencies at which the distance is asked for


class Known(NamedTuple):
    """A parameter, SI units (measure: mm or °), and how well it is known."""

    words: str
    nominal: float
    spread: float  # half the width of an even distribution, or the standard deviation of a normal one
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
NORMAL = np.array([known.normal for known in PARAMETERS.values()])
TILT_SPREAD = 0.5
TILTS = (0.0, 1.0, 2.0)  # Of the axis from the vertical, degrees
QUANTITIES = ("lowest", "highest", *(f"distance at {f:.0%}" for f in FRACTIONS))
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


class Nominal(NamedTuple):
    """A rotor with all parameters as they should be."""

    configuration: str
    model: FieldModel  # of its field
    values: dict[str, float]  # of the parameters
    stable: StableRange
    grid: Array  # frequencies at which the distance is asked for, Hz


def spreads(configuration: str) -> Array:
    """How well each parameter is known (parameter,), as of `Known`."""
    found = np.array([known.spread for known in PARAMETERS.values()])
    return np.append(TILT_SPREAD, found[1:]) if configuration == "tilt" else found


def scene_of(configuration: str, values: Mapping[str, float], frequency: float = 100.0) -> Scene:
    """The scene of a rotor with all parameters given by name (SI; measure: mm or °), at a frequency in Hz."""
    floater = Floater(values["diameter"] / 2, values["floater_remanence"], 1.05, values["density"])
    scene = article.rotor_scene(
        configuration, values["measure"], frequency, drag=False,
        edge=values["edge"], remanence=values["rotor_remanence"], permeability=1.0, floater=floater,
    )  # fmt: skip
    return replace(scene, gravity=np.array([0.0, 0.0, -values["gravity"]]))


def nominal(configuration: str, measure: float, model: FieldModel = "cuboid") -> Nominal:
    """The rotor as it should be, its field by `model`. Raises EquilibriumError where it does not levitate."""
    values = {name: known.nominal for name, known in PARAMETERS.items()} | {"measure": measure}
    scene = scene_of(configuration, values)
    levitation = article.levitation_of(scene, model)
    found = levitating_ranges(scene, levitation.table, levitation.rates)
    if not found:
        raise EquilibriumError("The rotor levitates stably at no frequency.")
    stable = found[0]
    grid = article.within(stable, FRACTIONS)
    return Nominal(configuration, model, values | {"frequency": float(grid[1])}, stable, grid)


def _keyed(base: Nominal) -> dict[str, tuple[str, float]]:
    """Key of the scene file of each parameter, and its unit by that of the parameter."""
    measure = "rotor.angle_deg" if base.configuration == "tilt" else "rotor.displacement_mm"
    return {
        "measure": (measure, 1.0),
        "rotor_remanence": ("rotor.remanence_T", 1.0),
        "floater_remanence": ("floater.remanence_T", 1.0),
        "density": ("floater.density_kg_m3", 1.0),
        "edge": ("rotor.edge_mm", 1e3),
        "diameter": ("floater.diameter_mm", 1e3),
        "gravity": ("gravity_m_s2.2", -1.0),
        "frequency": ("frequency_hz", 1.0),
    }


def _written(base: Nominal, frequency: float) -> Scene:
    """The scene of the rotor as it should be, of keys that derivatives are by."""
    cube = {"edge_mm": 1e3 * base.values["edge"], "remanence_T": base.values["rotor_remanence"]}
    measure = _keyed(base)["measure"][0].removeprefix("rotor.")
    rotor = {"configuration": base.configuration, measure: base.values["measure"], "recoil_permeability": 1.0, **cube}
    ball = sphere(
        diameter_mm=1e3 * base.values["diameter"],
        remanence_T=base.values["floater_remanence"],
        density_kg_m3=base.values["density"],
    )
    still = {"linear_N_s_m": 0.0, "angular_N_m_s": 0.0}
    down = [0.0, 0.0, -base.values["gravity"]]
    return written_scene(frequency_hz=frequency, rotor=rotor, floater=ball, gravity_m_s2=down, drag=still)


@dataclass(frozen=True, eq=False)
class Slopes:
    """A rotor's quantities, their derivatives by all parameters, and what they are with parameters that are off."""

    base: Nominal
    derivatives: Array  # (parameter, quantity)
    ways: tuple[Any, ...]  # `Gradient.ways` at each of the frequencies

    @classmethod
    def of(cls, base: Nominal) -> Self:
        levitation = article.levitation_of(_written(base, float(base.grid[1])), base.model)
        keys, found, ways = _keyed(base), np.zeros((len(PARAMETERS), len(QUANTITIES))), []
        for k, end in enumerate((base.stable.low, base.stable.high)):
            gradient = Gradient(levitation.elsewhere(frequency=end.parameter))
            for row, (key, unit) in zip(found, keys.values(), strict=True):
                row[k] = 0.0 if end.kind == BORDER else unit * gradient.end_by(end, key)
        for k, frequency in enumerate(base.grid, 2):
            there = levitation.elsewhere(frequency=float(frequency))
            middle = base.stable.near(frequency)
            known = equilibrium_at(there, at_frequency(there.scene, there.rates, middle, float(frequency), LONG_STEPS))
            ways.append((known, *Gradient(there).ways(known, [key for key, _ in keys.values()])))
            for row, (key, unit) in zip(found, keys.values(), strict=True):
                row[k] = unit * float(ways[-1][1][key].of(lambda equilibrium: equilibrium.distance))
        return cls(base, found, tuple(ways))

    def off(self, draw: Array) -> Array:
        """Quantities with parameters off by a `draw`: ends to first order, distances of whole equilibria."""
        base, keys = self.base, _keyed(self.base)
        row = np.append(
            [base.stable.low.parameter, base.stable.high.parameter] + draw @ self.derivatives[:, :2], [np.nan] * 3
        )
        values = {name: base.values[name] + by for name, by in zip(PARAMETERS, draw, strict=True)}
        offsets = {key: unit * float(by) for (key, unit), by in zip(keys.values(), draw, strict=True)}
        for k, (frequency, (_, tangents, implicit, nearby)) in enumerate(zip(base.grid, self.ways, strict=True), 2):
            if row[0] < frequency + offsets["frequency_hz"] < row[1]:
                scene = scene_of(base.configuration, values, float(frequency) + offsets["frequency_hz"])
                moved = implicit.moved(
                    nearby.at(scene, offsets), [(by, tangents[key]) for key, by in offsets.items()], False
                )
                row[k] = np.nan if moved is None else moved.distance
        return row

    def leaning(self) -> Array:
        """Distance (m) and largest growth (1/s) in the middle of the range with the axis tilted (2, tilt)."""
        _, tangents, implicit, nearby = self.ways[1]
        found = []
        for tilt in np.radians(TILTS):
            down = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
            scene = replace(nearby.scene, gravity=down)
            less = {"gravity_m_s2.2": float(down[2] - nearby.scene.gravity[2])}
            setting = nearby.at(scene, less)
            fixed = implicit.moved(setting, [(by, tangents[key]) for key, by in less.items()])
            motion = ForcedMotion(scene, setting.rates, setting.values, None)
            forced = None if fixed is None else motion.equilibrium(fixed)
            found.append(
                (forced.distance, forced.growth_per_s) if isinstance(forced, Equilibrium) else (np.nan, np.nan)
            )
        return np.array(found).T


DERIVATIVE_ERROR = 1e-6  # relative, to which derivatives agree with differences of whole branches


def sensitivity_points(quick: bool) -> list[Point]:
    """The rotors that levitated, and how many samples of the tolerances are drawn."""
    more = {"field": "cuboid", "samples": 4 if quick else 32}
    return [{**rotor, **more} for rotor in article.levitated_rotors(quick)]


def sensitivity(point: Point) -> xr.Dataset:
    """Derivatives, tolerance band and tilt of one rotor."""
    base, samples = nominal(point["configuration"], point["measure"], point["field"]), point["samples"]
    slopes = Slopes.of(base)
    # a Latin hypercube: each parameter's draws are spread evenly (McKay, Beckman, Conover, Technometrics 21 (1979) 239)
    generator = np.random.default_rng(SEED)
    ranks = generator.permuted(np.tile(np.arange(samples)[:, None], len(PARAMETERS)), axis=0)
    levels = (ranks + generator.random(ranks.shape)) / samples
    draws = spreads(base.configuration) * np.where(NORMAL, ndtri(levels), 2 * levels - 1)
    sample = [slopes.off(draw) for draw in draws]
    lean = variable(("lean",), np.array(TILTS), "°", "tilt of the axis from the vertical")
    axes = {"parameter": list(PARAMETERS), "quantity": list(QUANTITIES), "fraction": list(FRACTIONS), "lean": lean}
    distances = [known.distance for known, *_ in slopes.ways]
    row = np.array([base.stable.low.parameter, base.stable.high.parameter, *distances])
    error = DERIVATIVE_ERROR * np.abs(slopes.derivatives)
    found = (row, slopes.derivatives, error, sample, draws, base.grid, *slopes.leaning())
    return recorded(point, COLUMNS, found, axes)


MIDDLE = QUANTITIES[3]
SCALES = {"lowest": (1.0, "Hz"), "highest": (1.0, "Hz"), MIDDLE: (1e3, "mm")}
"""Quantities of the report, with scale and unit."""
PERCENTILES = (5, 95)
BANDS = f"{PERCENTILES[0]} to {PERCENTILES[1]} % of the rotors"


def contributions(one: xr.Dataset, quantity: str) -> Array:
    """What one standard deviation of each parameter does to a quantity of one rotor, and its error (2, parameter)."""
    deviation = SCALES[quantity][0] * spreads(one["configuration"].item()) / np.where(NORMAL, 1.0, np.sqrt(3))
    both = one[["derivative", "derivative_error"]].sel(quantity=quantity)
    return np.abs([both[name].values * deviation for name in both])


def band(part: xr.Dataset, quantity: str) -> Array:
    """Median and the two percentiles (3, ...) of what the tolerances give, Hz or mm."""
    values = part["sample"].sel(quantity=quantity).values
    return np.asarray(SCALES[quantity][0] * np.nanpercentile(values, [50, *PERCENTILES], axis=-1))


@showing.drawn
def _contributions_figure(result: xr.Dataset, quantity: str, words: str) -> Figure:
    """What one standard deviation of each parameter does to distance or lowest frequency; with errors."""
    figure, rotors = showing.rotor_panels(result, 3.6, words, "", sharex=True)
    without = {"gravity", "frequency"} if quantity == "lowest" else {"gravity"}  # known, or of no influence
    chosen = [k for k, name in enumerate(PARAMETERS) if name not in without]
    for axes, rotor, color in rotors:
        value, error = contributions(rotor.isel(case=0), quantity)[:, chosen]
        axes.errorbar(value, range(len(chosen)), xerr=error, fmt="o", ms=4, color=color)
        plain_log(axes.xaxis)
    first = rotors[0][0]
    first.set_yticks(range(len(chosen)), [list(PARAMETERS.values())[k].words for k in chosen])
    first.invert_yaxis()
    return figure


@showing.drawn
def _bands_figure(result: xr.Dataset, quantities: Sequence[str], words: str) -> Figure:
    """Quantities of the rotors within all tolerances together."""
    figure, rows = showing.configuration_panels(result, 2.6, ylabel=words)
    for axes, configuration, part in rows:
        for name, color in zip(quantities, PALETTE, strict=False):
            middle, low, high = band(part, name)
            places, bars = showing.rotor_places(axes, configuration, part), [middle - low, high - middle]
            axes.errorbar(places, middle, bars, fmt="s", ms=4, capsize=3, color=color, label=name)
    showing.explain(rows[0][0], {f"median, and {BANDS}": "s"}, ms=4)
    return figure


def _sensitivity_lines(result: xr.Dataset) -> list[str]:
    rotors = [(head, rotor.isel(case=0)) for head, rotor in showing.by_rotor(result)]
    names = [known.words for known in PARAMETERS.values()]
    slopes, bands, leading, leans = [], [], [], []
    for head, one in rotors:
        slope, doubt = (one[name].sel(parameter="measure").values for name in ("derivative", "derivative_error"))
        slopes.append((head, *map(showing.uncertain, slope[:2], doubt[:2]), *(1e3 * slope[2:])))
        bands.append((head, *("{:.2f} ({:.2f} to {:.2f})".format(*band(one, name)) for name in SCALES)))
        sizes = [np.nan_to_num(contributions(one, quantity)[0]) for quantity in SCALES]
        leading.append((head, *(", ".join(f"{names[k]} {s[k]:.2g}" for k in np.argsort(-s)[:3]) for s in sizes)))
        moved = 1e3 * (one["leaning_distance"] - one["leaning_distance"][0]).values[1:]
        leans.append((head, *(f"{d:+.4f}" for d in moved), *(f"{g:.1e}" for g in one["leaning_growth"].values[1:])))
    units = [f"{quantity} ({unit})" for quantity, (_, unit) in SCALES.items()]
    tilted = [f"{words}, {tilt:g}°" for words in ("distance (mm)", "growth (s⁻¹)") for tilt in TILTS[1:]]
    per = "derivative, by mm or °", "lowest (Hz)", "highest (Hz)", *(f"{q} (mm)" for q in QUANTITIES[2:])
    return [
        *showing.text_table(per, slopes),
        *showing.text_table((f"within tolerance: median, {BANDS}", *units), bands),
        *showing.text_table(("leading tolerances, one standard deviation", *units), leading),
        *showing.text_table(("change with the axis tilted from the vertical", *tilted), leans),
    ]


ONE = "\nby one standard deviation"
SENSITIVITY = Study(
    name="sensitivity",
    summary="which parameter matters: derivatives of distance and limits, and bands of realistic tolerances",
    quick="nine of twelve rotors, 28 of 32 draws within tolerances",
    points=sensitivity_points,
    compute=sensitivity,
    figures={
        "sensitivity-distance": partial(_contributions_figure, quantity=MIDDLE, words=f"change (mm){ONE}"),
        "sensitivity-frequency": partial(_contributions_figure, quantity="lowest", words=f"change (Hz){ONE}"),
        "sensitivity-distance-band": partial(_bands_figure, quantities=[MIDDLE], words="distance in mid-range (mm)"),
        "sensitivity-frequency-band": partial(
            _bands_figure, quantities=["lowest", "highest"], words="stable frequencies (Hz)"
        ),
    },
    report=_sensitivity_lines,
)


# The search for the displacement or tilt that levitates the floater at a wanted distance and frequency.
@dataclass(frozen=True, eq=False)
class Design:
    """A rotor that levitates the floater where it is wanted."""

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
    rate, strength = 2 * np.pi * frequency, article.FLOATER.moment * article.REMANENCE * edge**3 / (4 * np.pi)
    force = 3 * strength / distance**4
    angle = strength / (distance**3 * article.FLOATER.inertia * rate**2)
    radius = force / (article.FLOATER.mass * rate**2)
    pull = angle + 9.81 * article.FLOATER.mass / force
    ratio = max(2 / (pull + 4 * radius / distance), 1.0)
    measure = {
        "horizontal": 1e3 * (radius + distance * pull / 4),
        "tilt": float(np.degrees((pull + 4 * radius / distance) / 2)),
        "vertical": 1e3 * distance * (ratio**0.25 - 1),
    }
    return measure[configuration], radius, angle


def designed(configuration: str, edge: float, distance: float, frequency: float) -> Design:
    """The measure that gives a distance (m) at a frequency (Hz) with cubes of an edge (m), by the closed form.

    All but the axial force is balanced at the wanted distance, where there is no fold; a secant finds the measure at
    which that force vanishes too.

    Raises
    ------
    EquilibriumError : there is none, or the bodies would overlap
    """
    measure, radius, angle = _first_guess(configuration, edge, distance, frequency)
    place, moment, length = np.array([[radius, 0.0, -distance]]), np.array([[np.sin(angle), 0.0, np.cos(angle)]]), 0.0
    least, most = (1e3 * edge if configuration == "vertical" else 0.0), (90 if configuration == "tilt" else 100)
    known: list[tuple[float, float]] = []
    for _ in range(30):
        if not least <= measure < most or measure == 0:
            raise EquilibriumError(f"The rotor would need a measure of {measure:.3g}.")
        scene = article.rotor_scene(configuration, measure, frequency, drag=False, edge=edge, permeability=1.0)
        rates, length = article.levitation_of(scene, "cuboid").rates, scene.floater.radius
        balance = Balance(rates, parameters(scene, Scales.of(scene), frozen_spin=True), 0.0)
        start = place * distance / np.linalg.norm(place) / length
        place, moment, step = solve(balance, start, moment, LATERAL)
        place *= length
        if not step[0] < 1e-8:
            raise EquilibriumError("There is no lateral balance at the wanted distance.")
        if known and abs(measure - known[-1][0]) < 1e-9 * measure:
            break
        force, after = float(balance(place / length, moment)[0][0, AXIAL]), 1.01 * measure
        if known:  # the secant's root
            before, missed = known[-1]
            change = -force * (measure - before) / (force - missed)
            after = measure + float(np.clip(change, -0.2 * measure, 0.2 * measure))
        known.append((measure, force))
        measure = after
    else:
        raise EquilibriumError("The search for the measure did not settle.")
    family = by_frequency(scene, rates)
    here = family.point(place[0] / length, moment[0], frequency)
    if rotor_gap(scene, here.position) < 0:
        raise EquilibriumError("The floater would overlap with the rotor.")
    if not levitates(here):
        return Design(measure, here, here, here)
    low, high = (stability_end(scene, family, here.state, frequency, end) for end in (LOWEST, HIGHEST))
    return Design(measure, here, low, high)


EDGES = [6.0, 8.0, 10.0, 12.7, 16.0]  # Edges of the cubes that are tried, mm
RTOL = 1e-4
CLOSE_ENOUGH = 1e-6  # To which the field of the finite magnets shall meet the wanted distance, m
NAMES: Columns = {
    "measure": (("edge",), "mm or °", "displacement or tilt"),
    "margin": (("edge",), "1", "smallest relative change of frequency that ends stable levitation; 0 where unstable"),
    "lowest": (("edge",), "Hz", "lower end of stability"),
    "highest": (("edge",), "Hz", "upper end of stability"),
    "growth": (("edge",), "1/s", "largest growth rate"),
    "polar_angle": (("edge",), "°", "polar angle of the moment"),
}
CHECKED: Columns = {
    "true_measure": ((), "mm or °", "measure corrected for the field of the finite magnets"),
    "true_distance": ((), "m", "distance that a forward search in that field gives"),
    "true_distance_error": ((), "m", "its estimated error"),
    "true_stable": ((), "1", "whether it is stable, or marginal"),
    "true_growth": ((), "1/s", "largest growth rate in that field"),
    "wanted_distance": ((), "m", "wanted distance"),
    "wanted_frequency": ((), "Hz", "wanted frequency"),
    "best": ((), "1", "which edge has the largest margin; -1 if none"),
}


def design_points(quick: bool) -> list[Point]:
    """Wanted distances (mm) and frequencies (Hz) for each configuration."""
    wanted = [(20.0, 120.0)] if quick else [(d, f) for d in (20.0, 25.0, 30.0) for f in (80.0, 120.0)]
    more = {"edges_mm": [10.0] if quick else EDGES}
    return [
        {"configuration": c, "distance_mm": d, "frequency": f, **more}
        for d, f in wanted
        for c in article.CONFIGURATIONS
    ]


def _checked_by_elements(
    configuration: str, edge: float, distance: float, frequency: float, first: float, rtol: float, close: float
) -> Array:
    """Measure (mm or °) corrected for the field of the finite magnets, and what a forward search then gives.

    That is distance (m) and its error (m) of the equilibrium nearest to the wanted distance, 1 if it is stable, its
    growth (1/s). Raises EquilibriumError where there is none, or the corrections do not settle.
    """
    measure, step = first, 1e-5
    slope = step / (designed(configuration, edge, distance + step, frequency).measure - first)  # by the closed form
    for _ in range(5):
        scene = article.rotor_scene(configuration, measure, frequency, drag=False, edge=edge)
        found = article.levitation_of(scene, "fem", rtol).equilibria
        if not found:
            raise EquilibriumError("The field of the finite magnets has no equilibrium there.")
        best = min(found, key=lambda e: abs(e.distance - distance))
        if abs(best.distance - distance) < close:
            return np.array(
                [measure, best.distance, best.position_error, float(best.stability != "unstable"), best.growth_per_s]
            )
        measure -= (best.distance - distance) / slope
    raise EquilibriumError("The correction of the measure for the field of the finite magnets did not converge.")


def design(point: Point, rtol: float = RTOL, close: float = CLOSE_ENOUGH) -> xr.Dataset:
    """Measures and margins for each edge, and a forward check of the best of them by finite elements."""
    name, distance, frequency = point["configuration"], 1e-3 * point["distance_mm"], point["frequency"]
    edges = 1e-3 * np.array(point["edges_mm"])
    rows, true, best = np.full((len(edges), len(NAMES)), np.nan), np.full(5, np.nan), -1
    for row, edge in zip(rows, edges, strict=True):
        with suppress(EquilibriumError):
            found = designed(name, edge, distance, frequency)
            angle = np.degrees(article.polar_angle(found.here.state[6:9]))
            ends = found.low.parameter, found.high.parameter
            row[:] = found.measure, found.margin, *ends, found.here.growth_per_s, angle
    measure, margin = rows.T[:2]
    if np.isfinite(margin).any():
        best = int(np.nanargmax(margin))
        if margin[best] > 0:
            try:
                true = _checked_by_elements(name, edges[best], distance, frequency, measure[best], rtol, close)
            except EquilibriumError as error:
                note(str(error))
    axes = {"edge": variable(("edge",), edges, "m", "edge of the cubes")}
    return recorded(point, {**NAMES, **CHECKED}, (*rows.T, *true, distance, frequency, best), axes)


def wishes(result: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    """The goals, and what the configurations reach."""
    pairs = zip(result["wanted_distance"].values, result["wanted_frequency"].values, strict=True)
    return [
        (f"{1e3 * d:g} mm at {f:g} Hz", cases_with(result, wanted_distance=d, wanted_frequency=f))
        for d, f in sorted(set(pairs))
    ]


@showing.drawn
def design_figure(result: xr.Dataset) -> Figure:
    """Stability margin against the cubes' edge for every configuration and wish."""
    across, words = len(np.unique(result["wanted_frequency"])), ("edge of the cubes (mm)", "margin in frequency")
    figure, rows = showing.small_multiples(dict(wishes(result)), 2.3, across, *words, sharex=True)
    for panel, answers in rows:
        for configuration, color in zip(article.CONFIGURATIONS, PALETTE, strict=False):
            one = case_with(answers, configuration=configuration)
            panel.plot(1e3 * one["edge"], one["margin"], "o", ms=4, color=color, label=showing.TITLES[configuration])
        panel.yaxis.set_major_formatter(PercentFormatter(1.0))
        panel.margins(y=0.15)
        panel.set_ylim(-0.02, None)
    return figure


def _design_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for wish, answers in wishes(result):
        for one in each_case(answers):
            name, best = one["configuration"].item(), int(one["best"])
            head = f"{wish}, {name}"
            if best < 0 or not float(one["margin"][best]) > 0:
                rows.append((head, "none is stable", *[""] * 6))
                continue
            at, kind = one.isel(edge=best), article.CONFIGURATIONS[name]
            found = [f"{kind.symbol} = {float(at[key]):.3f} {kind.unit}" for key in ("measure", "true_measure")]
            ends = f"{float(at['lowest']):.1f} to {float(at['highest']):.1f}"
            cells = [f"{1e3 * float(at['edge']):g} mm", found[0], f"{100 * float(at['margin']):.1f} %", ends]
            if np.isfinite(one["true_distance"]):
                met = showing.uncertain(1e3 * one["true_distance"], 1e3 * one["true_distance_error"])
                state = "stable" if float(one["true_stable"]) else f"grows at {float(one['true_growth']):.2g} 1/s"
                cells += [found[1], met, state]
            rows.append((head, *cells, *["not met"] * (7 - len(cells))))
    heads = ("wanted, by", "edge", "closed form", "margin", "stable (Hz)", "finite magnets", "distance (mm)", "")
    return showing.text_table(heads, rows)


DESIGN = Study(
    name="design",
    summary="which displacement, tilt and magnet size give a wanted distance and frequency with the largest margin",
    quick="all but one of six wishes and one of five edges",
    points=design_points,
    compute=design,
    figures={"design": design_figure},
    report=_design_lines,
)
