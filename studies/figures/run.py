"""Figures of results, each drawn from its dataset alone."""

import math
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import ConvexHull

from ...dynamics.equilibria.equilibrium import CRITERION, MARGINAL, STABILITIES
from ...dynamics.motion.state import polar_angle
from ...geometry.common import Array
from ...geometry.scene.contents import AbsoluteStart, Scene
from ...geometry.solids import Solid
from .style import COLORS, DASHES, NAMES, PALETTE, drawn, panels, plain_log, plot_branch, styled, titled
from .view import near_plate, triangles

DISTANCE = "levitation distance (mm)"
PLATE_MARKS = ((False, "o", "no plate"), (True, "D", "with the plate"))  # whether the plate's currents act
FILLS = {"stable": "full", "marginal": "left", "unstable": "none"}  # of the marker of an equilibrium
PARTS = 120  # Intervals of an envelope: more than a printed figure resolves
SHOWN = 200  # Samples of a trajectory that are drawn one by one
COARSE = 0.05  # Interval of samples (s) longer than an axial oscillation: a line would show false slow motions
HOURS = 7200.0  # Trajectories that take longer are drawn over hours, s
MODE_MARKERS = "osD^v"
FAMILY = 6  # curves in a panel, at most
APART = 0.3  # of the distance: farther from the last point of a branch the next is of another one
UNITS = {"1": "", "deg": "°", "1/s": "s⁻¹"}  # as text has them
ANSWERED = {"equilibria": "Equilibria", "flight": "Trajectories", "field": "Field"}
BESIDE = {"dipole": "-.", "true_moment": ":"}  # lines of the dipoles beside a sweep's model
NO_GROWTH = 1e-9  # Growth that counts as none, 1/s
QUANTITIES = {
    "equilibria": ("depth", "lateral_offset", "polar_angle", "growth"),
    "flight": ("levitated", "height_spread", "lost_at"),
    "field": ("across", "along", "B_error"),
}  # Quantities drawn for each question, those of the motion in the laboratory
WAYS = {-1: ("turned down", PALETTE[0]), 1: ("turned up", PALETTE[1]), 0: ("steady", "0.5")}
MARGIN = 0.3  # Of the range of distances along a drive that is shown, above and below it
MOST = 0.8  # Of its way is shown where it is far from the equilibria, so that a fall at its end is not


@drawn
def scene_figure(scene: Scene) -> Figure:
    """A scene to scale, from the side and from above, as it stands at t = 0; nothing is computed for it."""
    figure, ((side, top),) = panels(1, 2, 3.4)
    lowest = min(float(magnet.box.corners[:, 2].min()) for magnet in scene.rotor)
    name, where = "floater (where it levitates is not computed)", (lowest - 2 * scene.floater.radius) * np.eye(3)[2]
    axes = scene.floater.axes(np.eye(3)[2], None)
    if isinstance(start := scene.start, AbsoluteStart):
        name, where, axes = "floater, at its start", start.position, scene.floater.axes(start.moment, start.body_x)
    parts = scene.floater.placed(where, axes)
    bodies: list[tuple[Solid, str, str]] = [(part, PALETTE[1], name) for part in parts]
    bodies += [(magnet.body, PALETTE[0], "magnet") for magnet in scene.rotor]
    bodies += [(part.body, "0.5", "conductor of the rotor") for part in scene.conductors]
    reach = max(float(np.abs(1e3 * triangles(body)[0]).max()) for body, _, _ in bodies)
    if scene.plate:
        shown = near_plate(scene.plate.body, 2e-3 * reach).placed
        bodies = [*((body, "0.7", "plate, or the part that is near") for body in shown), *bodies]
    for panel, (across, up) in ((side, (0, 2)), (top, (0, 1))):
        for body, color, name in bodies:
            corners = 1e3 * triangles(body)[0][:, [across, up]]
            outline = corners[ConvexHull(corners).vertices]
            panel.add_patch(Polygon(outline, facecolor=color, alpha=0.4, edgecolor=color, label=name))
        for magnet in scene.rotor:
            size = np.linalg.norm(magnet.polarization) or 1.0
            length = 0.4e3 * magnet.body.volume ** (1 / 3)
            begin, arrow = 1e3 * magnet.body.center, length * magnet.polarization_in_rotor / size
            ends = (begin + arrow)[[across, up]], (begin - arrow)[[across, up]]
            panel.annotate("", *ends, arrowprops={"arrowstyle": "-|>", "color": PALETTE[0]})
        panel.set(aspect="equal", xlabel="x (mm)", ylabel=f"{'xyz'[up]} (mm)")
        panel.autoscale_view()
        panel.set_xlim(-1.05 * reach, 1.05 * reach)
    top.set_ylim(-1.05 * reach, 1.05 * reach)
    side.axvline(0.0, color="0.3", lw=0.8, ls="-.", label="axis of rotation")
    return figure


