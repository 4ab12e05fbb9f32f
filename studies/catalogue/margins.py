"""How exactly a rotor must be made, and which rotor leaves the largest margin."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
from scipy.special import ndtri

from ...dynamics.continuation.frequencies import BORDER, LONG_STEPS, StableRange, at_frequency, levitating_ranges
from ...dynamics.equilibria.equilibrium import MARGINAL, Equilibrium, EquilibriumError
from ...dynamics.equilibria.orbits import ForcedMotion
from ...geometry.common import Array, ComputationError
from ...geometry.scene.contents import Scene
from ...geometry.scene.files import changed, scene as written_scene
from ...geometry.scene.making import sphere
from ..candidates import Search, survey_near
from ..cli.console import note
from ..cli.options import FieldModel
from ..design import ALWAYS, GOALS, optimised
from ..figures.style import PALETTE, drawn, panels, plain_log
from ..gradient import Gradient, equilibrium_at
from ..result import Columns, variable
from ..study import Point, Study, cases_with, each_case, recorded
from . import article, showing

# Which parameter matters: derivatives by each, and what realistic tolerances of all make of a rotor.
FRACTIONS = (0.1, 0.5, 0.9)  # Places in the range of stable frequencies at which the distance is asked for


class Known(NamedTuple):
    """A number of the scene file, and how well it is known as a parameter in SI units (measure: mm or °)."""

    words: str
    key: str
    spread: float  # half the width of an even distribution, or the standard deviation of a normal one
    unit: float = 1.0  # of the key by the parameter's
    normal: bool = False


PARAMETERS = {
    "measure": Known("displacement or tilt", "rotor.displacement_mm", 0.1, normal=True),
    "rotor_remanence": Known("rotor's remanence", "rotor.remanence_T", 0.015),
    "floater_remanence": Known("floater's remanence", "floater.remanence_T", 0.015),
    "density": Known("density", "floater.density_kg_m3", 100.0),
    "edge": Known("edge of the cube", "rotor.edge_mm", 0.1e-3, 1e3),
    "diameter": Known("diameter of the sphere", "floater.diameter_mm", 0.05e-3, 1e3),
    "gravity": Known("gravity", "gravity_m_s2.2", 0.0, -1.0),
    "frequency": Known("frequency", "frequency_hz", 0.5, normal=True),
}  # Remanence: the article's 1.29 to 1.32 T. Size: what makers of magnets give. Place of the cube: 0.1 mm, tilt 0.5°
TILT = {"measure": PARAMETERS["measure"]._replace(key="rotor.angle_deg", spread=0.5)}
NORMAL = np.array([known.normal for known in PARAMETERS.values()])
TILTS = (0.0, 1.0, 2.0)  # Of the axis from the vertical, degrees
ENDS = ("lowest", "highest")
QUANTITIES = (*ENDS, *(f"distance at {f:.0%}" for f in FRACTIONS))
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


def parameters_of(configuration: str) -> list[Known]:
    return list((PARAMETERS | (TILT if configuration == "tilt" else {})).values())


def scene_of(configuration: str, measure: float, frequency: float = 100.0) -> Scene:
    """The scene of a rotor of a `configuration` and `measure`, of μr = 1, in vacuum at a `frequency` in Hz."""
    rotor: dict[str, Any] = {"edge_mm": 10.0, "remanence_T": article.REMANENCE, "recoil_permeability": 1.0}
    rotor |= {"configuration": configuration, parameters_of(configuration)[0].key.removeprefix("rotor."): measure}
    ball = sphere(diameter_mm=12.7, remanence_T=article.REMANENCE, density_kg_m3=7500.0)
    still = {"linear_N_s_m": 0.0, "angular_N_m_s": 0.0}
    return written_scene(frequency_hz=frequency, rotor=rotor, floater=ball, drag=still)


@dataclass(frozen=True, eq=False)
class Slopes:
    """A rotor's quantities, their derivatives by all parameters, and what they are with parameters that are off."""

    configuration: str
    stable: StableRange
    grid: Array  # frequencies at which the distance is asked for, Hz
    derivatives: Array  # (parameter, quantity)
    errors: Array  # (parameter, quantity) estimates
    ways: tuple[Any, ...]  # `Gradient.ways` at each of the frequencies

    @classmethod
    def of(cls, configuration: str, measure: float, model: FieldModel = "cuboid") -> Self:
        """Of the rotor as it should be, its field by `model`. Raises EquilibriumError where it does not levitate."""
        levitation = article.levitation_of(scene := scene_of(configuration, measure), model)
        if not (ranges := levitating_ranges(scene, levitation.table, levitation.rates)):
            raise EquilibriumError("The rotor levitates stably at no frequency.")
        stable, grid = ranges[0], article.within(ranges[0], FRACTIONS)
        varied, ways = parameters_of(configuration), []
        found = np.zeros((2, len(varied), len(QUANTITIES)))
        for k, end in enumerate((stable.low, stable.high)):
            gradient = Gradient(levitation.elsewhere(frequency=end.parameter))
            for number, one in enumerate(varied):
                found[:, number, k] = 0.0 if end.kind == BORDER else one.unit * np.array(gradient.end_by(end, one.key))
        for k, frequency in enumerate(grid.tolist(), 2):
            there = levitation.elsewhere(frequency=frequency)
            point = at_frequency(there.scene, there.rates, stable.near(frequency), frequency, LONG_STEPS)
            known, gradient = equilibrium_at(there, point), Gradient(there)
            ways.append((known, *gradient.ways(known, [one.key for one in varied])))
            for number, one in enumerate(varied):
                value, error = gradient.with_errors(known, ways[-1][1][one.key], ["distance"], one.key)
                found[:, number, k] = one.unit * np.array([value[0], error[0]])
        return cls(configuration, stable, grid, found[0], np.abs(found[1]), tuple(ways))

    def off(self, draw: Array) -> Array:
        """Quantities with parameters off by a `draw`: ends to first order, distances of whole equilibria."""
        ends = [self.stable.low.parameter, self.stable.high.parameter] + draw @ self.derivatives[:, :2]
        row, varied = np.append(ends, [np.nan] * 3), parameters_of(self.configuration)
        offsets = {one.key: one.unit * float(by) for one, by in zip(varied, draw, strict=True)}
        for k, (frequency, (_, tangents, implicit, nearby)) in enumerate(zip(self.grid, self.ways, strict=True), 2):
            if row[0] < frequency + offsets["frequency_hz"] < row[1]:
                scene = changed(nearby.scene, {key: nearby.numbers[key] + by for key, by in offsets.items()})
                steps = [(by, tangents[key]) for key, by in offsets.items()]
                moved = implicit.moved(nearby.at(scene, offsets), steps, False)
                row[k] = np.nan if moved is None else moved.distance
        return row

    def leaning(self) -> Array:
        """Distance (m) and largest growth (1/s) in the middle of the range with the axis tilted (2, tilt)."""
        _, tangents, implicit, nearby = self.ways[1]
        found, key = [], PARAMETERS["gravity"].key
        for tilt in np.radians(TILTS):
            down = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
            scene = replace(nearby.scene, gravity=down)
            less = float(down[2] - nearby.scene.gravity[2])
            setting = nearby.at(scene, {key: less})
            fixed = implicit.moved(setting, [(less, tangents[key])])
            motion = ForcedMotion(scene, setting.rates, setting.values, None)
            forced = None if fixed is None else motion.equilibrium(fixed)
            numbers = (forced.distance, forced.growth_per_s) if isinstance(forced, Equilibrium) else (np.nan, np.nan)
            found.append(numbers)
        return np.array(found).T


