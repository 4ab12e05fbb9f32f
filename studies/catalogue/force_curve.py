"""Force along the axis against distance, with its repelling and its attracting part: the article's second figure."""

from typing import Any

import numpy as np
import scipy
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ...geometry.common import Array
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..levitation import Levitation
from ..result import Columns, columns, variable
from ..scene_tables import sources
from ..study import Point, Study, case_with, one_case
from .article import CONTACT, FLOATER, WEIGHT, article_scene, force, levitation_of, polar_angle
from .drawing import explain, text_table

CONFIGURATION, VALUE = "horizontal", 1.0  # The rotor of the article's figure; its text does not give the frequency
FREQUENCIES = (165.0, 170.0, 185.0, 200.0)
MODELS = ("semi-analytic", "small angles", "dipole", "fem")
TOLD_ANGLE, TOLD_DISTANCE = 9.0, 0.04
"""θ at the tipping point nearest to the rotor, °, in the article's text, and where that calls it almost zero, m."""
BOTH, ONE = ("frequency", "distance"), ("frequency",)
COLUMNS: Columns = {
    "attracting": (BOTH, "N", "force by the on-axis field, upwards"),
    "repelling": (BOTH, "N", "force by the rotating field, upwards"),
    "force_error": (BOTH, "N", "error of the force by the field's own estimate"),
    "polar_angle": (BOTH, "rad", "polar angle of the moment"),
    "equilibrium": (ONE, "m", "stable point"),
    "far_tipping": (ONE, "m", "tipping point far from the rotor"),
    "near_tipping": (ONE, "m", "tipping point near the rotor: released there the floater just reaches the far one"),
    "angle_near": (ONE, "rad", "polar angle at the near tipping point"),
    "angle_equilibrium": (ONE, "rad", "polar angle at the stable point"),
}


def force_points(quick: bool) -> list[Point]:
    """The rotor of the figure by both formulas and in both fields; `quick` has a coarser grid and one frequency."""
    frequencies, spacing = (FREQUENCIES[1:2], 5e-4) if quick else (FREQUENCIES, 1e-4)
    asked = {"configuration": CONFIGURATION, "value": VALUE, "frequencies_hz": list(frequencies), "spacing": spacing}
    return [{**asked, "model": model} for model in MODELS]


def force_curve(point: Point) -> xr.Dataset:
    """Axial force by one formula or in one field, where everything else is balanced, see `COLUMNS`."""
    grid = np.arange(CONTACT, 0.0451, point["spacing"])
    frequencies = np.asarray(point["frequencies_hz"], float)
    if point["model"] in MODELS[:2]:
        simple = point["model"] == "small angles"
        found = [force(CONFIGURATION, VALUE, grid, frequency, simple) for frequency in frequencies]
        rows = np.array([[one.attracting, one.repelling, np.zeros_like(grid), one.polar_angle] for one in found])
    else:
        shared = levitation_of(article_scene(CONFIGURATION, VALUE, frequencies[0]), point["model"])
        rows = np.array([_full(shared.elsewhere(frequency=float(f)), grid) for f in frequencies])
    marks = np.array([balance_points(grid, row[0] + row[1], row[3]) for row in rows])
    data = columns(COLUMNS, dict(zip(COLUMNS, (*rows.swapaxes(0, 1), *marks.T), strict=True)))
    frequency = variable(ONE, frequencies, "Hz", "frequency of the rotor")
    distance = variable(("distance",), grid, "m", "distance along the axis")
    return one_case(point, xr.Dataset(data, {"frequency": frequency, "distance": distance}))


def _full(levitation: Levitation, grid: Array) -> list[Array]:
    """The first four columns on the curve that holds the stable equilibrium; NaN beyond its ends."""
    # along the axis the moment comes nearest to upright on the curve that holds the stable equilibrium
    model, curves = sources(levitation.table), levitation.without_plate.curves
    curve = max(curves, key=lambda curve: float(curve.moment[:, 2].max()))
    parts = FLOATER.moment * curve.moment * model.evaluate(curve.position)[1][:, :, 2]
    error = FLOATER.moment * model.absolute_error(curve.position)[1]
    depth = -curve.position[:, 2]
    order = np.argsort(depth)
    found = (parts[:, 2], parts[:, 0] + parts[:, 1], error, polar_angle(curve.moment))
    return [scipy.interpolate.CubicSpline(depth[order], column[order], extrapolate=False)(grid) for column in found]


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


STYLES = {
    "fem": ("-", "finite elements"),
    "dipole": ("--", "point dipole"),
    "semi-analytic": (":", "article, semi-analytic"),
    "small angles": ("-.", "article, small angles"),
}
POINTS = {"near_tipping": ("<", "near tipping point"), "equilibrium": ("o", "stable"), "far_tipping": (">", "far one")}


