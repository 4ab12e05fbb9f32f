"""Figures and sentences of the study of sensitivities, from its dataset alone."""

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...geometry.basics import Array
from ..article import CONFIGURATIONS, TITLES, by_configuration, rotor_label, rotor_panels
from ..results import PAGE, PALETTE, panels, styled
from .tolerances import FRACTIONS, PARAMETERS, QUANTITIES, TILT_SPREAD, TILTS

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
