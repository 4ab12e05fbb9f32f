"""Regions of stable levitation in frequency and displacement, what bounds them, and what a plate makes of them.

Regions: the motion without losses, of a rigid floater in the dipole's field, and in that of finite elements of one that
rotor and floater magnetise.  Where flights last, every effect takes part: the currents in the floater, real air, and
those in the rotor's magnets or not.
"""

from dataclasses import replace

import numpy as np
import xarray as xr

from ...dynamics.branches import HIGHEST, StableRange, at_frequency, levitating_ranges
from ...dynamics.slow_drift import Lasting, lasting_frequencies
from ...dynamics.steady import EquilibriumError, Survey
from ...geometry.basics import Array, Box
from ...geometry.scenes import Drag, Plate
from ..article import (
    CONFIGURATIONS,
    FLIGHT,
    PLATE_CONDUCTIVITY,
    PLATE_SIZE,
    article_scene,
    conducting,
    levitation_of,
)
from ..one_scene import Levitation
from ..results import Point, Study, by_case, one_case, variable
from ..terminal import note
from .stability_map_figure import FACE, FIGURES, MODELS, map_lines

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


STUDY = Study(
    name="stability-map",
    summary="regions of stable levitation in frequency and displacement, their boundaries, with and without a plate",
    points=points,
    compute=compute,
    gather=by_case,
    figures=FIGURES,
    report=map_lines,
)
