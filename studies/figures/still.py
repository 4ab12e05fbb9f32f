"""A 3-D picture of rotor, floater, field and path, rendered off screen."""

import io
from collections.abc import Callable
from typing import Any

import imageio
import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkLogger

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.shapes import Box, Ring, Sphere, rotation_matrix
from ...geometry.solids import Part, Solid
from .view import MILLI, Currents, Frames, View, add_field, add_path, add_turning, beside_the_rotor, corners_mm

NORTH = "#D55E00"
METAL = "#9AA5B1"
ROUND = 72
"""Facets of a circle."""


def scene_picture(view: View) -> bytes:
    """A PNG of rotor, floater, plate, field and path, seen in the rotor's frame."""
    plotter = new_plotter()
    draw_view(plotter, view)
    return _png(plotter)


def draw_view(plotter: pv.Plotter, view: View) -> None:
    """Draw rotor, floater, plate, field and path, with their names."""
    scene, center = view.scene, view.position / MILLI
    times = draw_bodies(plotter, view)
    if view.plane is not None:
        add_field(plotter, view.plane, scene)
    radius = scene.floater.radius / MILLI
    beside = center + np.array([1.2 * radius, 0.0, 0.0])
    names = {"floater": beside, f"rotor, {scene.frequency:g} Hz": beside_the_rotor(scene)}
    if scene.plate is not None:
        corners = corners_mm(scene.plate.box)
        names["plate"] = corners[corners[:, 1].argsort()[:4]].mean(axis=0)
    if times:
        names[f"path × {times:g}, {view.frame}"] = beside - np.array([0.0, 0.0, 0.8 * radius])
    labels = {"font_size": 22, "text_color": "black", "shape_color": "white", "shape_opacity": 0.7, "margin": 4}
    plotter.add_point_labels(
        np.array(list(names.values())), list(names), show_points=False, always_visible=True, **labels
    )
    look(plotter, scene, -float(center[2]))


def draw_bodies(plotter: pv.Plotter, view: View) -> float:
    """Draw rotor, floater, plate and path; returns how many times the path is enlarged, 0 for none."""
    scene = view.scene
    add_rotor(plotter, scene)
    add_plate(plotter, scene, view.currents)
    add_floater(plotter, scene, view.position, view.moment)
    if scene.frequency:
        add_turning(plotter, scene)
    return add_path(plotter, view.path / MILLI, scene.floater.radius / MILLI) if len(view.path) > 1 else 0.0


def sample_picture() -> bytes:
    """A PNG of a sphere."""
    plotter = new_plotter((64, 64))
    plotter.add_mesh(pv.Sphere())
    return _png(plotter)


def _png(plotter: pv.Plotter) -> bytes:
    file = io.BytesIO()
    plotter.screenshot(file)
    plotter.close()
    return file.getvalue()


def new_plotter(size: tuple[int, int] = (1400, 1100)) -> pv.Plotter:
    """An empty picture without a window."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # that there is no screen is no news here
    plotter = pv.Plotter(off_screen=True, window_size=size, lighting="three lights")
    plotter.set_background("white")
    return plotter


def add_rotor(plotter: pv.Plotter, scene: Scene) -> list[pv.Actor]:
    """Draw the magnets with their polarisation; returns the actors, which turn together."""
    actors = []
    for magnet in scene.rotor:
        actors.append(plotter.add_mesh(_surface(magnet.body), color="#4C566A", show_edges=isinstance(magnet.body, Box)))
        center, radius = magnet.body.center / MILLI, magnet.body.circumradius / MILLI
        actors += _arrow(plotter, center, magnet.polarization_in_rotor, radius)
    return actors


def add_floater(plotter: pv.Plotter, scene: Scene, position: Array, moment: Array) -> list[pv.Actor]:
    """Draw the floater's body and its moment; positions m."""
    radius, center = scene.floater.radius / MILLI, position / MILLI
    surface = pv.Sphere(radius=radius, center=center, theta_resolution=60, phi_resolution=60)
    if scene.floater.body is not None:
        surface = _surface(scene.floater.placed(position, moment / np.linalg.norm(moment)))
    drawn = plotter.add_mesh(surface, color=METAL, specular=0.6, opacity=0.45)
    return [drawn, *_arrow(plotter, center, moment, radius)]


def add_plate(plotter: pv.Plotter, scene: Scene, currents: Currents | None = None) -> None:
    """Draw the plate, with its currents where they are given."""
    if scene.plate is None:
        return
    box = _box(scene.plate.box)
    plotter.add_mesh(box, color=METAL, opacity=0.2)
    plotter.add_mesh(box.extract_feature_edges(), color="#4C566A", line_width=3)
    if currents is not None:
        _add_currents(plotter, currents)


def _add_currents(plotter: pv.Plotter, currents: Currents) -> None:
    """Arrows of the current density; the longest is 12 mm."""
    current = 1e-6 * currents.density
    cloud = pv.PolyData(currents.points / MILLI)
    cloud["J"], cloud["|J| (A/mm²)"] = current, np.linalg.norm(current, axis=1)
    longest = float(cloud["|J| (A/mm²)"].max()) or 1.0
    arrows = cloud.glyph(orient="J", scale="|J| (A/mm²)", factor=12.0 / longest, geom=pv.Arrow())
    place = {"position_x": 0.04, "position_y": 0.3, "height": 0.4}  # the field's is on the right
    look_of_it = {"title_font_size": 24, "label_font_size": 22}
    bar = {"title": "J (A/mm²)", "color": "black", "fmt": "%.2g", "vertical": True, **place, **look_of_it}
    plotter.add_mesh(arrows, scalars="|J| (A/mm²)", cmap="magma_r", scalar_bar_args=bar)


