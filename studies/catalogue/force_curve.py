"""Force along the axis against distance, with its repelling and its attracting part: the article's second figure."""

import numpy as np
import scipy
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...geometry.common import Array
from ..figures.style import PAGE, PALETTE, panels, styled
from ..levitation import Levitation, sources
from ..result import variable
from ..study import Point, Study, by_case, cases_with, one_case
from .article import CONTACT, FLOATER, WEIGHT, article_scene, force, levitation_of

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


TOLD_ANGLE, TOLD_DISTANCE = np.radians(9.0), 0.04
"""θ at the tipping point nearest to the rotor, in the article's text, and where that calls it almost zero, m."""
STYLES = {"fem": "-", "dipole": "--", "semi-analytic": ":", "small angles": "-."}
TEXTS = {
    "fem": "finite elements",
    "dipole": "point dipole",
    "semi-analytic": "article, semi-analytic",
    "small angles": "article, small angles",
}
POINTS = {"near_tipping": ("<", "tipping points"), "equilibrium": ("o", "stable point"), "far_tipping": (">", "")}


@styled
def parts_figure(result: xr.Dataset) -> Figure:
    """Attraction, repulsion and net force at one frequency by each way of computing, and how far these are apart."""
    figure, ((left, ratio),) = panels(1, 2, (PAGE, 3.5))
    one = result.isel(frequency=min(1, result.sizes["frequency"] - 1))
    _parts(left, one)
    left.set_title(f"δx = 1 mm, {float(one['frequency']):g} Hz")
    _differences(ratio, one)
    for axes in (left, ratio):
        axes.set(xlabel="distance along the axis (mm)", xlim=(11, 45))
    return figure


@styled
def net_figure(result: xr.Dataset) -> Figure:
    """The net force at every frequency, and the polar angle that goes with it."""
    figure, ((right, angle),) = panels(1, 2, (PAGE, 2.9))
    for k, color in zip(range(result.sizes["frequency"]), PALETTE, strict=False):
        _net(right, result.isel(frequency=k), color)
        here = cases_with(result.isel(frequency=k), model="fem").isel(case=0)
        angle.plot(_mm(result), np.degrees(here["polar_angle"]), color=color)
    right.plot([], [], STYLES["dipole"], color="0.3", label=TEXTS["dipole"])
    right.set(ylabel="net force, with gravity (mN)", ylim=(-60, 40), title="Net force")
    right.legend()
    angle.axhline(np.degrees(TOLD_ANGLE), color="0.4", lw=0.8, ls="--", label="the article's near tipping point")
    angle.set(ylabel="polar angle θ (°)", ylim=(0, 20), title="Polar angle")
    angle.legend()
    for axes in (right, angle):
        axes.set(xlabel="distance along the axis (mm)", xlim=(11, 45))
    return figure


FIGURES = {"force-curve-parts": parts_figure, "force-curve-net": net_figure}


def _mm(result: xr.Dataset) -> np.ndarray:
    return np.asarray(1e3 * result["distance"].values)


def _parts(axes: Axes, one: xr.Dataset) -> None:
    for model, style in STYLES.items():
        found = cases_with(one, model=model).isel(case=0)
        for part, color in (("attracting", PALETTE[0]), ("repelling", PALETTE[1])):
            axes.plot(_mm(one), 1e3 * found[part], style, color=color, lw=1.0)
        total = 1e3 * (found["attracting"] + found["repelling"] - WEIGHT)
        axes.plot(_mm(one), total, style, color="k", label=TEXTS[model])
        if model == "fem":
            error = 1e3 * found["force_error"]
            axes.fill_between(_mm(one), total - error, total + error, color="0.7", lw=0)
            _arrows(axes, found)
    axes.axhline(-1e3 * WEIGHT, color="0.5", lw=0.8)
    axes.axhline(0.0, color="0.3", lw=0.6)
    for text, place, color in (("attracting part", (24, 165), PALETTE[0]), ("repelling part", (20, -225), PALETTE[1])):
        axes.annotate(text, place, color=color, fontsize="small")
    axes.annotate("gravity", (40, -1e3 * WEIGHT - 30), color="0.4", fontsize=7)
    axes.set(ylabel="force, upwards (mN)", ylim=(-470, 350))
    axes.legend(title="black: net force", loc="lower right")


def _arrows(axes: Axes, found: xr.Dataset) -> None:
    for mark, (symbol, text) in POINTS.items():
        axes.plot(1e3 * float(found[mark]), 0.0, symbol, color=PALETTE[2], ms=5, label=text or None)
    stable, far = 1e3 * float(found["equilibrium"]), 1e3 * float(found["far_tipping"])
    for start, end in ((stable + 3.5, stable + 1), (stable - 3.5, stable - 1), (far + 1, far + 4)):
        axes.annotate("", (end, 75), (start, 75), arrowprops={"arrowstyle": "->", "color": PALETTE[2]})


def _net(axes: Axes, one: xr.Dataset, color: str) -> None:
    for model in ("fem", "dipole"):
        found = cases_with(one, model=model).isel(case=0)
        label = f"{float(one['frequency']):g} Hz" if model == "fem" else None
        net = 1e3 * (found["attracting"] + found["repelling"] - WEIGHT)
        axes.plot(_mm(one), net, STYLES[model], color=color, label=label)
        if model == "fem":
            for mark, (symbol, _) in POINTS.items():
                axes.plot(1e3 * float(found[mark]), 0.0, symbol, color=color, ms=4)
    axes.axhline(0.0, color="0.3", lw=0.6)


def _differences(axes: Axes, one: xr.Dataset) -> None:
    true = cases_with(one, model="fem").isel(case=0)
    for model, color in (("dipole", PALETTE[0]), ("semi-analytic", PALETTE[1]), ("small angles", PALETTE[3])):
        found = cases_with(one, model=model).isel(case=0)
        for part, style in (("attracting", "-"), ("repelling", "--")):
            label = f"{TEXTS[model]}, {part}"
            axes.plot(_mm(one), 100 * (found[part] / true[part] - 1), style, color=color, label=label)
    axes.set(ylabel="difference from finite elements (%)", ylim=(-5, 20), title="Parts of the force")
    axes.legend()


def force_lines(result: xr.Dataset) -> list[str]:
    """Stable and tipping points at each frequency, by each way, and the angle the article gives."""
    lines = []
    for k, frequency in enumerate(result["frequency"].values):
        for model in STYLES:
            found = cases_with(result, model=model).isel(case=0, frequency=k)
            far_angle = np.interp(TOLD_DISTANCE, result["distance"].values, found["polar_angle"].values)
            lines.append(
                f"{frequency:g} Hz, {TEXTS[model]}: stable at {1e3 * float(found['equilibrium']):.3f} mm "
                f"(θ = {np.degrees(float(found['angle_equilibrium'])):.2f}°), tipping points at "
                f"{1e3 * float(found['near_tipping']):.3f} mm (θ = {np.degrees(float(found['angle_near'])):.2f}°; "
                f"the article: 9°) and {1e3 * float(found['far_tipping']):.3f} mm; "
                f"θ = {np.degrees(far_angle):.2f}° at 40 mm (the article: almost zero)."
            )
    return lines


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