def sensitivity(point: Point) -> xr.Dataset:
    slopes, samples = Slopes.of(point["configuration"], point["measure"], point["field"]), point["samples"]
    # a Latin hypercube: each parameter's draws are spread evenly (McKay, Beckman, Conover, Technometrics 21 (1979) 239)
    generator = np.random.default_rng(SEED)
    ranks = generator.permuted(np.tile(np.arange(samples)[:, None], len(PARAMETERS)), axis=0)
    levels = (ranks + generator.random(ranks.shape)) / samples
    spreads = [known.spread for known in parameters_of(slopes.configuration)]
    draws = spreads * np.where(NORMAL, ndtri(levels), 2 * levels - 1)
    sample = [slopes.off(draw) for draw in draws]
    lean = variable(("lean",), np.array(TILTS), "°", "tilt of the axis from the vertical")
    axes = {"parameter": list(PARAMETERS), "quantity": list(QUANTITIES), "fraction": list(FRACTIONS), "lean": lean}
    distances = [known.distance for known, *_ in slopes.ways]
    row = [slopes.stable.low.parameter, slopes.stable.high.parameter, *distances]
    found = (row, slopes.derivatives, slopes.errors, sample, draws, slopes.grid, *slopes.leaning())
    return recorded(point, COLUMNS, found, axes)