def look(plotter: pv.Plotter, scene: Scene, depth: float) -> None:
    """Look from the front, a little from above and from the side where no plate stands in the way, at everything.

    `depth` of the floater below the rotor, mm.
    """
    away, right, upwards = axes_of_view(scene, 0.15)
    seen = np.array([(s * 1.6 * depth, 0, z) for s in (-1, 1) for z in (-1.6 * depth, 0.8 * depth)])
    if scene.plate is not None:
        seen = np.concatenate([seen, corners_mm(scene.plate.box)])
    across, up = seen @ right, seen @ upwards
    across = np.append(across, across.max() + 0.16 * np.ptp(across))  # room for the scale of colours
    middle = right * (across.max() + across.min()) / 2 + upwards * (up.max() + up.min()) / 2
    wide, high = plotter.window_size
    plotter.enable_parallel_projection()
    plotter.camera_position = [middle + 1e3 * away, middle, (0, 0, 1)]
    plotter.camera.parallel_scale = 0.54 * max(np.ptp(up), np.ptp(across) * high / wide)
    plotter.camera.clipping_range = (1.0, 5e3)
    plotter.add_axes()


def axes_of_view(scene: Scene, height: float) -> tuple[Array, Array, Array]:
    """Unit vectors (3,) to the camera, to the right and upwards, as of `look`; `height` of the camera over its way."""
    side = -1.0 if scene.plate and scene.plate.box.center[0] > 0 else 1.0
    away = np.array([side * 0.14, -1.0, height])
    away /= np.linalg.norm(away)
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    return away, right, np.cross(away, right)


def _box(box: Box) -> pv.DataSet:
    x, y, z = box.size / MILLI
    return _posed(pv.Cube(x_length=x, y_length=y, z_length=z), box)


def _surface(body: Solid) -> pv.DataSet:
    """A body's surface, mm."""
    if isinstance(body, Box):
        return _box(body)
    if isinstance(body, Part):
        corners = body.triangles.reshape(-1, 3) / MILLI
        faces = np.arange(len(corners)).reshape(-1, 3)
        return _posed(pv.PolyData.from_regular_faces(corners, faces), body)
    radius = body.radius / MILLI
    if isinstance(body, Sphere):
        return _posed(pv.Sphere(radius=radius, theta_resolution=ROUND, phi_resolution=ROUND), body)
    height = body.height / MILLI
    if isinstance(body, Ring):
        inner = body.inner_radius / MILLI
        disc = pv.Disc(center=(0, 0, -height / 2), inner=inner, outer=radius, c_res=ROUND)
        return _posed(disc.extrude((0, 0, height), capping=True), body)
    return _posed(pv.Cylinder(direction=(0, 0, 1), radius=radius, height=height, resolution=ROUND), body)


def _posed(mesh: pv.DataSet, body: Solid) -> pv.DataSet:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = body.rotation, body.center / MILLI
    return mesh.transform(pose, inplace=False)


def _arrow(plotter: pv.Plotter, center: Array, direction: Array, radius: float) -> list[pv.Actor]:
    """An arrow of three radii through `center`; none where there is no direction."""
    length = float(np.linalg.norm(direction))
    if not length:
        return []
    unit = np.asarray(direction) / length
    arrow = pv.Arrow(
        start=center - 1.5 * radius * unit, direction=unit, scale=3.0 * radius, shaft_radius=0.03, tip_radius=0.09
    )
    return [plotter.add_mesh(arrow, color=NORTH)]


PER_SECOND = 12


def flight_animation(frames: Frames, progress: Callable[[float], None]) -> bytes:
    """A GIF of the frames, one after the other."""
    plotter, file = new_plotter((800, 640)), io.BytesIO()
    magnets = add_rotor(plotter, frames.scene)
    add_plate(plotter, frames.scene)
    look(plotter, frames.scene, float(-frames.position[:, 2].max()) * 1e3)
    floater: list[pv.Actor] = []
    gif: Any = imageio.get_writer(file, format="GIF", mode="I", loop=0, duration=1000 / PER_SECOND)
    with gif:
        for number, instant in enumerate(frames.time):
            turn = rotation_matrix((0.0, 0.0, np.degrees(frames.scene.angular_velocity * instant)))
            for actor in magnets:
                actor.user_matrix = _pose(turn)
            for actor in floater:
                plotter.remove_actor(actor, render=False)
            floater = add_floater(plotter, frames.scene, frames.position[number], frames.moment[number])
            plotter.add_text(f"t = {instant:.4f} s", color="black", font_size=10, name="time")
            gif.append_data(plotter.screenshot(return_img=True))
            progress((number + 1) / len(frames.time))
    plotter.close()
    return file.getvalue()


def _pose(turn: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = turn
    return pose
