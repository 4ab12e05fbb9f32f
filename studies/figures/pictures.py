"""The figure of working points: where in each magnet the field is how low, and how much of it is below the knee."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ...dynamics.motion.state import State
from ...fem.closed_forms.potentials import unit_dipoles
from ...fem.plate.eddy import Source, solve_eddy
from ...fem.plate.eddy_fields import current_density
from ...fem.plate.rotor_share import posed_rotor, rotor_parts
from ...fem.rotor.choice import rotor_table
from ...fem.rotor.table import FieldTable, RotorTable
from ...geometry.common import Array
from ...geometry.meshes.plate import MeshRule, plate_mesh
from ...geometry.scene.contents import Plate, Scene
from .style import PAGE, PALETTE, panels, styled
from .view import FieldPlane, Frames, View, frame_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def working_point_figure(found: xr.Dataset) -> Figure:
    """A row per magnet: a section along the easy axis through the lowest place, and the field over the volume."""
    count = found.sizes["magnet"]
    figure, axes = panels(count, 2, (PAGE, 2.9 * count))
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
        section.set(title=f"Magnet {int(one['magnet'])}", xlabel="along the easy axis (mm)", ylabel="across (mm)")
        section.set_aspect("equal")
        section.grid(False)
        volume.plot(one["levels"], 100 * found["share"])
        volume.axvline(float(one["lowest"]), color=PALETTE[1], linestyle="--", label="lowest, off the edges")
        if np.isfinite(knee):
            volume.axvline(knee, color="black", label="knee")
        volume.set(xlabel="μ0 H along the easy axis (T)", ylabel="share of the volume below (%)", ylim=(0, 100))
        volume.legend()
    return figure


ORDER = 3
"""Of the elements: a picture needs no more."""
LATEST = 200
"""Samples at the end of a flight among which one is shown."""
ANGLES = 8
"""Of the rotor, from which the part of its field at the rotor's frequency is taken."""


def last_view(scene: Scene, table: FieldTable, time: Array, motion: State) -> View:
    """The end of a flight (n, 3) along the rotor's axes at times (n,) s, with its path and the field."""
    view = seen_from(scene, time, motion)
    return replace(view, plane=_field_plane(scene, table, -1e3 * float(view.position[2])))


def seen_from(scene: Scene, time: Array, motion: State) -> View:
    """The end of a flight (n, 3) along the rotor's axes at times (n,) s, with its path.

    A floater that gravity across the axis keeps on one side of it does not turn with the rotor: its path is that in the
    laboratory, and it stands where it is at an instant near the end at which the rotor's axes are the laboratory's.
    """
    frame, last = "rotor's frame", len(time) - 1
    if np.any(scene.gravity[:2]):
        frame, angle = "laboratory", scene.angular_velocity * time
        motion = motion.to_lab(angle)
        last -= int(np.argmax(np.cos(angle[:-LATEST:-1])))
    return View(scene, motion.position[last], motion.moment[last], motion.position, frame=frame)


def _field_plane(scene: Scene, table: FieldTable, depth: float) -> FieldPlane:
    """The field as the table has it and, nearer to the magnets than its range, by the closed form."""
    depth = max(abs(depth), 10.0)
    width = max(1.6 * depth, 30.0)
    points = 1e-3 * FieldPlane.points(width, depth)
    field = np.full(points.shape, np.nan)
    for source in (rotor_table(scene.rotor, "cuboid"), table):
        known = source.in_range(points)
        field[known] = source.evaluate(points[known])[0]
    return FieldPlane(width, depth, field)


def flight_frames(scene: Scene, time: Array, motion: State) -> Frames:
    """The frames of an animation of a flight (n, 3) along the rotor's axes at times (n,) s."""
    instants = frame_times(scene, float(time[-1]))
    position, moment = (
        np.stack([np.interp(instants, time, component) for component in vectors.T], axis=-1)
        for vectors in (motion.position, motion.moment)
    )
    standing = State(position, np.zeros_like(position), moment, np.zeros_like(moment))
    laboratory = standing.to_lab(scene.angular_velocity * instants)
    return Frames(scene, instants, laboratory.position, laboratory.moment)


