"""The search for the displacement or tilt that holds the floater at a wanted distance and frequency."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from ...dynamics.continuation.branch import BranchPoint
from ...dynamics.continuation.frequencies import HIGHEST, LOWEST, by_frequency, levitates, stability_end
from ...dynamics.equilibria.balance import AXIAL, LATERAL, Balance, solve
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...dynamics.motion.equations import parameters
from ...dynamics.motion.events import rotor_gap
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.state import Scales
from ...geometry.common import MU_0, Array
from ...geometry.scene.contents import Scene
from ..cli.console import note
from ..figures.style import PALETTE, legend_below, styled
from ..result import Columns, columns, variable
from ..study import Point, Study, cases_with, each_case, one_case
from .article import CONFIGURATIONS, FLOATER, REMANENCE, article_scene, levitation_of, polar_angle
from .drawing import TITLES, small_multiples, text_table, uncertain


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


def first_guess(configuration: str, edge: float, distance: float, frequency: float) -> tuple[float, float, float]:
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
    measure, radius, angle = first_guess(configuration, edge, distance, frequency)
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
        known.append((measure, force))
        measure = _secant(known)
    raise EquilibriumError("The search for the measure did not settle.")


def _secant(known: list[tuple[float, float]]) -> float:
    here, miss = known[-1]
    if len(known) == 1:
        return 1.01 * here
    before, missed = known[-2]
    step = -miss * (here - before) / (miss - missed)
    return here + float(np.clip(step, -0.2 * here, 0.2 * here))


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


def points(quick: bool) -> list[Point]:
    """Wanted distances (mm) and frequencies (Hz) for each configuration."""
    wanted = [(20.0, 120.0)] if quick else [(d, f) for d in (20.0, 25.0, 30.0) for f in (80.0, 120.0)]
    edges = [10.0] if quick else list(EDGES)
    return [
        {"configuration": c, "distance_mm": d, "frequency": f, "edges_mm": edges}
        for d, f in wanted for c in CONFIGURATIONS
    ]  # fmt: skip


def checked_by_elements(
    configuration: str,
    edge: float,
    distance: float,
    frequency: float,
    first: float,
    rtol: float = RTOL,
    close: float = CLOSE_ENOUGH,
) -> Array:
    """Measure corrected for the true field, and what a forward search then gives.

    Returns
    -------
    Measure (mm or °), distance (m) and its error (m) of the equilibrium nearest to the wanted distance, 1 if it is
    stable, its growth (1/s).

    Raises
    ------
    EquilibriumError : there is none, or the corrections do not settle
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
    "true_stable": ((), "1", "whether it is stable"),
    "true_growth": ((), "1/s", "largest growth rate in that field"),
    "wanted_distance": ((), "m", "wanted distance"),
    "wanted_frequency": ((), "Hz", "wanted frequency"),
    "best": ((), "1", "which edge has the largest margin; -1 if none"),
}


def compute(point: Point, rtol: float = RTOL, close: float = CLOSE_ENOUGH) -> xr.Dataset:
    """Measures and margins for each edge, and a forward check of the best of them by finite elements."""
    name, distance, frequency = point["configuration"], 1e-3 * point["distance_mm"], point["frequency"]
    rows = np.array([_row(name, 1e-3 * edge, distance, frequency) for edge in point["edges_mm"]])
    margin = rows[:, list(NAMES).index("margin")]
    best = int(np.nanargmax(margin)) if np.isfinite(margin).any() else -1
    true = np.full(5, np.nan)
    if best >= 0 and margin[best] > 0:
        try:
            edge = 1e-3 * point["edges_mm"][best]
            true = checked_by_elements(name, edge, distance, frequency, rows[best, 0], rtol, close)
        except EquilibriumError as error:
            note(str(error))
    data = columns(NAMES, dict(zip(NAMES, rows.T, strict=True)))
    data |= columns(CHECKED, dict(zip(CHECKED, (*true, distance, frequency, best), strict=True)))
    edges = variable(("edge",), 1e-3 * np.array(point["edges_mm"]), "m", "edge of the cubes")
    return one_case(point, xr.Dataset(data, {"edge": edges}))


def _row(configuration: str, edge: float, distance: float, frequency: float) -> list[float]:
    try:
        found = designed(configuration, edge, distance, frequency)
    except EquilibriumError:
        return [np.nan] * len(NAMES)
    angle = float(np.degrees(polar_angle(found.here.state[6:9])))
    ends = found.low.parameter, found.high.parameter
    return [found.measure, found.margin, *ends, found.here.growth_per_s, angle]


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
        for one in each_case(answers):
            configuration = str(one["configuration"].values)
            color = PALETTE[list(CONFIGURATIONS).index(configuration)]
            panel.plot(1e3 * one["edge"], one["margin"], "o-", ms=3, color=color, label=TITLES[configuration])
        panel.yaxis.set_major_formatter(PercentFormatter(1.0))
        panel.margins(y=0.15)
        panel.set_ylim(-0.02, None)
    legend_below(figure, *axes)
    return figure


def design_lines(result: xr.Dataset) -> list[str]:
    """The best rotor for each wish, checked by a forward search in the field of the finite magnets."""
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


STUDY = Study(
    name="design",
    summary="which displacement, tilt and magnet size give a wanted distance and frequency with the largest margin",
    points=points,
    compute=compute,
    figures={"design": design_figure},
    report=design_lines,
)