@drawn
def field_figure(result: xr.Dataset) -> Figure:
    """The field's two components on the axis below the rotor, and how far the models are from the best of them."""
    figure, ((left, right),) = panels(1, 2, 3.2)
    distance, reference = -1e3 * result["axis_height"].values, str(result.attrs["best_model"])
    fields = {str(model): result["axis_field"].sel(model=model).values for model in result["model"].values}
    best = fields.pop(reference)
    left.plot(distance, 1e3 * np.hypot(best[:, 0], best[:, 1]), color=COLORS[reference], label="across the axis")
    left.plot(distance, 1e3 * np.abs(best[:, 2]), "--", color=COLORS[reference], label="along the axis")
    size = np.linalg.norm(best, axis=1)
    looks = {model: (COLORS[model], DASHES[model], NAMES[model]) for model in fields}
    far = np.flatnonzero(np.isfinite(best).all(axis=1))[-1]
    if "dipole" in fields:  # of the moment that B_r V / mu_0 is not, where the magnets are permeable
        moment = float(best[far] @ fields["dipole"][far] / (fields["dipole"][far] @ fields["dipole"][far]))
        fields["true"] = moment * fields["dipole"]
        looks["true"] = PALETTE[5], ":", f"point dipole of the true moment ({100 * (moment - 1):+.2g} %)"
    for model, field in fields.items():
        color, style, label = looks[model]
        right.semilogy(distance, np.linalg.norm(field - best, axis=1) / size, style, color=color, label=label)
    error = result["axis_error"].sel(model=reference).values
    right.fill_between(distance, np.nanmin(error) / 3, error, color="0.85", label=f"error estimate, {NAMES[reference]}")
    left.set(xlabel=DISTANCE, ylabel=f"|B component| (mT), {NAMES[reference]}")
    plain_log(left.yaxis)
    right.set(xlabel=DISTANCE, ylabel=f"|ΔB| / |B| against {NAMES[reference]}")
    return figure


def _kinds(result: xr.Dataset, prefix: str = "") -> xr.DataArray:
    """Of equilibria: "stable", "marginal" or "unstable"; also of results that do not have it as text."""
    stable = result[f"{prefix}stable"]
    lasts = result.get(f"{prefix}growth", xr.full_like(stable, np.inf, float)) <= MARGINAL
    kinds = np.where(stable == 1, "stable", np.where(lasts, "marginal", "unstable"))
    return stable.copy(data=kinds)