def plate_currents(scene: Scene, plate: Plate, table: RotorTable, floater: State, points: Array) -> Array:
    """Current density (n, 3), A/m², laboratory frame, in a plate on which rotor and floater have long been turning.

    Parameters
    ----------
    floater : along the rotor's axes, at the instant at which these are the laboratory's; its place is taken as fixed
    points : (n, 3) m inside the plate, laboratory frame

    The part at the rotor's frequency only; harmonics are left out.
    """
    turning = np.array([[1, 1j, 0], [-1j, 1, 0], [0, 0, 0]]) @ floater.moment
    place = plate.box.to_body(floater.position[None])
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    parts = rotor_parts(table, plate)
    sources: list[Source] = [*unit_dipoles(place), *(posed_rotor(parts, plate, angle, 0.0) for angle in angles)]
    amplitudes = np.concatenate(
        [scene.floater.moment * (plate.box.rotation.T @ turning), 2 / ANGLES * np.exp(-1j * angles)]
    )
    mesh = plate_mesh(plate.box.size, plate.conductivity, place, scene.frequency, MeshRule())
    response = solve_eddy(mesh, ORDER, scene.frequency, sources)
    body = plate.box.to_body(points)
    applied = np.tensordot(amplitudes, np.array([source.vector_potential(body) for source in sources]), axes=1)
    return np.asarray(current_density(response, applied, amplitudes, body).real @ plate.box.rotation.T)


MARKERS = "osD^v"
"""One for each small motion."""
NOTHING = 1e-9
"""Growth that counts as none on the axis, 1/s."""


@styled
def modes_figure(result: xr.Dataset) -> Figure:
    """Growth against frequency of every small motion, from a result of `equilibria` or `stability`."""
    figure, ((axes,),) = panels(1, 1, (5.5, 3.6))
    listed = result if "equilibrium" in result.dims else result.expand_dims("equilibrium")
    for k, color in zip(range(listed.sizes["equilibrium"]), PALETTE * 9, strict=False):
        one = listed.isel(equilibrium=k)
        height = 1e3 * float(one["position"].sel(axis="z"))
        axes.plot([], [], "s", color=color, label=f"z = {height:.2f} mm, {'stable' if one['stable'] else 'unstable'}")
        for name, marker in zip(one["mode"].values.tolist(), MARKERS, strict=True):
            mode = one.sel(mode=name)
            axes.plot(mode["mode_frequency"], mode["mode_growth"], marker, color=color, mfc="none", ms=6)
    for name, marker in zip(listed["mode"].values.tolist(), MARKERS, strict=True):
        axes.plot([], [], marker, color="0.3", mfc="none", label=name)
    axes.axhline(0.0, color="0.3", lw=0.8)
    sizes = np.abs(listed["mode_growth"].values)
    smallest = sizes[sizes > NOTHING].min(initial=1.0)
    axes.set_yscale("symlog", linthresh=10.0 ** np.floor(np.log10(smallest)))
    axes.margins(0.08)
    axes.set(xlabel="frequency, rotor's frame (Hz)", ylabel="growth (1/s), negative: dies out", title="Small motions")
    axes.legend(ncols=2, loc="center left")
    return figure


SHOWN = {
    "equilibria": ("depth", "lateral_offset", "polar_angle", "growth"),
    "flight": ("levitated", "height_spread"),
    "field": ("size", "B_error"),
}
"""Quantities drawn for each question, those of the motion in the laboratory."""


def drawable(result: xr.Dataset) -> bool:
    """Whether there is a figure for so many parameters."""
    return len(_varied(result)) <= 2