MIDDLE = QUANTITIES[3]
SCALES = {"lowest": (1.0, "Hz"), "highest": (1.0, "Hz"), MIDDLE: (1e3, "mm")}  # Of the report, with scale and unit
PERCENTILES = (5, 95)
BANDS = f"{PERCENTILES[0]} to {PERCENTILES[1]} % of the rotors"


def contributions(one: xr.Dataset, quantity: str) -> Array:
    """What one standard deviation of each parameter does to a quantity of one rotor, and its error (2, parameter)."""
    spreads = np.array([known.spread for known in parameters_of(one["configuration"].item())])
    deviation = SCALES[quantity][0] * spreads / np.where(NORMAL, 1.0, np.sqrt(3))
    both = one[["derivative", "derivative_error"]].sel(quantity=quantity)
    return np.abs([both[name].values * deviation for name in both])


def band(part: xr.Dataset, quantity: str) -> Array:
    """Median and the two percentiles (3, ...) of what the tolerances give, Hz or mm."""
    values = part["sample"].sel(quantity=quantity).values
    return np.asarray(SCALES[quantity][0] * np.nanpercentile(values, [50, *PERCENTILES], axis=-1))


@drawn
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


@drawn
def _bands_figure(result: xr.Dataset, quantities: Sequence[str], words: str) -> Figure:
    """Quantities of the rotors within all tolerances together."""
    figure, rows = showing.configuration_panels(result, 2.6, ylabel=words)
    for axes, part in rows:
        for name, color in zip(quantities, PALETTE, strict=False):
            middle, low, high = band(part, name)
            places, bars = showing.rotor_places(axes, part), [middle - low, high - middle]
            axes.errorbar(places, middle, bars, fmt="s", ms=4, capsize=3, color=color, label=name)
    showing.explain(rows[0][0], {f"median, and {BANDS}": "s"}, ms=4)
    return figure


def _sensitivity_lines(result: xr.Dataset) -> list[str]:
    names = [known.words for known in PARAMETERS.values()]
    slopes, bands, leading, leans = [], [], [], []
    for head, one in showing.rotor_cases(result):
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
    points=lambda quick: [
        {**rotor, "field": "cuboid", "samples": 4 if quick else 32} for rotor in article.levitated_rotors(quick)
    ],
    compute=sensitivity,
    figures={
        "sensitivity-distance": partial(_contributions_figure, quantity=MIDDLE, words=f"change (mm){ONE}"),
        "sensitivity-frequency": partial(_contributions_figure, quantity="lowest", words=f"change (Hz){ONE}"),
        "sensitivity-distance-band": partial(_bands_figure, quantities=[MIDDLE], words="distance in mid-range (mm)"),
        "sensitivity-frequency-band": partial(_bands_figure, quantities=ENDS, words="stable frequencies (Hz)"),
    },
    report=_sensitivity_lines,
)


# Which rotor leaves the largest margin at a wanted distance and frequency.
EDGES = (6.0, 16.0)  # Edges of the cubes, mm
RTOL = 1e-4
# Displacement (mm) or tilt (°) and frequency (Hz) of cubes of 10 mm that levitate, and bounds of the first
BEGUN = {"horizontal": (2.0, 110.0, (0.2, 6.0)), "vertical": (14.0, 75.0, (6.0, 30.0)), "tilt": (10.0, 119.0, (2, 40))}
NAMES: Columns = {
    "edge": ((), "m", "edge of the cubes"),
    "measure": ((), "mm or °", "displacement or tilt"),
    "margin": ((), "1", "smallest relative change of frequency that ends stable levitation"),
    "lowest": ((), "Hz", "lower end of stability"),
    "highest": ((), "Hz", "upper end of stability"),
    "polar_angle": ((), "°", "polar angle of the moment"),
    "true_measure": ((), "mm or °", "measure corrected for the field of the finite magnets"),
    "true_distance": ((), "m", "distance in that field"),
    "true_distance_error": ((), "m", "its estimated error"),
    "true_growth": ((), "1/s", "largest growth rate in that field"),
    "wanted_distance": ((), "m", "wanted distance"),
    "wanted_frequency": ((), "Hz", "wanted frequency"),
}


