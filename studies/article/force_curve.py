"""Force along the axis against distance, with its repelling and its attracting part: the article's second figure."""

import numpy as np
import scipy
import xarray as xr

from ...geometry.basics import Array
from ..one_scene import Levitation, sources
from ..results import Point, Study, by_case, one_case, variable
from .article import CONTACT, FLOATER, WEIGHT, article_scene, levitation_of
from .article_formulas import force
from .force_curve_figure import FIGURES, force_lines

CONFIGURATION, VALUE = "horizontal", 1.0
"""The rotor of the article's figure; its text does not give the frequency."""
FREQUENCIES = (165.0, 170.0, 185.0, 200.0)
MODELS = ("semi-analytic", "small angles", "dipole", "fem")


def force_points(quick: bool) -> list[Point]:
    """The rotor of the figure by both formulas and in both fields; `quick` has a coarser grid and one frequency."""
    frequencies, spacing = (FREQUENCIES[1:2], 5e-4) if quick else (FREQUENCIES, 1e-4)
    asked = {"configuration": CONFIGURATION, "value": VALUE, "frequencies_hz": list(frequencies), "spacing": spacing}
    return [{**asked, "model": model} for model in MODELS]


def force_curve(point: Point) -> xr.Dataset:
    """Axial force by one formula or in one field, where everything else is balanced.

    Returns
    -------
    Dataset over `frequency` and `distance` (m, along the axis): the parts of the magnetic force (N, upwards), the
    error by the field's own estimate, and the polar angle; over `frequency`: stable and tipping points, and θ there.
    """
    grid = np.arange(CONTACT, 0.0451, point["spacing"])
    frequencies = np.asarray(point["frequencies_hz"], float)
    if point["model"] in MODELS[:2]:
        rows = np.array([_formula(point, grid, frequency) for frequency in frequencies])
    else:
        scene = article_scene(CONFIGURATION, VALUE, frequencies[0])
        shared = levitation_of(scene, point["model"])
        rows = np.array([_full(shared.elsewhere(frequency=float(f)), grid) for f in frequencies])
    marks = np.array([balance_points(grid, row[0] + row[1], row[3]) for row in rows])
    frequency = variable(("frequency",), frequencies, "Hz", "frequency of the rotor")
    distance = variable(("distance",), grid, "m", "distance along the axis")
    both = {n: variable(("frequency", "distance"), rows[:, k], u, t) for k, (n, u, t) in enumerate(COLUMNS)}
    one = {n: variable(("frequency",), marks[:, k], u, t) for k, (n, u, t) in enumerate(MARKS)}
    return one_case(point, xr.Dataset({**both, **one}, {"frequency": frequency, "distance": distance}))


COLUMNS = (
    ("attracting", "N", "force by the on-axis field, upwards"),
    ("repelling", "N", "force by the rotating field, upwards"),
    ("force_error", "N", "error of the force by the field's own estimate"),
    ("polar_angle", "rad", "polar angle of the moment"),
)
MARKS = (
    ("equilibrium", "m", "stable point"),
    ("far_tipping", "m", "tipping point far from the rotor"),
    ("near_tipping", "m", "tipping point near the rotor: released there the floater just reaches the far one"),
    ("angle_near", "rad", "polar angle at the near tipping point"),
    ("angle_equilibrium", "rad", "polar angle at the stable point"),
)


def _formula(point: Point, grid: Array, frequency: float) -> list[Array]:
    found = force(CONFIGURATION, VALUE, grid, frequency, simple=point["model"] == "small angles")
    return [found.attracting, found.repelling, np.zeros_like(grid), found.polar_angle]


def _full(levitation: Levitation, grid: Array) -> list[Array]:
    """The columns on the curve that holds the stable equilibrium; NaN beyond its ends."""
    # along the axis the moment comes nearest to upright on the curve that holds the stable equilibrium
    table, curves = sources(levitation.table), levitation.without_plate.curves
    curve = max(curves, key=lambda curve: float(curve.moment[:, 2].max()))
    field_gradient = table.evaluate(curve.position)[1][:, :, 2]
    parts = FLOATER.moment * curve.moment * field_gradient
    error = FLOATER.moment * table.absolute_error(curve.position)[1]
    angle = np.arctan2(np.hypot(*curve.moment.T[:2]), curve.moment[:, 2])
    depth = -curve.position[:, 2]
    order = np.argsort(depth)
    columns = (parts[:, 2], parts[:, 0] + parts[:, 1], error, angle)
    return [scipy.interpolate.CubicSpline(depth[order], column[order], extrapolate=False)(grid) for column in columns]


def balance_points(distance: Array, magnetic: Array, angle: Array) -> tuple[float, float, float, float, float]:
    """Stable point, far and near tipping points (m), and θ at the near and at the stable one; NaN where there is none.

    At the near one the force has done as much work up to the far one as is needed to come to rest there.
    """
    known = np.isfinite(magnetic)
    rest = scipy.interpolate.PchipInterpolator(distance[known], magnetic[known] - WEIGHT)
    roots = rest.roots(extrapolate=False)
    roots = roots[np.isfinite(roots)]
    if len(roots) < 2:
        return (np.nan,) * 5
    stable, far = float(roots[-2]), float(roots[-1])
    work = rest.antiderivative()
    low, high = distance[known][0], stable
    near = float(scipy.optimize.brentq(lambda d: work(far) - work(d), low, high)) if work(far) < work(low) else np.nan
    theta = scipy.interpolate.PchipInterpolator(distance[known], angle[known])
    return stable, far, near, float(theta(near)), float(theta(stable))


STUDY = Study(
    name="force-curve",
    summary="force along the axis with its two parts, stable and tipping points; the"
    " article's formulas and full fields",
    points=force_points,
    compute=force_curve,
    gather=by_case,
    figures=FIGURES,
    report=force_lines,
)