@drawn
def force_figure(result: xr.Dataset) -> Figure:
    """Axial force against distance with its equilibria marked, for every model that has them; a zoom on the first."""
    figure, ((axes, near),) = panels(1, 2, 3.6)
    weight = -1e3 * float(result.attrs["weight_N"])
    acting = result.get("equilibrium_with_plate", 0 * result["equilibrium_stable"]) == 1  # older results do not say
    kinds = _kinds(result, "equilibrium_")
    depth = -1e3 * result["equilibrium_position"].sel(axis="z")
    curves = result[["curve_model", "curve_number", "curve_position", "curve_force"]]  # without the trajectory
    peaks = [3.5 * weight]
    for panel in (axes, near):
        panel.axhline(weight, color="0.3", lw=0.8, label="weight of the floater")
        for model in dict.fromkeys(result["curve_model"].values.tolist()):
            look: dict[str, Any] = {"color": COLORS[model], "linestyle": DASHES[model]}
            panel.plot([], [], label=NAMES[model], **look)
            of_model = curves.isel(curve_point=(curves["curve_model"] == model).values)
            for number in np.unique(of_model["curve_number"]):
                one = of_model.isel(curve_point=(of_model["curve_number"] == number).values)
                distance, force = -1e3 * one["curve_position"].sel(axis="z").values, 1e3 * one["curve_force"].values
                panel.plot(*_smooth(np.arange(float(len(force))), distance, force), **look)
                peaks += force[1:-1][(force[1:-1] > force[:-2]) & (force[1:-1] > force[2:])].tolist()
        for (plate, marker, label), (kind, fill) in product(PLATE_MARKS, FILLS.items()):
            chosen = (acting == plate) & (kinds == kind)
            white: dict[str, Any] = {"fillstyle": fill, "markerfacecoloralt": "white"}
            if chosen.any():
                panel.plot([], [], marker, color="0.3", label=f"{STABILITIES[kind]}, {label}", **white)
            for model in np.unique(result["equilibrium_model"].values[chosen.values]).tolist():
                place = depth.values[(chosen & (result["equilibrium_model"] == model)).values]
                panel.plot(place, 0 * place + weight, marker, color=COLORS[model], ms=5, **white)
        panel.set(xlabel=DISTANCE)
    nearest, farthest = min([12.0, *depth.values]), max([0.0, *depth.values])
    far = 60.0 if nearest == 12.0 and farthest < 60 else 1.3 * farthest
    axes.set(xlim=(far / 12, far), ylabel="axial magnetic force (mN), up positive")
    if weight > 0:
        axes.set_ylim(-2.5 * weight, min(1.1 * max(peaks), 30 * weight))
    first = depth.values[(kinds != "unstable").values][:1]
    if first.size and weight > 0:
        near.set(xlim=(0.95 * first[0], 1.05 * first[0]), ylim=(0.0, 2 * weight))
        near.locator_params(nbins=5)
    else:
        near.set_visible(False)
    return figure


