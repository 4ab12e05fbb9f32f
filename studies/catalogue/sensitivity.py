"""What is not known exactly of a rotor and its floater, and what they do with other values of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
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
from ..figures.style import PAGE, PALETTE, panels, styled
from ..result import variable
from ..study import Point, Study, by_case, one_case
from .article import (
    CONFIGURATIONS,
    TITLES,
    article_scene,
    by_configuration,
    levitated_rotors,
    levitation_of,
    rotor_label,
    rotor_panels,
)

MODEL: FieldModel = "cuboid"
FRACTIONS = (0.1, 0.5, 0.9)
"""Places in the range of stable frequencies at which the distance is asked for."""


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
TILTS = (1.0, 2.0)
"""Of the axis from the vertical, degrees."""
QUANTITIES = ("lowest", "highest", *(f"distance at {f:.0%}" for f in FRACTIONS))
PLACE = "frequency"


@dataclass(frozen=True, eq=False)
class Nominal:
    """What one rotor does with all parameters as they should be.

    Parameters
    ----------
    configuration, measure : of the rotor
    model : of its field
    values : of the parameters
    range : its stable frequencies
    """

    configuration: str
    measure: float
    model: FieldModel
    values: dict[str, float]
    range: StableRange

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


STEP = 1e-3
"""Relative step of the central differences; twice that for their error."""
SEED = 20250706


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
    data = {
        "nominal": (("quantity",), levitation(base, base.values), "Hz or m", "as it should be"),
        "derivative": (("parameter", "quantity"), slopes, "of the quantity by SI, mm or °", "derivative"),
        "derivative_error": (("parameter", "quantity"), errors, "as the derivative", "estimated error"),
        "sample": (("draw", "quantity"), samples, "Hz or m", "with a draw of the tolerances"),
        "drawn": (("draw", "parameter"), draws, "SI, mm or °", "deviation of the parameter"),
        "frequency": (("fraction",), base.grid, "Hz", "frequency at which the distance is asked for"),
        "leaning_distance": (("lean",), distance, "m", "mean distance with the axis tilted from the vertical"),
        "leaning_growth": (("lean",), growth, "1/s", "largest growth rate with the axis tilted"),
    }
    lean = variable(("lean",), np.array([0.0, *TILTS]), "°", "tilt of the axis from the vertical")
    axes = {"parameter": list(PARAMETERS), "quantity": list(QUANTITIES), "fraction": list(FRACTIONS), "lean": lean}
    return one_case(point, xr.Dataset({name: variable(*column) for name, column in data.items()}, axes))


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
PERCENTILES = (5, 95)


def spreads(one: xr.Dataset) -> Array:
    """Standard deviation of each parameter by its tolerance (SI, mm or °), for one rotor."""
    known = list(PARAMETERS.values())
    result = np.array([k.spread if k.normal else k.spread / np.sqrt(3) for k in known])
    if str(one["configuration"].values) == "tilt":
        result[list(PARAMETERS).index("measure")] = TILT_SPREAD
    return np.asarray(result)


@styled
def contributions_figure(result: xr.Dataset, quantity: str, scale: float, words: str) -> Figure:
    """What one standard deviation of each parameter does to distance or lowest frequency."""
    figure, (axes,) = panels(1, 3, (PAGE, 3.4), sharey=True)
    for panel, (configuration, part) in zip(axes, by_configuration(result), strict=False):
        panel.set(title=TITLES[configuration], xlabel=words)
        _contributions(panel, part, quantity, scale)
    axes[0].invert_yaxis()
    return figure


@styled
def frequency_bands_figure(result: xr.Dataset) -> Figure:
    """Lowest and highest stable frequency of the rotors within all tolerances together."""
    figure, axes = rotor_panels(result, 2.5)
    for panel, (_, part) in zip(axes, by_configuration(result), strict=False):
        places = np.arange(part.sizes["case"], dtype=float)
        for name, color in (("lowest", PALETTE[0]), ("highest", PALETTE[1])):
            _box(panel, part, name, places, color, 1.0, f"{name} frequency")
    axes[0].set_ylabel(f"stable frequencies (Hz),\n{PERCENTILES[0]} to {PERCENTILES[1]} % of the rotors")
    axes[0].legend()
    return figure


@styled
def distance_bands_figure(result: xr.Dataset) -> Figure:
    """Distance in mid-range of the rotors within all tolerances together."""
    figure, axes = rotor_panels(result, 2.5)
    for panel, (_, part) in zip(axes, by_configuration(result), strict=False):
        _box(panel, part, MIDDLE, np.arange(part.sizes["case"], dtype=float), PALETTE[2], 1e3, "distance")
    axes[0].set_ylabel(f"distance in mid-range (mm),\n{PERCENTILES[0]} to {PERCENTILES[1]} % of the rotors")
    return figure


FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "sensitivity-distance": partial(
        contributions_figure, quantity=MIDDLE, scale=1e3, words="change of the distance (mm)"
    ),
    "sensitivity-frequency": partial(
        contributions_figure, quantity="lowest", scale=1.0, words="change of the lowest\nstable frequency (Hz)"
    ),
    "sensitivity-distance-band": distance_bands_figure,
    "sensitivity-frequency-band": frequency_bands_figure,
}


def _contributions(axes: Axes, part: xr.Dataset, quantity: str, scale: float) -> None:
    names = [name for name in PARAMETERS if name != "gravity"]
    places, count = np.arange(len(names)), part.sizes["case"]
    for k in range(count):
        one = part.isel(case=k)
        sizes = xr.DataArray(scale * spreads(one), dims="parameter", coords={"parameter": one["parameter"]})
        value, error = (
            np.abs((one[name].sel(quantity=quantity) * sizes).sel(parameter=names).values)
            for name in ("derivative", "derivative_error")
        )
        kind = str(one["configuration"].values)
        axes.barh(
            places + (k - (count - 1) / 2) * 0.8 / count, value, 0.8 / count, xerr=error, color=PALETTE[k],
            label=rotor_label(kind, float(one["measure"])), error_kw={"lw": 0.7},
        )  # fmt: skip
    axes.set_yticks(places, [WORDS[name] for name in names])
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.2), columnspacing=1.0)


def _box(axes: Axes, part: xr.Dataset, quantity: str, places: Array, color: str, scale: float, label: str) -> None:
    middle, low, high = scale * band(part, quantity)
    axes.errorbar(places, middle, [middle - low, high - middle], fmt="s", ms=4, capsize=3, color=color, label=label)


def band(part: xr.Dataset, quantity: str) -> Array:
    """Median and the two percentiles (3, case) of what the tolerances give."""
    values = part["sample"].sel(quantity=quantity).values
    return np.asarray(np.nanpercentile(values, [50, *PERCENTILES], axis=1))


def sensitivity_lines(result: xr.Dataset) -> list[str]:
    """Derivatives by the measure, what sub-millimetre precision buys, and the bands."""
    lines = []
    for configuration, part in by_configuration(result):
        for k in range(part.sizes["case"]):
            one = part.isel(case=k)
            unit, head = CONFIGURATIONS[configuration].unit, rotor_label(configuration, float(one["measure"]))
            lines += [f"{head}: {line}" for line in (_by_measure(one, unit), _all(one), _leading(one), _lean(one))]
    return lines


def _by_measure(one: xr.Dataset, unit: str) -> str:
    slope = one["derivative"].sel(parameter="measure")
    doubt = one["derivative_error"].sel(parameter="measure")
    words = [
        f"{name} {float(slope.sel(quantity=name)):+.3g}{_doubt(float(doubt.sel(quantity=name)))} Hz/{unit}"
        for name in ("lowest", "highest")
    ]
    along = [1e3 * float(slope.sel(quantity=name)) for name in QUANTITIES[2:]]
    words += [f"distance {a:+.2f} mm/{unit} at {f:.0%} of the range" for a, f in zip(along, FRACTIONS, strict=True)]
    steepest = np.nanmax(np.abs(along))
    return "; ".join(words) + f"; 1 mm of distance is {1 / steepest:.2g} {unit}"


def _doubt(error: float) -> str:
    return f" ± {error:.1g}" if np.isfinite(error) else ""


def _all(one: xr.Dataset) -> str:
    expanded = one.expand_dims("case")
    words = []
    for name, scale, unit in (("lowest", 1.0, "Hz"), ("highest", 1.0, "Hz"), (MIDDLE, 1e3, "mm")):
        middle, low, high = (scale * float(v[0]) for v in band(expanded, name))
        words.append(f"{name} {middle:.2f} {unit} ({low:.2f} to {high:.2f})")
    return "within tolerance " + "; ".join(words)


def _leading(one: xr.Dataset) -> str:
    words = []
    for quantity, scale, unit in ((MIDDLE, 1e3, "mm"), ("lowest", 1.0, "Hz"), ("highest", 1.0, "Hz")):
        parts = np.abs(one["derivative"].sel(quantity=quantity).values) * spreads(one) * scale
        order = np.argsort(-np.nan_to_num(parts))[:3]
        words.append(f"{quantity}: " + ", ".join(f"{WORDS[list(PARAMETERS)[k]]} {parts[k]:.2g} {unit}" for k in order))
    return "leading tolerances (one standard deviation), " + "; ".join(words)


def _lean(one: xr.Dataset) -> str:
    distance, growth = 1e3 * one["leaning_distance"].values, one["leaning_growth"].values
    return "axis tilted from the vertical: " + ", ".join(
        f"by {t:g}° {d - distance[0]:+.4f} mm, growth {g:.1e} /s"
        for t, d, g in zip(TILTS, distance[1:], growth[1:], strict=True)
    )


STUDY = Study(
    name="sensitivity",
    summary="which parameter matters: derivatives of distance and limits, and bands of realistic tolerances",
    points=points,
    compute=compute,
    gather=by_case,
    figures=FIGURES,
    report=sensitivity_lines,
)
