"""Regions of stable levitation in frequency and displacement, what bounds them, and what a plate makes of them.

Regions: the motion without losses, of a rigid floater in the dipole's field, and in that of finite elements of one that
rotor and floater magnetise.  Where flights last, every effect takes part: the currents in the floater, real air, and
those in the rotor's magnets or not.
"""

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.frequencies import HIGHEST, StableRange, at_frequency, levitating_ranges
from ...dynamics.continuation.slow_drift import Lasting, lasting_frequencies
from ...dynamics.equilibria.equilibrium import EquilibriumError, Survey
from ...geometry.common import Array
from ...geometry.scene.contents import Drag, Plate
from ...geometry.shapes import Box
from ..cli.console import note
from ..figures.style import COLORS, NAMES, PAGE, PALETTE, panels, styled
from ..levitation import Levitation
from ..result import variable
from ..study import Point, Study, by_case, cases_with, one_case
from .article import (
    CONFIGURATIONS,
    FLIGHT,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    TITLES,
    article_scene,
    axis_label,
    by_configuration,
    conducting,
    levitation_of,
    rotor_label,
)

MEASURES = {
    "horizontal": (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0),
    "vertical": (10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 18.0, 20.0),
    "tilt": (2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0),
}
"""Displacements (mm) and tilts (degrees): the article's tested ones and some between."""
RTOL, PLATE_RTOL = 1e-4, 1e-2
MOST = 4
"""Intervals of stability that are kept of one rotor."""
BEYOND = 1.15
"""How far above the last stable frequency the plate is tried."""


def points(quick: bool) -> list[Point]:
    """All rotors with both models; with the plate, and flights, the rotors that levitated in the article.

    `quick` leaves out the mutual magnetisation and the flights.
    """
    rotors = {"horizontal": (2.0,), "vertical": (14.0,), "tilt": (10.0,)} if quick else MEASURES
    return [
        {
            "configuration": c, "measure": m, "model": model, "with_plate": (2 if quick else 5) if known else 0,
            **({} if quick else {"flights": known, "interaction": "auto"}),
        }
        for c, measures in rotors.items() for m in measures for model in MODELS
        for known in [model == "fem" and m in CONFIGURATIONS[c].levitated]
    ]  # fmt: skip


def compute(point: Point, rtol: float = RTOL) -> xr.Dataset:
    """Intervals of stable frequencies of one rotor, and growth with a plate below at some frequencies."""
    scene = article_scene(point["configuration"], point["measure"], drag=False)
    levitation = levitation_of(scene, point["model"], rtol, point.get("interaction", "rigid"))
    try:
        found = levitating_ranges(scene, levitation.interaction, levitation.rates)
    except EquilibriumError as error:
        note(str(error))
        found = []
    rows, kinds = np.full((len(INTERVAL), MOST), np.nan), np.full((2, MOST), "", dtype="U12")
    for k, run in enumerate(found[:MOST]):
        ends = run.low, run.high
        rows[:, k] = [*(e.parameter for e in ends), *(e.distance for e in ends), run.high.leading_hz]
        kinds[:, k] = [e.kind for e in ends]
    plate = _with_plate(levitation, found[0] if found else None, point["with_plate"])
    data = {
        name: variable(("interval",), row, *words) for (name, words), row in zip(INTERVAL.items(), rows, strict=True)
    }
    data |= {name: variable(("tried",), row, *words) for (name, words), row in zip(PLATE.items(), plate.T, strict=True)}
    if "flights" in point:
        data |= _flights(levitation, found[0] if found and point["flights"] else None)
    data |= {name: xr.Variable(("interval",), row) for name, row in zip(("low_kind", "high_kind"), kinds, strict=True)}
    return one_case(point, xr.Dataset(data))


METAL = {"insulating": False, "conducting": True}
"""The rotor's magnets: whether they have eddy currents."""
LASTING = {
    "low": ("Hz", "lowest frequency at which flights last"),
    "high": ("Hz", "highest frequency up to which flights last"),
    "growth_per_s": ("1/s", "largest growth rate of a small motion in the flight there"),
}
INTERVAL = {
    "lowest": ("Hz", "lower end of an interval of stability"),
    "highest": ("Hz", "upper end of an interval of stability"),
    "distance_lowest": ("m", "distance at the lower end"),
    "distance_highest": ("m", "distance at the upper end"),
    "leading_highest": ("Hz", "frequency of the motion that becomes unstable at the upper end"),
}
PLATE = {
    "plate_frequency": ("Hz", "frequency at which a plate below is tried"),
    "plate_growth": ("1/s", "largest growth rate with a plate below"),
    "plate_distance": ("m", "distance with a plate below"),
    "plate_error": ("1", "estimated relative error of the plate's table"),
}