@drawn
def trajectory_figure(result: xr.Dataset) -> Figure:
    """Distance and polar angle of a trajectory as envelopes, and a closer look at its beginning, or its end if lost."""
    figure, ((far, look), (tilt, above)) = panels(2, 2, 2.4)
    seconds, moment = result["time"].values, result["moment"].values
    time, unit = (seconds / 3600, "h") if seconds[-1] > HOURS else (seconds, "s")
    distance = -1e3 * result["position_rotor_frame"].sel(axis="z").values
    angle = np.degrees(polar_angle(moment))
    up = str(result.attrs.get("ended_by", "duration")) in ("duration", "stopped")
    near = slice(0, SHOWN) if up else slice(-SHOWN, None)
    parts = np.array_split(np.arange(len(time)), min(PARTS, max(1, len(time) // 8)))
    for panel, values in ((far, distance), (tilt, angle)):
        # A weighted mean over some parts: that of each part would have a beat with the modes for a motion.
        mean = gaussian_filter1d(values, 2 * len(time) / len(parts))
        rows = [(time[p].mean(), values[p].min(), mean[p].mean(), values[p].max()) for p in parts]
        middle, low, middling, high = np.array(rows).T
        if len(parts) == PARTS:  # next to an end the mean would be of half a motion
            middling[:4] = middling[-4:] = np.nan
        middling[(middling < low) | (middling > high)] = np.nan  # where all changes faster than it shows
        panel.fill_between(middle, low, high, color=PALETTE[5], alpha=0.6, lw=0, label="smallest to largest")
        panel.plot(middle, middling, color=PALETTE[0], lw=1.0, label="mean")
        panel.axvspan(time[near][0], time[near][-1], color=PALETTE[4], alpha=0.4, lw=0, label="shown in (b) and (d)")
        if "lowered_from_s" in result.attrs:
            ends = [min(float(result.attrs[f"lowered_{word}_s"]), seconds[-1]) for word in ("from", "until")]
            span = np.array(ends) * time[-1] / seconds[-1]
            panel.axvspan(*span, color="0.88", lw=0, zorder=0, label="plate is lowered")
        panel.set_xlabel(f"time ({unit})")
    seen = {"rotor's frame": "position_rotor_frame", "laboratory": "position"}  # the one in which it moves less
    frame = min(seen, key=lambda frame: np.ptp(result[seen[frame]].values[near], axis=0).max())
    x, y = 1e3 * result[seen[frame]].values[near].T[:2]
    close: tuple[Array, ...] = (time[near], distance[near], x, y)
    if (step := float(np.diff(seconds[near]).max(initial=0.0))) > COARSE:
        style = "."
        look.set_title(f"(b) a sample every {step:.2g} s")
    else:
        close, style = _smooth(close[0], *close), "-"
    look.plot(close[0], close[1], style, lw=0.8, ms=3)
    above.plot(close[2], close[3], style, lw=0.8, ms=3)
    above.plot(x[0], y[0], "o", color=PALETTE[2], ms=4, label="start of (d)")
    above.plot(x[-1], y[-1], "o", color=PALETTE[1], ms=4, label="end of (d)")
    far.set(ylabel=DISTANCE)
    tilt.set(ylabel="polar angle of the moment (°)")
    look.set(xlabel=f"time ({unit})", ylabel=DISTANCE)
    above.set(xlabel=f"x (mm), {frame}", ylabel="y (mm)", aspect="equal", adjustable="datalim")
    for panel in (far, look, tilt, above):
        panel.locator_params(axis="x", nbins=5)
    return figure


def _smooth(parameter: Array, *curves: Array) -> tuple[Array, ...]:
    """Points of smooth curves through samples (n,) at a growing parameter (n,)."""
    parameter, kept = np.unique(parameter, return_index=True)
    if len(parameter) < 4:
        return curves
    fine = np.linspace(parameter[0], parameter[-1], 12 * len(parameter))
    return tuple(CubicSpline(parameter, np.column_stack(curves)[kept])(fine).T)


@styled
def working_point_figure(found: xr.Dataset) -> Figure:
    """A row per magnet: a section along the easy axis through the lowest place, and the field over the volume."""
    figure, axes = panels(found.sizes["magnet"], 2, 2.9)
    for k, (section, volume) in enumerate(axes):
        one = found.isel(magnet=k)
        u, v, knee = 1e3 * one["along"].values, 1e3 * one["across"].values, float(one["knee"])
        shown = section.pcolormesh(u, v, one["section"].values, cmap="viridis", shading="nearest", rasterized=True)
        figure.colorbar(shown, ax=section, label="μ0 H along the easy axis (T)")
        if np.nanmin(one["section"].values) < knee:
            below = np.where(one["section"].values < knee, 1.0, np.nan)
            section.contourf(u, v, below, levels=[0.5, 1.5], colors="none", hatches=["////"])
            section.contour(u, v, np.nan_to_num(one["section"].values), levels=[knee], colors="white", linewidths=1)
        away = one["place"].values - one["center"].values
        where = [1e3 * float(away @ one[name].values) for name in ("easy_axis", "across_axis")]
        section.plot(*where, "o", color=PALETTE[1], markersize=5, markeredgecolor="white", clip_on=False)
        titled(section, f"magnet {int(one['magnet'])}")
        section.set(xlabel="along the easy axis (mm)", ylabel="across (mm)")
        section.set_aspect("equal")
        section.grid(False)
        volume.plot(one["levels"], 100 * found["share"])
        volume.axvline(float(one["lowest"]), color=PALETTE[1], linestyle="--", label="lowest, off the edges")
        if np.isfinite(knee):
            volume.axvline(knee, color="black", label="knee")
        volume.set(xlabel="μ0 H along the easy axis (T)", ylabel="share of the volume below (%)", ylim=(0, 100))
        volume.legend()
    return figure


@drawn
def modes_figure(result: xr.Dataset) -> Figure:
    """Rate and frequency of every normal mode; open where it decays, filled where it grows."""
    figure, ((axes,),) = panels(1, 1, 3.4)
    listed = result if "equilibrium" in result.dims else result.expand_dims("equilibrium")
    kinds = _kinds(listed).values.tolist()
    for k, color in zip(range(listed.sizes["equilibrium"]), PALETTE * 9, strict=False):
        one = listed.isel(equilibrium=k)
        distance = -1e3 * float(one["position"].sel(axis="z"))
        axes.plot([], [], "s", color=color, label=f"{distance:.2f} mm, {STABILITIES[kinds[k]]}")
        for name, marker in zip(one["mode"].values.tolist(), MODE_MARKERS, strict=True):
            mode = one.sel(mode=name)
            rate = float(mode["mode_growth"])
            fill = color if rate > NO_GROWTH else "none"
            axes.plot(mode["mode_frequency"], max(abs(rate), NO_GROWTH), marker, color=color, mfc=fill, ms=6)
    for name, marker in zip(listed["mode"].values.tolist(), MODE_MARKERS, strict=True):
        axes.plot([], [], marker, color="0.3", mfc="none", label=name)
    axes.plot([], [], "o", color="0.3", label="filled: grows")
    axes.set(yscale="log", xlabel="frequency, rotor's frame (Hz)", ylabel="rate of decay or growth (s⁻¹)")
    axes.margins(0.08)
    return figure


def drawable(result: xr.Dataset) -> bool:
    """Whether there is a figure: at most `FAMILY` curves over one parameter, or a map over two numbers."""
    along, others = _axes(result)
    family = math.prod(result.sizes[key] for key in others)
    return family <= FAMILY or (len(others) == 1 and {result[k].dtype.kind for k in (along, *others)} <= set("iuf"))


@drawn
def question_figure(result: xr.Dataset) -> Figure:
    """Curves over the number with most values, one for each combination of the others, or maps where they are many."""
    (shown, names), (along, others) = _derived(result), _axes(result)
    figure, ((*axes,),) = panels(1, len(names), 3.1, 2)
    members = list(product(*(shown[key].values.tolist() for key in others)))
    for panel, name in zip(axes, names, strict=True):
        if len(members) > FAMILY:
            _map(panel, shown, name, [*others, along])
        for values, color in zip(members if len(members) <= FAMILY else (), PALETTE, strict=False):
            chosen = dict(zip(others, values, strict=True))
            each = (NAMES[v] if isinstance(v, str) else _label(shown[k], f" = {v:g}") for k, v in chosen.items())
            label = ", ".join(each) or NAMES.get(str(result.attrs.get("model", "")), "")
            color = COLORS[chosen["model"]] if others == ["model"] else color
            _curve(panel, shown.sel(chosen), name, along, color, label)
            if name == "depth" and "dipole_distance" in shown and shown[along].dtype.kind in "iuf":
                for beside, style in BESIDE.items():
                    one = 1e3 * shown[f"{beside}_distance"].sel(chosen)
                    panel.plot(one[along], one, style, color=color if len(members) > 1 else "0.4", lw=1.0)
    if "dipole_distance" in shown and len(members) <= FAMILY and shown[along].dtype.kind in "iuf":
        plate = " without plate" if shown.attrs.get("plate_model", "none") != "none" else ""
        for style, words in zip(BESIDE.values(), ("point dipole", "dipole, true moment"), strict=True):
            axes[0].plot([], [], style, color="0.4", lw=1.0, label=f"{words}{plate}")
    if "stable" in shown and len(members) <= FAMILY:
        axes[0].plot([], [], "o--", ms=3, color="0.3", mfc="white", label="unstable")
    return figure


def _axes(result: xr.Dataset) -> tuple[str, list[str]]:
    """What is varied along the curves: the number of most values, if any is a number; and what else is varied."""
    varied = [str(key) for key in np.atleast_1d(result.attrs["varied"])]
    along = max(varied, key=lambda key: (result[key].dtype.kind in "iuf", result.sizes[key]))
    return along, [key for key in varied if key != along]


def _derived(result: xr.Dataset) -> tuple[xr.Dataset, list[str]]:
    """The result with what is drawn instead of what is kept, and the names of that."""
    if "position" in result:
        depth = (-1e3 * result["position"].sel(axis="z")).assign_attrs(units="mm", long_name="levitation distance")
        result = result.assign(depth=depth)
    if "growth" in result:
        lasts = (result["stable"] == 1) | (result["growth"] <= MARGINAL)  # as ranges of stable frequencies have it
        result = result.assign(stable=lasts)
    if "lateral_offset" in result:
        offset = (1e3 * result["lateral_offset"]).assign_attrs(units="mm", long_name="lateral offset")
        angle = result["polar_angle"].assign_attrs(long_name="polar angle")
        result = result.assign(lateral_offset=offset, polar_angle=angle)
    if "B" in result:
        x, y, z = (1e3 * result["B"].sel(axis=axis, drop=True) for axis in "xyz")
        parts = {"across": (x**2 + y**2) ** 0.5, "along": abs(z)}
        result = result.assign({k: v.assign_attrs(units="mT", long_name=f"|B| {k} the axis") for k, v in parts.items()})
    return result, [name for name in QUANTITIES[str(result.attrs["ask"])] if name in result]


def _curve(axes: Axes, result: xr.Dataset, name: str, key: str, color: str, label: str) -> None:
    values, solid = result[name], np.ones(result.sizes[key], bool)
    if "equilibrium" in values.dims:
        number = _levitating(result, key)
        branch = result[[name, "stable"]].isel(equilibrium=xr.DataArray(number, dims=key)).where(number >= 0)
        values, solid = branch[name].assign_attrs(values.attrs), branch["stable"].values == 1
    x, y = result[key].values, values.values.astype(float)
    style: dict[str, Any] = {"color": color, "ms": 3.5}
    axes.plot([], [], "o-", label=label or None, **style)
    if result[key].dtype.kind in "iuf":
        plot_branch(axes, x, y, solid, color=color)
    axes.plot(x, np.where(solid, y, np.nan), "o", **style)
    axes.plot(x, np.where(solid, np.nan, y), "o", mfc="white", **style)
    axes.set(xlabel=_label(result[key]), ylabel=_label(values))
    if name in QUANTITIES["field"] and np.nanmin(y, initial=np.inf) > 0:
        axes.set_yscale("log")
    elif name == "growth":
        axes.axhline(0.0, color="0.3", lw=0.8)


def _levitating(result: xr.Dataset, key: str) -> NDArray[np.int_]:
    """Numbers of equilibria on the branch of the stable ones or the first, each nearest to the last; -1 beyond."""
    place = result["position"].transpose(key, "equilibrium", "axis").values
    stable = result["stable"].transpose(key, "equilibrium").values == 1
    begin, numbers = int(np.argmax(stable.any(axis=1))), np.full(len(place), -1)
    for order in (range(begin, len(place)), range(begin, -1, -1)):
        last = place[begin, 0]  # the stable ones are the first
        for k in order:
            known = stable[k] if stable[k].any() else np.isfinite(place[k, :, 2])
            apart = np.where(known, np.linalg.norm(place[k] - last, axis=1), np.inf)
            if apart.min() > APART * np.linalg.norm(last):
                break
            numbers[k] = np.argmin(apart)
            last = place[k, numbers[k]]
    return numbers


def _map(axes: Axes, result: xr.Dataset, name: str, keys: list[str]) -> None:
    values = result[name]
    if "equilibrium" in values.dims:  # the first is stable wherever any is
        values = values.where(result["stable"] == 1).isel(equilibrium=0).assign_attrs(values.attrs)
        titled(axes, "stable equilibrium")
    x, y = (result[key].values for key in keys[::-1])
    drawn = axes.pcolormesh(x, y, values.transpose(*keys).values, shading="nearest")
    axes.set(xlabel=_label(result[keys[1]]), ylabel=_label(result[keys[0]]))
    if axes.figure is not None:
        axes.figure.colorbar(drawn, ax=axes, label=_label(values))


def _label(values: xr.DataArray, value: str = "") -> str:
    unit = UNITS.get(units := str(values.attrs.get("units", "1")), units)
    return f"{values.attrs.get('long_name', values.name)}{value} {unit if value or not unit else f'({unit})'}".rstrip()


def question_lines(result: xr.Dataset) -> list[str]:
    varied, ask = np.atleast_1d(result.attrs["varied"]), str(result.attrs["ask"])
    grid = " × ".join(f"{key} ({result.sizes[key]} values)" for key in varied)
    lines = [f"{ANSWERED[ask]} over {grid}."]
    shown, names = _derived(result)
    if "stable" in shown:
        some = (shown["stable"] == 1).any("equilibrium")
        lines.append(f"Stable levitation ({CRITERION}) at {int(some.sum())} of {some.size} points.")
        shown = shown.where(shown["stable"] == 1)
    if "unknown" in result and (result["unknown"] > 0).any():
        lines.append(f"At {int((result['unknown'] > 0).sum())} points not all equilibria could be computed.")
    for name in names:
        values = shown[name].values[np.isfinite(shown[name].values)]
        if len(values):
            what = f"{shown[name].attrs['long_name']}{' where stable' if 'stable' in shown else ''}"
            units = UNITS.get(shown[name].attrs["units"], shown[name].attrs["units"])
            lines.append(f"{what}: {values.min():.4g} to {values.max():.4g} {units}".rstrip())
    return lines + (_beside_lines(result) if ask == "equilibria" else [])


def _beside_lines(result: xr.Dataset) -> list[str]:
    if "dipole_distance" not in result:
        model = str(result.attrs.get("model", ""))
        return ["Against finite elements: --vary model=dipole,fem."] if model == "dipole" else []
    plate = " without the plate" if result.attrs.get("plate_model", "none") != "none" else ""
    best = NAMES.get(str(result.attrs.get("model", "")), "the sweep's model")
    said = []
    for name, words in (("dipole", "point dipole"), ("true_moment", "dipole of the magnets' true moments")):
        apart = 1e3 * (result[f"{name}_distance"] - result["true_distance"]).values
        known = apart[np.isfinite(apart)]
        if known.size:
            span = f"{known.min():+.2g} to {known.max():+.2g}" if np.ptp(known) > 0 else f"{known[0]:+.2g}"
            said.append(f"{words} {span} mm")
    text = f"Levitation distance against {best}, same conditions{plate}: {', '.join(said)}."
    missing = int((result["dipole_distance"].isnull() & result["true_distance"].notnull()).sum())
    other = int((result["dipole_distance"].notnull() & result["true_distance"].isnull()).sum())
    lines = [text] if said else []
    lines += [f"No equilibrium by the point dipole at {missing} points where {best} has one."] if missing else []
    lines += [f"No equilibrium by {best} at {other} points where the point dipole has one."] if other else []
    lasts = int((result["dipole_stability"].isin(["stable", "marginal"])).sum())
    return [*lines, f"Stable levitation by the point dipole, same conditions{plate}: at {lasts} points."]


@drawn
def drive_figure(result: xr.Dataset) -> Figure:
    """Of a drive distance against frequency, smallest to largest, over the equilibria; the motor's work in time."""
    figure, ((along, work),) = panels(1, 2, 3.0)
    time, frequency = result["time"].values, result["rotor_frequency"].values
    distance = -1e3 * result["position"].sel(axis="z").values
    parts = [part for part in np.array_split(np.arange(len(time)), PARTS) if len(part)]
    mean, low, high = np.array([(frequency[p].mean(), distance[p].min(), distance[p].max()) for p in parts]).T
    ways = np.sign(np.round([frequency[p[-1]] - frequency[p[0]] for p in parts], 9)).astype(int)
    steady, equilibria = result["quasi_static_frequency"].values, 1e3 * result["quasi_static_distance"].values
    stable = result["quasi_static_growth"].values <= MARGINAL
    plot_branch(along, steady, equilibria, stable, color="k", label="equilibrium")
    along.plot([], [], "k--", label="unstable equilibrium")
    for stretch in np.split(np.arange(len(parts)), np.flatnonzero(np.diff(ways)) + 1):
        label, color = WAYS[int(ways[stretch[0]])]
        joined = np.append(stretch, stretch[-1] + 1)[: len(parts) - stretch[0]]
        look = {"color": color, "alpha": 0.5, "label": label}
        if ways[stretch[0]]:
            along.fill_between(mean[joined], low[joined], high[joined], lw=0.8, **look)
        else:
            along.plot(mean[stretch][[0, 0]], [low[stretch].min(), high[stretch].max()], lw=3, **look)
    there = (steady >= frequency.min()) & (steady <= frequency.max())
    known = np.array([*equilibria[there], np.quantile(low, 1 - MOST), np.quantile(high, MOST)])
    room = MARGIN * max(float(np.ptp(known)), 1.0)
    if (end := str(result.attrs["ended_by"])) in ("contact", "lost"):
        along.axvline(frequency[-1], color=PALETTE[3], ls=":", label=f"{end}, {frequency[-1]:.4g} Hz")
    span = max(float(np.ptp(frequency)), 1.0)
    along.set(xlabel="frequency of the rotor (Hz)", ylabel=DISTANCE, ylim=(known.min() - room, known.max() + room))
    along.set_xlim(frequency.min() - 0.1 * span, frequency.max() + 0.1 * span)
    work.plot(time, 1e3 * result["motor_work"], color=PALETTE[2], lw=0.6, label="work of the motor")
    work.set(xlabel="time (s)", ylabel="work of the motor (mJ)")
    return figure
