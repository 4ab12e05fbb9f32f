"""Which parameter matters: derivatives by each, and what realistic tolerances of all make of a rotor."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.special import ndtri

from ...dynamics.continuation.frequencies import (
    HIGHEST,
    LONG_STEPS,
    LOWEST,
    StableRange,
    at_frequency,
    by_frequency,
    reference_state,
    stability_end,
    stable_range,
)
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...geometry.common import Array
from ...geometry.scene.contents import Floater, Scene
from ..cli.options import FieldModel
from ..figures.style import PALETTE, legend_below, styled
from ..result import Columns, columns, variable
from ..study import Point, Study, case_with, each_case, one_case
from .article import CONFIGURATIONS, article_scene, levitated_rotors, levitation_of, rotor_label
from .drawing import (
    by_configuration,
    configuration_panels,
    explain,
    rotor_colors,
    rotor_places,
    text_table,
    uncertain,
)

MODEL: FieldModel = "cuboid"
FRACTIONS = (0.1, 0.5, 0.9)  # Places in the range of stable frequencies at which the distance is asked for


@dataclass(frozen=True)
class Known:
    """A parameter as it is known: its nominal value and realistic tolerance, both in `unit`.

    `spread` is half the width of an even distribution, or the standard deviation of a normal one.
    """

    nominal: float
    unit: str
    spread: float
    normal: bool = False


PARAMETERS = {
    "measure": Known(np.nan, "mm or °", 0.1, True),
    "rotor_remanence": Known(1.305, "T", 0.015),
    "floater_remanence": Known(1.305, "T", 0.015),
    "density": Known(7500.0, "kg/m³", 100.0),
    "edge": Known(10e-3, "m", 0.1e-3),
    "diameter": Known(12.7e-3, "m", 0.05e-3),
    "gravity": Known(9.81, "m/s²", 0.0),
    "frequency": Known(np.nan, "Hz", 0.5, True),
}
"""Remanence: the article's 1.29 to 1.32 T. Size: what makers of magnets give. Place of the cube: 0.1 mm, tilt 0.5°."""
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
    measure: float
    model: FieldModel  # of its field
    values: dict[str, float]  # of the parameters
    range: StableRange  # its stable frequencies

    @property
    def grid(self) -> Array:
        """Frequencies at which the distance is asked for, Hz."""
        low, high = self.range.low.parameter, self.range.high.parameter
        return low + (high - low) * np.array(FRACTIONS)


def scene_of(configuration: str, values: dict[str, float], frequency: float = 100.0) -> Scene:
    """The scene with all parameters given."""
    floater = Floater(values["diameter"] / 2, values["floater_remanence"], 1.05, values["density"])
    scene = article_scene(
        configuration, values["measure"], frequency, drag=False,
        edge=values["edge"], remanence=values["rotor_remanence"], permeability=1.0, floater=floater,
    )  # fmt: skip
    return replace(scene, gravity=np.array([0.0, 0.0, -values["gravity"]]))


def nominal(configuration: str, measure: float, model: FieldModel = MODEL) -> Nominal:
    """The rotor as it should be. Raises EquilibriumError where it does not levitate."""
    values = {name: known.nominal for name, known in PARAMETERS.items() if name != PLACE} | {"measure": measure}
    scene = scene_of(configuration, values)
    found = stable_range(scene, levitation_of(scene, model).rates, *reference_state(scene))
    return Nominal(configuration, measure, model, values, found)


def levitation(base: Nominal, values: dict[str, float], shift: float = 0.0) -> Array:
    """Lowest and highest frequency (Hz) and the distances (m) with other values of the parameters; NaN where none.

    Parameters
    ----------
    shift : of the frequencies at which the distance is asked for, Hz
    """
    scene = scene_of(base.configuration, values)
    rates = levitation_of(scene, base.model).rates
    middle = base.range.near(base.grid[1])
    family = by_frequency(scene, rates)
    row = np.full(len(QUANTITIES), np.nan)
    try:
        ends = [
            stability_end(scene, family, middle.state, middle.parameter, end, LONG_STEPS) for end in (LOWEST, HIGHEST)
        ]
    except EquilibriumError:
        return row
    row[:2] = [end.parameter for end in ends]
    for k, frequency in enumerate(base.grid + shift, 2):
        if row[0] < frequency < row[1]:
            row[k] = at_frequency(scene, rates, middle, float(frequency), LONG_STEPS).distance
    return row


def points(quick: bool) -> list[Point]:
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
        rows.append((slopes[0], np.abs(slopes[1] - slopes[0]) / 3 if len(slopes) > 1 else np.nan * slopes[0]))
    values, errors = np.array(rows).swapaxes(0, 1)
    return values, errors