@styled
def question_figure(result: xr.Dataset) -> Figure:
    """Curves over one parameter or maps over two."""
    shown = _derived(result)
    names, varied = _shown(shown), _varied(result)
    figure, axes = panels(-(-len(names) // 2), 2, (8.4, 3.6 * -(-len(names) // 2)))
    for panel, name in zip(axes.ravel(), names, strict=True):
        if len(varied) == 1:
            _curves(panel, shown, name, varied[0])
        else:
            _map(panel, shown, name, varied)
    return figure


def _shown(result: xr.Dataset) -> list[str]:
    """Names of what is drawn of a result; one of an older version has less."""
    return [name for name in SHOWN[str(result.attrs["ask"])] if name in result]


def _derived(result: xr.Dataset) -> xr.Dataset:
    """The result with what is drawn instead of what is kept."""
    if "position" in result:
        depth = (-1e3 * result["position"].sel(axis="z")).assign_attrs(units="mm", long_name="levitation distance")
        result = result.assign(depth=depth)
    if "lateral_offset" in result:
        aside = (1e3 * result["lateral_offset"]).assign_attrs(units="mm", long_name="lateral offset")
        angle = result["polar_angle"].assign_attrs(long_name="polar angle")
        result = result.assign(lateral_offset=aside, polar_angle=angle)
    if "B" in result:
        size = 1e3 * (result["B"] ** 2).sum("axis", skipna=False) ** 0.5
        return result.assign(size=size.assign_attrs(units="mT", long_name="|B|"))
    return result


def _curves(axes: Axes, result: xr.Dataset, name: str, key: str) -> None:
    values, x = result[name], result[key].values
    if "equilibrium" not in values.dims:
        axes.plot(x, values.values, "o-", ms=3)
    else:
        for stable, fill in ((1, PALETTE[0]), (0, "white")):
            chosen = values.where(result["stable"] == stable).transpose(key, "equilibrium").values
            axes.plot([], [], "o", color=PALETTE[0], mfc=fill, ms=4, label="stable" if stable else "unstable")
            axes.plot(x, chosen, "o", color=PALETTE[0], mfc=fill, ms=4)
        axes.legend()
    axes.set(xlabel=key, ylabel=_label(values))
    if name == "growth":
        axes.set_yscale("symlog", linthresh=1e-3)


def _map(axes: Axes, result: xr.Dataset, name: str, keys: list[str]) -> None:
    values = result[name]
    if "equilibrium" in values.dims:  # the first is stable wherever any is
        values = values.where(result["stable"] == 1).isel(equilibrium=0).assign_attrs(values.attrs)
        axes.set_title("stable equilibrium nearest to the rotor")
    drawn = axes.pcolormesh(
        result[keys[1]].values, result[keys[0]].values, values.transpose(*keys).values, shading="nearest"
    )
    axes.set(xlabel=keys[1], ylabel=keys[0])
    if axes.figure is not None:
        axes.figure.colorbar(drawn, ax=axes, label=_label(values))


def _label(values: xr.DataArray) -> str:
    return f"{values.attrs['long_name']} ({values.attrs['units']})"


def _varied(result: xr.Dataset) -> list[str]:
    return [str(key) for key in np.atleast_1d(result.attrs["varied"])]


def question_lines(result: xr.Dataset) -> list[str]:
    """What was found, in a few lines."""
    varied, ask = _varied(result), str(result.attrs["ask"])
    grid = " × ".join(f"{key} ({result.sizes[key]})" for key in varied)
    lines = [f"Asked for {ask} over {grid}."]
    shown = _derived(result)
    if "stable" in shown:
        some = (shown["stable"] == 1).any("equilibrium")
        lines.append(f"A stable equilibrium at {int(some.sum())} of {some.size} points.")
        shown = shown.where(shown["stable"] == 1)
    if "unknown" in result and (result["unknown"] > 0).any():
        lines.append(f"At {int((result['unknown'] > 0).sum())} points not all equilibria could be computed.")
    for name in _shown(shown):
        values = shown[name].values[np.isfinite(shown[name].values)]
        if len(values):
            what = f"{shown[name].attrs['long_name']}{' where stable' if 'stable' in shown else ''}"
            units = {"1": ""}.get(shown[name].attrs["units"], shown[name].attrs["units"])
            lines.append(f"{what}: {values.min():.6g} to {values.max():.6g} {units}".rstrip())
    return lines
