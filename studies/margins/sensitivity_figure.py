"""Figure and sentences of the study of sensitivities, from its dataset alone."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...geometry.basics import Array
from ..article import CONFIGURATIONS, axis_label, by_configuration, rotor_label
from ..results import PALETTE, panels, styled
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
def sensitivity_figure(result: xr.Dataset) -> Figure:
    """What the tolerance of each parameter does to distance and lowest frequency; bands of all tolerances together."""
    figure, axes = panels(3, 3, (10.0, 9.0))
    for column, (configuration, part) in enumerate(by_configuration(result)):
        axes[0, column].set_title(configuration)
        _contributions(axes[0, column], part, MIDDLE, 1e3, "distance in mid-range (mm)")
        _contributions(axes[1, column], part, "lowest", 1.0, "lowest frequency (Hz)")
        _bands(axes[2, column], part, configuration)
    figure.legend(handles=axes[2, 0].get_legend_handles_labels()[0], loc="outside lower center", ncols=3)
    for place in axes[:2, 1:].flat:
        place.set_yticklabels([])
    return figure


def _contributions(axes: Axes, part: xr.Dataset, quantity: str, scale: float, words: str) -> None:
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
    axes.invert_yaxis()
    axes.legend(fontsize=6)
    axes.set(xlabel=f"{words},\none standard deviation of the tolerance")


def _bands(axes: Axes, part: xr.Dataset, configuration: str) -> None:
    twin = axes.twinx()
    places: Array = np.arange(part.sizes["case"], dtype=float)
    for quantity, offset, color, on in (("lowest", -0.2, PALETTE[0], axes), ("highest", 0.0, PALETTE[1], axes)):
        _box(on, part, quantity, places + offset, color, 1.0, f"{quantity} frequency")
    _box(twin, part, MIDDLE, places + 0.2, PALETTE[2], 1e3, "distance")
    axes.plot([], [], "s", color=PALETTE[2], label="distance (right)")
    twin.grid(False)
    twin.set_ylabel("distance in mid-range (mm)", color=PALETTE[2])
    axes.set_xticks(places, [f"{m:g}" for m in part["measure"].values])
    axes.set(
        xlabel=axis_label(configuration),
        ylabel=f"frequency (Hz): {PERCENTILES[0]} to {PERCENTILES[1]} % of\nthe rotors within tolerance",
    )


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