def slope_by(base: Nominal, name: str, step: float) -> Array:
    """Derivatives (quantity,) by one parameter, as a central difference of `step` (SI; measure: mm or °)."""
    if name == PLACE:
        ends = [levitation(base, base.values, sign * step) for sign in (1, -1)]
    else:
        ends = [levitation(base, base.values | {name: base.values[name] + sign * step}) for sign in (1, -1)]
    return np.asarray((ends[0] - ends[1]) / (2 * step))


def drawn(base: Nominal, samples: int) -> tuple[Array, Array]:
    """What `samples` draws of the tolerances give (sample, quantity), and the draws (sample, parameter).

    A Latin hypercube: each parameter's draws are spread evenly (McKay, Beckman, Conover, Technometrics 21 (1979) 239).
    """
    generator = np.random.default_rng(SEED)
    ranks = generator.permuted(np.tile(np.arange(samples)[:, None], len(PARAMETERS)), axis=0)
    levels = (ranks + generator.random(ranks.shape)) / samples
    draws = np.zeros((samples, len(PARAMETERS)))
    for k, (name, known) in enumerate(PARAMETERS.items()):
        unit = ndtri(levels[:, k]) if known.normal else 2 * levels[:, k] - 1
        tilted = name == "measure" and base.configuration == "tilt"
        draws[:, k] = (TILT_SPREAD if tilted else known.spread) * unit
    rows = []
    for draw in draws:
        off = dict(zip(PARAMETERS, draw, strict=True))
        rows.append(levitation(base, {k: v + off[k] for k, v in base.values.items()}, off[PLACE]))
    return np.array(rows), draws


def leaning(base: Nominal) -> tuple[Array, Array]:
    """Distance (m) and largest growth (1/s) in the middle of the range, upright and with the axis tilted by `TILTS`."""
    scene = scene_of(base.configuration, base.values, float(base.grid[1]))
    levitation = levitation_of(scene, base.model)
    here = at_frequency(scene, levitation.rates, base.range.near(scene.frequency), scene.frequency)
    found = []
    for tilt in np.radians([0.0, *TILTS]):
        gravity = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
        near = [
            e for e in levitation.elsewhere(gravity=gravity).equilibria
            if abs(e.distance - here.distance) < 1e-3
        ]  # fmt: skip
        found.append((near[0].distance, near[0].growth_per_s) if near else (np.nan, np.nan))
    distance, growth = np.array(found).T
    return distance, growth


def compute(point: Point) -> xr.Dataset:
    """Derivatives, tolerance band and tilt of one rotor."""
    base = nominal(point["configuration"], point["measure"], point["field"])
    slopes, errors = derivatives(base, point["steps"])
    samples, draws = drawn(base, point["samples"])
    distance, growth = leaning(base)
    found = (levitation(base, base.values), slopes, errors, samples, draws, base.grid, distance, growth)
    data = columns(COLUMNS, dict(zip(COLUMNS, found, strict=True)))
    lean = variable(("lean",), np.array([0.0, *TILTS]), "°", "tilt of the axis from the vertical")
    axes = {"parameter": list(PARAMETERS), "quantity": list(QUANTITIES), "fraction": list(FRACTIONS), "lean": lean}
    return one_case(point, xr.Dataset(data, axes))


WORDS = {
    "measure": "displacement or tilt",
    "rotor_remanence": "rotor's remanence",
    "floater_remanence": "floater's remanence",
    "density": "density",
    "edge": "edge of the cube",
    "diameter": "diameter of the sphere",
    "gravity": "gravity",
    "frequency": "frequency",
}
MIDDLE = QUANTITIES[3]
SCALES = {"lowest": (1.0, "Hz"), "highest": (1.0, "Hz"), MIDDLE: (1e3, "mm")}
"""Quantities of the report, with scale and unit."""
PERCENTILES = (5, 95)
BANDS = f"{PERCENTILES[0]} to {PERCENTILES[1]} % of the rotors"


def spreads(one: xr.Dataset) -> xr.DataArray:
    """Standard deviation of each parameter by its tolerance (SI, mm or °), for one rotor."""
    found = {name: known.spread / (1 if known.normal else np.sqrt(3)) for name, known in PARAMETERS.items()}
    if str(one["configuration"].values) == "tilt":
        found["measure"] = TILT_SPREAD
    return xr.DataArray(list(found.values()), {"parameter": list(found)}, "parameter")


