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
from ..figures.style import COLORS, NAMES, PALETTE, legend_below, styled
from ..levitation import Levitation
from ..result import Columns, columns
from ..study import Point, Study, cases_with, each_case, one_case
from .article import (
    CONFIGURATIONS,
    FLIGHT,
    MODELS,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    QUICK_ROTORS,
    article_scene,
    conducting,
    label_of,
    levitation_of,
    rotor_label,
)
from .drawing import by_configuration, configuration_panels, explain, text_table

MEASURES = {
    "horizontal": (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0),
    "vertical": (10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 18.0, 20.0),
    "tilt": (2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0),
}
"""Displacements (mm) and tilts (degrees): the article's tested ones and some between."""
RTOL, PLATE_RTOL = 1e-4, 1e-2
MOST = 4  # Intervals of stability that are kept of one rotor
BEYOND = 1.15  # How far above the last stable frequency the plate is tried


FACE = -0.045  # Height of the plate's upper face below the rotor's origin, m: no floater that levitates touches it
METAL = {"insulating": False, "conducting": True}  # The rotor's magnets: whether they have eddy currents
LASTING: Columns = {
    "low": (("metal",), "Hz", "lowest frequency at which flights last"),
    "high": (("metal",), "Hz", "highest frequency up to which flights last"),
    "growth_per_s": (("metal",), "1/s", "largest growth rate of a mode in the flight there"),
}
INTERVAL: Columns = {
    "lowest": (("interval",), "Hz", "lower end of an interval of stability"),
    "highest": (("interval",), "Hz", "upper end of an interval of stability"),
    "distance_lowest": (("interval",), "m", "distance at the lower end"),
    "distance_highest": (("interval",), "m", "distance at the upper end"),
    "leading_highest": (("interval",), "Hz", "frequency of the mode that becomes unstable at the upper end"),
}
PLATE: Columns = {
    "plate_frequency": (("tried",), "Hz", "frequency at which a plate below is tried"),
    "plate_growth": (("tried",), "1/s", "largest growth rate with a plate below"),
    "plate_distance": (("tried",), "m", "distance with a plate below"),
    "plate_error": (("tried",), "1", "estimated relative error of the plate's table"),
}


def points(quick: bool) -> list[Point]:
    """All rotors with both models; with the plate, and flights, the rotors that levitated in the article.

    `quick` leaves out the mutual magnetisation and the flights.
    """
    rotors = {name: (value,) for name, value in QUICK_ROTORS} if quick else MEASURES
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
    data = columns(INTERVAL, dict(zip(INTERVAL, rows, strict=True))) | columns(
        PLATE, dict(zip(PLATE, plate.T, strict=True))
    )
    if "flights" in point:
        data |= _flights(levitation, found[0] if found and point["flights"] else None)
    data |= {name: xr.Variable(("interval",), row) for name, row in zip(("low_kind", "high_kind"), kinds, strict=True)}
    return one_case(point, xr.Dataset(data))


def _flights(alone: Levitation, stable: StableRange | None) -> dict[str, xr.Variable]:
    """Where flights last, without and with currents in the rotor's magnets."""
    found = [_lasting(alone, stable, metal) if stable else Lasting() for metal in METAL]
    data = columns(LASTING, {name: np.array([getattr(one, name) for one in found]) for name in LASTING})
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


MARKERS = {
    "fold": ("^", "fold: no equilibrium beyond"),
    "oscillatory": ("o", "growing oscillation (Hopf)"),
    "real": ("D", "growing without oscillation"),
    "contact": ("v", "contact with the rotor"),
    "border": ("_", "end of the search"),
}
VERDICTS = (
    ("P", PALETTE[4], "plate: stable"),
    ("x", PALETTE[3], "plate: unstable"),
    ("1", "0.2", "plate: no equilibrium"),
)
MARKS = {
    "insulating": ("<", f"trajectories last {FLIGHT:g} s up to here"),
    "conducting": ("*", "… with currents in the rotor"),
}