@styled
def parts_figure(result: xr.Dataset) -> Figure:
    """Attraction, repulsion and net force at one frequency by each way of computing, and how far these are apart."""
    figure, ((left, right),) = panels(1, 2, (PAGE, 3.9))
    one = result.isel(frequency=min(1, result.sizes["frequency"] - 1))
    true = case_with(one, model="fem")
    for model, (style, text) in STYLES.items():
        found = case_with(one, model=model)
        for part, color in (("attracting", PALETTE[0]), ("repelling", PALETTE[1])):
            _plot(left, found, found[part], style, color=color, lw=1.0)
            if model != "fem":
                # in units of the weight: the parts themselves cross zero
                _plot(right, found, 100e-3 * (found[part] - true[part]) / WEIGHT, style, color=color)
        _plot(left, found, _net(found), style, color="k")
        explain(left, {text: style})
    explain(left, {"attracting part": "-"}, color=PALETTE[0])
    explain(left, {"repelling part": "-"}, color=PALETTE[1])
    explain(left, {"net force, with gravity": "-"}, color="k")
    _points(left, true, PALETTE[2], named=True)
    left.axhline(0.0, color="0.3", lw=0.6)
    left.set(ylabel="force, upwards (mN)", ylim=(-470, 350), title=f"δx = 1 mm, {float(one['frequency']):g} Hz")
    right.set(ylabel="deviation from finite elements\n(% of the weight)", title="Parts of the force", ylim=(-25, 25))
    legend_below(figure, left, columns=5)
    return figure


@styled
def net_figure(result: xr.Dataset) -> Figure:
    """The net force at every frequency, and the polar angle that goes with it."""
    figure, ((net, angle),) = panels(1, 2, (PAGE, 3.2))
    for k, color in zip(range(result.sizes["frequency"]), PALETTE, strict=False):
        for model in ("fem", "dipole"):
            found = case_with(result, model=model).isel(frequency=k)
            _plot(net, found, _net(found), STYLES[model][0], color=color)
        true = case_with(result, model="fem").isel(frequency=k)
        _points(net, true, color, named=False)
        _plot(angle, true, 1e-3 * np.degrees(true["polar_angle"].values), "-", color=color)
        explain(net, {f"{float(true['frequency']):g} Hz": "-"}, color=color)
    explain(net, {text: style for style, text in list(STYLES.values())[:2]} | {t: s for s, t in POINTS.values()})
    net.axhline(0.0, color="0.3", lw=0.6)
    net.set(ylabel="net force, with gravity (mN)", ylim=(-60, 40))
    angle.axhline(TOLD_ANGLE, color="0.4", lw=0.8, ls="-.", label="near tipping point in the article")
    angle.set(ylabel="polar angle θ (°)", ylim=(0, 20))
    legend_below(figure, net, angle, columns=5)
    return figure


FIGURES = {"force-curve-parts": parts_figure, "force-curve-net": net_figure}


def _net(found: xr.Dataset) -> xr.DataArray:
    return found["attracting"] + found["repelling"] - WEIGHT


def _plot(axes: Axes, found: xr.Dataset, values: ArrayLike, style: str, **more: Any) -> None:
    """Thousandfold values against the distance in mm."""
    axes.plot(1e3 * found["distance"], 1e3 * np.asarray(values), style, **more)
    axes.set(xlabel="distance along the axis (mm)", xlim=(11, 45))


def _points(axes: Axes, found: xr.Dataset, color: str, named: bool) -> None:
    for mark, (symbol, text) in POINTS.items():
        axes.plot(1e3 * float(found[mark]), 0.0, symbol, color=color, ms=5, label=text if named else None)


def force_lines(result: xr.Dataset) -> list[str]:
    """Stable and tipping points at each frequency, by each way, and the angles there."""
    rows = []
    for k, frequency in enumerate(result["frequency"].values):
        for model, (_, text) in STYLES.items():
            found = case_with(result, model=model).isel(frequency=k)
            far = np.interp(TOLD_DISTANCE, result["distance"].values, found["polar_angle"].values)
            places = [f"{1e3 * float(found[name]):.3f}" for name in ("near_tipping", "equilibrium", "far_tipping")]
            angles = [f"{np.degrees(float(a)):.2f}" for a in (found["angle_near"], found["angle_equilibrium"], far)]
            rows.append((f"{frequency:g} Hz, {text}", *places, *angles))
    head = ("δx = 1 mm", "near tipping (mm)", "stable (mm)", "far tipping (mm)", "θ near (°)", "θ stable", "θ at 40 mm")
    return [*text_table(head, rows), "The article: θ = 9° at the near tipping point, almost zero at 40 mm."]


STUDY = Study(
    name="force-curve",
    summary="force along the axis with its parts, stable and tipping points; the article's formulas and full fields",
    points=force_points,
    compute=force_curve,
    figures=FIGURES,
    report=force_lines,
)