def _flights(alone: Levitation, stable: StableRange | None) -> dict[str, xr.Variable]:
    """Where flights last, without and with currents in the rotor's magnets."""
    found = [_lasting(alone, stable, metal) if stable else Lasting() for metal in METAL]
    data = {
        name: variable(("metal",), np.array([getattr(one, name) for one in found]), *words)
        for name, words in LASTING.items()
    }
    data["ended_by"] = xr.Variable(("metal",), np.array([one.ended_by for one in found], "U12"))
    return {**data, "metal": xr.Variable(("metal",), list(METAL))}


def _lasting(alone: Levitation, stable: StableRange, metal: str) -> Lasting:
    """Where flights of `FLIGHT` last from spin 0, with all effects."""
    scene = conducting(alone.scene, METAL[metal])
    scene = replace(scene, drag=replace(Drag.stokes(scene.floater.radius), air=True))
    whole = Levitation(scene, alone.models)
    whole.share(alone)
    middle = stable.near((stable.low.parameter + stable.high.parameter) / 2)
    return lasting_frequencies(scene, whole.table, whole.rates, middle.state, middle.parameter, FLIGHT)


def _with_plate(alone: Levitation, stable: StableRange | None, number: int) -> Array:
    """Frequency (Hz), growth (1/s), distance (m) and error of the plate's table (number, 4); NaN where it fails."""
    rows = np.full((6, 4), np.nan)
    if stable is None or not number:
        return rows
    last = min(BEYOND * stable.high.parameter, HIGHEST)
    center = np.array([0.0, 0.0, FACE - PLATE_SIZE[2] / 2])
    plate = Plate(Box(np.array(PLATE_SIZE), center), PLATE_CONDUCTIVITY)
    for k, frequency in enumerate(np.linspace(1.01 * stable.low.parameter, last, number)):
        models = replace(alone.models, plate_model="slab", plate_rtol=PLATE_RTOL)
        there = alone.elsewhere(models, frequency=float(frequency), plate=plate)
        rows[k, 0] = frequency
        try:
            near = at_frequency(alone.scene, alone.rates, stable.near(frequency), float(frequency))
        except EquilibriumError:
            continue
        known = [e for e in there.without_plate.equilibria if abs(e.distance - near.distance) < 1e-6]
        if not known:
            continue
        there.adopt(Survey((known[0],), ()))
        memory, moved = there.plate, there.equilibria
        if memory is not None and moved and moved[0].currents is not None:
            rows[k, 1:] = moved[0].growth_per_s, moved[0].distance, max(memory.table.errors.total, memory.share.error)
    return rows


MODELS = ("dipole", "fem")
FACE = -0.045
"""Height of the plate's upper face below the rotor's origin, m: no floater that levitates touches it."""
MARKERS = {"fold": "^", "oscillatory": "o", "real": "D", "contact": "v", "border": "_"}
MARKS = {"insulating": ("<", "flights of 250 s last up to here"), "conducting": ("*", "… with currents in the rotor")}
"""Marks of where averaged flights last, without and with eddy currents in the rotor's magnets."""
MEANINGS = {
    "fold": "fold: no equilibrium beyond",
    "oscillatory": "growing oscillation (Hopf)",
    "real": "growing without oscillation",
    "contact": "contact with the rotor",
    "border": "end of the search",
}


@styled
def map_figure(result: xr.Dataset) -> Figure:
    """Regions of stable levitation by dipole and by finite elements, kinds of boundary, and the plate's verdict."""
    figure, axes = panels(1, 3, (PAGE, 3.9), sharey=True)
    for place, (configuration, rotors) in zip(axes[0], by_configuration(result), strict=False):
        for model in MODELS:
            _region(place, cases_with(rotors, model=model), model)
        _plate(place, cases_with(rotors, model=MODELS[-1]))
        _lasting_figure(place, cases_with(rotors, model=MODELS[-1]))
        place.set(
            xlabel=axis_label(configuration), title=TITLES[configuration], ylim=(20, 410),
        )  # fmt: skip
    handles = [
        *(axes[0, 0].plot([], [], "s", color=COLORS[m], alpha=0.5, label=f"stable: {NAMES[m]}")[0] for m in MODELS),
        *(axes[0, 0].plot([], [], k, color="0.3", mfc="white", label=MEANINGS[n])[0] for n, k in MARKERS.items()),
        axes[0, 0].plot([], [], "P", color=PALETTE[4], label=f"stable with a plate {-1e3 * FACE:g} mm below")[0],
        axes[0, 0].plot([], [], "x", color=PALETTE[3], label="unstable with it")[0],
        axes[0, 0].plot([], [], "1", color="0.2", label="no equilibrium is left with it")[0],
    ]
    if "high" in result:
        handles += [axes[0, 0].plot([], [], mark, color="k", label=words)[0] for mark, words in MARKS.values()]
    for place in axes[0]:
        place.margins(x=0.08)
    axes[0, 0].set_ylabel("frequency of the rotor (Hz)")
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