@styled
def contributions_figure(result: xr.Dataset, quantity: str, words: str) -> Figure:
    """What one standard deviation of each parameter does to distance or lowest frequency."""
    figure, rows = configuration_panels(result, 3.6, words, sharey=True)
    names = [name for name in PARAMETERS if name != "gravity"]
    places = np.arange(len(names))
    for axes, configuration, part in rows:
        width = 0.8 / part.sizes["case"]
        for k, (measure, color) in enumerate(rotor_colors(figure, axes, configuration, part["measure"]).items()):
            one = case_with(part, measure=measure).sel(quantity=quantity)
            value, error = (
                abs(SCALES[quantity][0] * one[name] * spreads(one)).sel(parameter=names)
                for name in ("derivative", "derivative_error")
            )
            axes.barh(places + (k + 0.5) * width - 0.4, value, width, xerr=error, color=color, error_kw={"lw": 0.7})
        axes.xaxis.set_major_locator(MaxNLocator(4))
    rows[0][0].set_yticks(places, [WORDS[name] for name in names])
    rows[0][0].invert_yaxis()
    return figure


@styled
def bands_figure(result: xr.Dataset, quantities: Sequence[str], words: str) -> Figure:
    """Quantities of the rotors within all tolerances together."""
    figure, rows = configuration_panels(result, 2.6, ylabel=words, sharey=True)
    for axes, configuration, part in rows:
        for name, color in zip(quantities, PALETTE, strict=False):
            middle, low, high = SCALES[name][0] * band(part, name)
            style: Any = {"fmt": "s", "ms": 4, "capsize": 3, "color": color, "label": name}
            axes.errorbar(rotor_places(axes, configuration, part), middle, [middle - low, high - middle], **style)
    explain(rows[0][0], {f"median, and {BANDS}": "s"}, ms=4)
    legend_below(figure, rows[0][0])
    return figure


FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "sensitivity-distance": partial(
        contributions_figure, quantity=MIDDLE, words="change of the distance (mm)\nby one standard deviation"
    ),
    "sensitivity-frequency": partial(
        contributions_figure, quantity="lowest", words="change of the lowest frequency\n(Hz) by one standard deviation"
    ),
    "sensitivity-distance-band": partial(bands_figure, quantities=[MIDDLE], words="distance in mid-range (mm)"),
    "sensitivity-frequency-band": partial(
        bands_figure, quantities=["lowest", "highest"], words="stable frequencies (Hz)"
    ),
}


def band(part: xr.Dataset, quantity: str) -> Array:
    """Median and the two percentiles (3, ...) of what the tolerances give."""
    values = part["sample"].sel(quantity=quantity).values
    return np.asarray(np.nanpercentile(values, [50, *PERCENTILES], axis=-1))


def sensitivity_lines(result: xr.Dataset) -> list[str]:
    """Derivatives by the measure, the bands, the leading tolerances and what a tilted axis does, for each rotor."""
    slopes, bands, leading, leans = [], [], [], []
    for configuration, part in by_configuration(result):
        for one in each_case(part):
            head = rotor_label(configuration, float(one["measure"]))
            slope, doubt = (one[name].sel(parameter="measure") for name in ("derivative", "derivative_error"))
            ends = [uncertain(slope.sel(quantity=q), doubt.sel(quantity=q)) for q in QUANTITIES[:2]]
            slopes.append((f"{head}, per {CONFIGURATIONS[configuration].unit}", *ends, *(1e3 * slope.values[2:])))
            ranges = [scale * band(one, name) for name, (scale, _) in SCALES.items()]
            bands.append((head, *(f"{middle:.2f} ({low:.2f} to {high:.2f})" for middle, low, high in ranges)))
            leading.append((head, *(_leading(one, quantity) for quantity in SCALES)))
            distance, growth = 1e3 * one["leaning_distance"].values, one["leaning_growth"].values
            leans.append((head, *(f"{d:+.4f}" for d in distance[1:] - distance[0]), *(f"{g:.1e}" for g in growth[1:])))
    names = [f"{quantity} ({unit})" for quantity, (_, unit) in SCALES.items()]
    leaning = [f"{words}, {tilt:g}°" for words in ("distance (mm)", "growth (1/s)") for tilt in TILTS]
    return [
        *text_table(("derivative", "lowest (Hz)", "highest (Hz)", *(f"{q} (mm)" for q in QUANTITIES[2:])), slopes),
        *text_table((f"within tolerance: median, {BANDS}", *names), bands),
        *text_table(("leading tolerances, one standard deviation", *names), leading),
        *text_table(("change with the axis tilted from the vertical", *leaning), leans),
    ]


def _leading(one: xr.Dataset, quantity: str) -> str:
    """The three parameters whose tolerances matter most."""
    parts = np.nan_to_num(np.abs(one["derivative"].sel(quantity=quantity) * spreads(one)) * SCALES[quantity][0])
    return ", ".join(f"{WORDS[list(PARAMETERS)[k]]} {parts[k]:.2g}" for k in np.argsort(-parts)[:3])


STUDY = Study(
    name="sensitivity",
    summary="which parameter matters: derivatives of distance and limits, and bands of realistic tolerances",
    points=points,
    compute=compute,
    figures=FIGURES,
    report=sensitivity_lines,
)
