"""The inverse question: which rotor holds the floater at a wanted distance and frequency, with the most to spare?"""

import numpy as np
import xarray as xr

from ...dynamics.steady import EquilibriumError
from ...geometry.basics import Array
from ..article import CONFIGURATIONS, article_scene, levitation_of
from ..results import Point, Study, by_case, one_case, variable
from ..terminal import note
from .design_figure import FIGURES, design_lines
from .design_search import designed

EDGES = (6.0, 8.0, 10.0, 12.7, 16.0)
"""Edges of the cubes that are tried, mm."""
RTOL = 1e-4
CLOSE_ENOUGH = 1e-6
"""To which the true field shall meet the wanted distance, m."""


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


NAMES = {
    "measure": ("mm or °", "displacement or tilt"),
    "margin": ("1", "smallest relative change of frequency that ends stable levitation; 0 where unstable"),
    "lowest": ("Hz", "lower end of stability"),
    "highest": ("Hz", "upper end of stability"),
    "growth": ("1/s", "largest growth rate"),
    "polar_angle": ("°", "polar angle of the moment"),
}
CHECKED = {
    "true_measure": ("mm or °", "measure corrected for the true field"),
    "true_distance": ("m", "distance that a forward search in the true field gives"),
    "true_distance_error": ("m", "its estimated error"),
    "true_stable": ("1", "whether it is stable"),
    "true_growth": ("1/s", "largest growth rate in the true field"),
}


def compute(point: Point, rtol: float = RTOL, close: float = CLOSE_ENOUGH) -> xr.Dataset:
    """Measures and margins for each edge, and a forward check of the best of them by finite elements."""
    name, distance, frequency = point["configuration"], 1e-3 * point["distance_mm"], point["frequency"]
    rows = np.array([_row(name, 1e-3 * edge, distance, frequency) for edge in point["edges_mm"]])
    margin = rows[:, list(NAMES).index("margin")]
    best = int(np.nanargmax(margin)) if np.isfinite(margin).any() else -1
    true = np.full(len(CHECKED), np.nan)
    if best >= 0 and margin[best] > 0:
        try:
            edge = 1e-3 * point["edges_mm"][best]
            true = checked_by_elements(name, edge, distance, frequency, rows[best, 0], rtol, close)
        except EquilibriumError as error:
            note(str(error))
    data = {k: variable(("edge",), column, *words) for (k, words), column in zip(NAMES.items(), rows.T, strict=True)}
    data |= {k: variable((), value, *words) for (k, words), value in zip(CHECKED.items(), true, strict=True)}
    data["wanted_distance"] = variable((), distance, "m", "wanted distance")
    data["wanted_frequency"] = variable((), frequency, "Hz", "wanted frequency")
    data["best"] = variable((), best, "1", "which edge has the largest margin; -1 if none")
    edge = variable(("edge",), 1e-3 * np.array(point["edges_mm"]), "m", "edge of the cubes")
    return one_case(point, xr.Dataset(data, {"edge": edge}))


def _row(configuration: str, edge: float, distance: float, frequency: float) -> list[float]:
    try:
        found = designed(configuration, edge, distance, frequency)
    except EquilibriumError:
        return [np.nan] * len(NAMES)
    moment = found.here.state[6:9]
    angle = float(np.degrees(np.arctan2(np.hypot(moment[0], moment[1]), moment[2])))
    ends = found.low.parameter, found.high.parameter
    return [found.measure, found.margin, *ends, found.here.growth_per_s, angle]


STUDY = Study(
    name="design",
    summary="which displacement, tilt and magnet size give a wanted distance and frequency with the largest margin",
    points=points,
    compute=compute,
    gather=by_case,
    figures=FIGURES,
    report=design_lines,
)