@styled
def map_figure(result: xr.Dataset) -> Figure:
    """Regions of stable levitation by dipole and by finite elements, kinds of boundary, and the plate's verdict."""
    figure, rows = configuration_panels(result, 3.9, ylabel="frequency of the rotor (Hz)", sharey=True)
    for axes, configuration, rotors in rows:
        for model in MODELS:
            _region(axes, cases_with(rotors, model=model), COLORS[model])
        true = cases_with(rotors, model="fem")
        growth, frequency = true["plate_growth"].values, true["plate_frequency"].values
        measure = np.broadcast_to(true["measure"].values[:, None], growth.shape)
        found = (growth < 0, growth >= 0, np.isnan(growth) & np.isfinite(frequency))
        for here, (marker, color, _) in zip(found, VERDICTS, strict=True):
            axes.plot(measure[here], frequency[here], marker, color=color, ms=4, mew=0.8)
        for metal, (marker, _) in MARKS.items() if "high" in true else ():
            axes.plot(true["measure"], true["high"].sel(metal=metal), marker, color="k", ms=5)
        axes.set(xlabel=label_of(configuration), ylim=(20, 410))
        axes.margins(x=0.08)
    first = rows[0][0]
    for model in MODELS:
        explain(first, {f"stable: {NAMES[model]}": "s"}, color=COLORS[model], alpha=0.5)
    explain(first, {words: marker for marker, words in MARKERS.values()}, mfc="white")
    for marker, color, words in VERDICTS:
        explain(first, {f"{words}, face {-1e3 * FACE:g} mm below": marker}, color=color)
    if "high" in result:
        explain(first, {words: marker for marker, words in MARKS.values()}, color="k")
    legend_below(figure, first, columns=3)
    return figure


def _region(axes: Axes, part: xr.Dataset, color: str) -> None:
    measure = part["measure"].values
    wide = measure if len(measure) > 1 else measure * np.array([0.99, 1.01])  # one rotor alone is a bar
    for k in range(part.sizes["interval"]):
        ends = [part[name].values[:, k] for name in ("lowest", "highest")]
        low, high = (np.broadcast_to(end, wide.shape) for end in ends)
        axes.fill_between(wide, low, high, color=color, alpha=0.2, lw=0)
        for values, name in zip(ends, ("low_kind", "high_kind"), strict=True):
            axes.plot(measure, values, color=color, lw=0.8)
            for kind, (marker, _) in MARKERS.items():
                here = part[name].values[:, k] == kind
                axes.plot(measure[here], values[here], marker, color=color, mfc="white", ms=4)


def map_lines(result: xr.Dataset) -> list[str]:
    """Every rotor's intervals by both models, where the plate below keeps or undoes stability, where flights last."""
    rows = []
    for configuration, part in by_configuration(result):
        for one in each_case(part):
            name = f"{rotor_label(configuration, float(one['measure']))}, {one['model'].item()}"
            rows.append((name, _intervals(one), _verdicts(one), _lasts(one)))
    flights = f"trajectories last {FLIGHT:g} s"
    return text_table(("rotor, model", "stable", "growth with the plate (1/s)", flights), rows)


def _intervals(one: xr.Dataset) -> str:
    ends = zip(*(one[name].values for name in ("lowest", "low_kind", "highest", "high_kind")), strict=True)
    words = [f"{low:.1f} ({a}) to {high:.1f} Hz ({b})" for low, a, high, b in ends if np.isfinite(low)]
    return " and ".join(words) or "never"


def _verdicts(one: xr.Dataset) -> str:
    pairs = zip(one["plate_frequency"].values, one["plate_growth"].values, strict=True)
    tried = [f"{f:.0f} Hz {f'{g:+.2g}' if np.isfinite(g) else 'no equilibrium'}" for f, g in pairs if np.isfinite(f)]
    return ", ".join(tried)


def _lasts(one: xr.Dataset) -> str:
    if "high" not in one:
        return ""
    found = zip(*(one[name].values for name in ("metal", "low", "high", "ended_by")), strict=True)
    return " and ".join(
        f"{low:.1f} to {high:.1f} Hz ({metal} rotor; then {end})" for metal, low, high, end in found if end
    )


STUDY = Study(
    name="stability-map",
    summary="regions of stable levitation in frequency and displacement, their boundaries, with and without a plate",
    points=points,
    compute=compute,
    figures={"stability-map": map_figure},
    report=map_lines,
)