FIGURES = {"stability-map": map_figure}


def _region(axes: Axes, part: xr.Dataset, model: str) -> None:
    measure = part["measure"].values
    low, high = part["lowest"].values, part["highest"].values
    wide = measure if len(measure) > 1 else measure * np.array([0.99, 1.01])  # one rotor alone is a bar
    for k in range(part.sizes["interval"]):
        bottom, top = (np.broadcast_to(values[:, k], wide.shape) for values in (low, high))
        axes.fill_between(wide, bottom, top, color=COLORS[model], alpha=0.2, lw=0)
        for ends, kinds in ((low, part["low_kind"].values), (high, part["high_kind"].values)):
            axes.plot(measure, ends[:, k], color=COLORS[model], lw=0.8)
            for kind, marker in MARKERS.items():
                here = kinds[:, k] == kind
                axes.plot(measure[here], ends[here, k], marker, color=COLORS[model], mfc="white", ms=4)


def _plate(axes: Axes, part: xr.Dataset) -> None:
    growth, frequency = part["plate_growth"].values, part["plate_frequency"].values
    measure = np.broadcast_to(part["measure"].values[:, None], growth.shape)
    gone = np.isnan(growth) & np.isfinite(frequency)
    for here, style, color in ((growth < 0, "P", PALETTE[4]), (growth >= 0, "x", PALETTE[3]), (gone, "1", "0.2")):
        axes.plot(measure[here], frequency[here], style, color=color, ms=4, mew=0.8)


def _lasting_figure(axes: Axes, part: xr.Dataset) -> None:
    for metal, (mark, _) in MARKS.items() if "high" in part else ():
        axes.plot(part["measure"], part["high"].sel(metal=metal), mark, color="k", ms=5)


def map_lines(result: xr.Dataset) -> list[str]:
    """Every rotor's intervals by both models, where the plate below keeps or undoes stability, where flights last."""
    lines = []
    for configuration, rotors in by_configuration(result):
        for measure in np.unique(rotors["measure"].values):
            rows = cases_with(rotors, measure=measure)
            found = {str(m): rows.isel(case=k) for k, m in enumerate(rows["model"].values)}
            words = [f"{model} {_intervals(one)}" for model, one in found.items()]
            verdicts = "".join(_verdicts(one) for one in found.values())
            flights = "".join(_flights_figure(one) for one in found.values())
            lines.append(f"{rotor_label(configuration, measure)}: {'; '.join(words)}{verdicts}{flights}")
    return lines


def _intervals(one: xr.Dataset) -> str:
    rows = zip(
        one["lowest"].values, one["low_kind"].values, one["highest"].values, one["high_kind"].values, strict=True
    )
    words = [f"{low:.1f} ({a}) to {high:.1f} Hz ({b})" for low, a, high, b in rows if np.isfinite(low)]
    return " and ".join(words) or "never stable"


def _verdicts(one: xr.Dataset) -> str:
    pairs = zip(one["plate_frequency"].values, one["plate_growth"].values, strict=True)
    words = [f"{f:.0f} Hz {f'{g:+.2g}' if np.isfinite(g) else 'no equilibrium'}" for f, g in pairs if np.isfinite(f)]
    return f"; growth with the plate (1/s): {', '.join(words)}" if words else ""


def _flights_figure(one: xr.Dataset) -> str:
    if "high" not in one:
        return ""
    words = [
        f"{low:.1f} to {high:.1f} Hz ({metal} rotor; then {end})"
        for metal, low, high, end in zip(
            one["metal"].values, one["low"], one["high"], one["ended_by"].values, strict=True
        )
        if end
    ]
    return f"; flights of 250 s last from {' and '.join(words)}" if words else ""


STUDY = Study(
    name="stability-map",
    summary="regions of stable levitation in frequency and displacement, their boundaries, with and without a plate",
    points=points,
    compute=compute,
    gather=by_case,
    figures=FIGURES,
    report=map_lines,
)