def design(point: Point, rtol: float = RTOL) -> xr.Dataset:
    """The cubes with the largest margin by the closed form, and their measure in the field of the finite magnets."""
    name, frequency = point["configuration"], point["frequency"]
    measure, begun, bounds = BEGUN[name]
    key, scene = parameters_of(name)[0].key, scene_of(name, measure, begun)
    free = {key: bounds, "rotor.edge_mm": EDGES, "frequency_hz": (min(begun, frequency), max(begun, frequency))}
    search, elements, parts = Search(article.levitation_of(scene, "cuboid"), free), None, []
    for distance in point["distances_mm"]:  # each from where the last one ended
        row, there = np.full(len(NAMES) - 2, np.nan), {"distance_mm": (distance, distance)}
        try:
            wish = ALWAYS | there | {"frequency_hz": (frequency, frequency)}
            best, numbers = optimised(search, GOALS["largest margin"], wish)
            ends = [end.parameter for end in best.ends]
            row[:6] = 1e-3 * numbers[1], numbers[0], best.values("margin").min(), *ends, best.known.polar_angle_deg
            permeable = changed(best.levitation.scene, {"rotor.recoil_permeability": article.PERMEABILITY})
            written = article.levitation_of(permeable, "fem", rtol)
            if elements is not None:
                written.share(elements.near.levitation, changed=True)
            near = best.bare
            if survey := survey_near(written, near.position[None], near.state.moment[None]):
                written.adopt(survey)
            elements = Search(written, {key: bounds})
            true, (found,) = optimised(elements, GOALS["lowest frequency"], there)  # it is kept: a root for the measure
            row[6:] = found, true.known.distance, true.known.position_error, true.known.growth_per_s
        except ComputationError as error:
            note(str(error))
        parts.append(recorded(point, NAMES, (*row, 1e-3 * distance, frequency), {}))
    return xr.concat(parts, "case")


@drawn
def margin_figure(result: xr.Dataset) -> Figure:
    """Largest margin, and the edge that has it, against the wanted distance for every configuration and frequency."""
    figure, (row,) = panels(1, 2, 2.6)
    for configuration, color in zip(article.CONFIGURATIONS, PALETTE, strict=False):
        for frequency, style in zip(np.unique(result["wanted_frequency"]), ("o-", "s--"), strict=False):
            one = cases_with(result, configuration=configuration, wanted_frequency=frequency).sortby("wanted_distance")
            label = f"{showing.TITLES[configuration]}, {frequency:g} Hz"
            for panel, shown in zip(row, (one["margin"], 1e3 * one["edge"]), strict=True):
                panel.plot(1e3 * one["wanted_distance"], shown, style, ms=4, color=color, label=label)
    for panel, words in zip(row, ("margin in frequency", "edge of the cubes (mm)"), strict=True):
        panel.set(xlabel="wanted distance (mm)", ylabel=words)
    row[0].yaxis.set_major_formatter(PercentFormatter(1.0))
    row[0].set_ylim(0, None)
    return figure


def _design_lines(result: xr.Dataset) -> list[str]:
    rows, wishes = [], ("wanted_distance", "wanted_frequency")
    for one in sorted(each_case(result), key=lambda one: [float(one[wish]) for wish in wishes]):
        name, at = one["configuration"].item(), {key: float(one[key]) for key in NAMES}
        kind = article.CONFIGURATIONS[name]
        head = f"{1e3 * at['wanted_distance']:g} mm at {at['wanted_frequency']:g} Hz, {name}"
        if not at["margin"] > 0:
            rows.append((head, "none is stable", *[""] * 6))
            continue
        found = [f"{kind.symbol} = {at[key]:.3f} {kind.unit}" for key in ("measure", "true_measure")]
        ends = f"{at['lowest']:.1f} to {at['highest']:.1f}"
        cells = [f"{1e3 * at['edge']:.2f} mm", found[0], f"{100 * at['margin']:.1f} %", ends]
        if np.isfinite(at["true_distance"]):
            met, growth = (at["true_distance"], at["true_distance_error"]), at["true_growth"]
            ending = "stable" if growth <= MARGINAL else f"grows at {growth:.2g} 1/s"
            cells += [found[1], showing.uncertain(*(1e3 * number for number in met)), ending]
        rows.append((head, *cells, *["not met"] * (7 - len(cells))))
    heads = ("wanted, by", "edge", "closed form", "margin", "stable (Hz)", "finite magnets", "distance (mm)", "")
    return showing.text_table(heads, rows)


DESIGN = Study(
    name="design",
    summary="which displacement, tilt and magnet size give a wanted distance and frequency with the largest margin",
    quick="all but one of six wishes",
    points=lambda quick: [
        {"configuration": name, "frequency": f, "distances_mm": [20.0] if quick else [20.0, 25.0, 30.0]}
        for f in ([120.0] if quick else [80.0, 120.0])
        for name in BEGUN
    ],
    compute=design,
    figures={"design": margin_figure},
    report=_design_lines,
)
