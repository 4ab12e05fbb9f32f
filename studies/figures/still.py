"""What VTK draws: a scene as a picture, a trajectory as an animation, and a scene that a page lets its reader turn.

Lengths are mm here. Only the process that draws loads this module.
"""

import io
import json
import zipfile
from collections.abc import Iterator
from itertools import product
from typing import Any

import imageio
import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkLogger

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.shapes import Box, rotation_matrix
from ...geometry.solids import Solids
from .view import FINE, SEEN, Currents, Frames, View, arrow, near_plate, triangles, unit

NORTH, METAL, DARK = "#D55E00", "#9AA5B1", "#4C566A"
PER_SECOND = 12
FIELD, CURRENT = "B (mT)", "J (A/mm²)"  # VTK takes | for borders of cells
BAR: dict[str, Any] = {"color": "black", "vertical": True, "position_y": 0.3, "height": 0.4}
BAR |= {"title_font_size": 24, "label_font_size": 22}
NAME: dict[str, Any] = {"font_size": 22, "text_color": "black", "shape_color": "white", "shape_opacity": 0.7}
NAME |= {"margin": 4, "show_points": False, "always_visible": True}
SHORTEST = 0.1  # Of the floater's radius: a shorter path is a dot
MARGIN = 0.92  # Part of the window's height that what is shown fills


def scene_picture(view: View) -> bytes:
    """A PNG of rotor, floater, plate, field and path, with their names, seen in the rotor's frame."""
    plotter, scene, center = new_plotter(), view.scene, 1e3 * view.position
    path = _add_bodies(plotter, view)
    if view.plane is not None:
        _add_field(plotter, view)
    radius = 1e3 * scene.floater.radius
    beside = center + np.array([1.2 * radius, 0.0, 0.0])
    rotor, size = _rotor_corners(scene), unit(scene)
    names = {
        "floater": beside,
        f"rotor, {scene.frequency:g} Hz": [rotor[:, 0].max() + 3.0 * size, 0.0, rotor[:, 2].max()],
    }
    if scene.plate is not None:
        near = near_plate(scene.plate.body, SEEN * unit(scene))
        corners = 1e3 * near.corners
        whole = np.allclose(near.size, scene.plate.body.size)
        names["plate" if whole else "part of the plate"] = corners[corners[:, 1].argsort()[:4]].mean(axis=0)
    if path:
        names[f"path, {view.frame}"] = beside - np.array([0.0, 0.0, 0.8 * radius])
    if scene.frequency:
        names["axis of rotation"] = [size, 0.0, rotor[:, 2].max() + 8.0 * size]
    plotter.add_point_labels(np.array(list(names.values())), list(names), **NAME)
    _look(plotter, scene)
    plotter.add_axes()
    return _png(plotter)


def sample_picture() -> bytes:
    plotter = new_plotter((64, 64))
    plotter.add_mesh(pv.Sphere())
    return _png(plotter)


def flight_animation(frames: Frames) -> Iterator[float | bytes]:
    """The finished part after each frame, and last a GIF of them, one after the other."""
    plotter, file = new_plotter((800, 640)), io.BytesIO()
    magnets = _add_rotor(plotter, frames.scene)
    add_plate(plotter, frames.scene)
    floater: list[pv.Actor] = []
    gif: Any = imageio.get_writer(file, format="GIF", mode="I", loop=0, duration=1000 / PER_SECOND)
    with gif:
        for number, instant in enumerate(frames.time):
            pose = np.eye(4)
            pose[:3, :3] = rotation_matrix((0.0, 0.0, float(np.degrees(frames.scene.angle(instant)))))
            for actor in magnets:
                actor.user_matrix = pose
            for actor in floater:
                plotter.remove_actor(actor, render=False)
            axes = None if frames.axes is None else frames.axes[number]
            floater = add_floater(plotter, frames.scene, frames.position[number], frames.moment[number], axes)
            if not number:
                _look(plotter, frames.scene)
            plotter.add_text(f"t = {instant:.4f} s", color="black", font_size=10, name="time")
            gif.append_data(plotter.screenshot(return_img=True))
            yield (number + 1) / len(frames.time)
    plotter.close()
    yield file.getvalue()


def turnable_scene(view: View) -> bytes:
    """Bodies, path and field lines of a view as the viewer of trame-vtk takes them, without names."""
    # PyVista's own `export_html` gives the same file, but starts a web server to make it
    from trame_vtk.modules.vtk import serializers

    plotter = new_plotter((900, 700))
    _add_bodies(plotter, view)
    if view.lines:
        plotter.add_mesh(_polylines(view.lines), color="#2E3440", line_width=1)
    _look(plotter, view.scene)
    plotter.render()
    serializers.initialize_serializers()
    context, window = serializers.SynchronizationContext(), plotter.render_window
    camera = plotter.renderer.GetActiveCamera()
    state = serializers.serialize(None, window, serializers.reference_id(window), context, 1)
    own, its = serializers.reference_id(window), serializers.reference_id(camera)
    state["extra"] = {"vtkRefId": own, "centerOfRotation": camera.GetFocalPoint(), "camera": its}
    arrays = {
        entry["hash"]: {**entry, "content": context.get_cached_data_array(entry["hash"], False)}
        for entry in serializers.extract_array_hash(state)
    }
    plotter.close()
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("index.json", json.dumps({"scene": state, "hashes": arrays}))
    return file.getvalue()


def new_plotter(size: tuple[int, int] = (1400, 1100)) -> pv.Plotter:
    """A plotter without a screen, on white, of a `size` in pixels, width and height."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # that there is no screen is no news here
    plotter = pv.Plotter(off_screen=True, window_size=size, lighting="three lights")
    plotter.set_background("white")
    return plotter


def add_floater(
    plotter: pv.Plotter, scene: Scene, position: Array, moment: Array, axes: Array | None = None
) -> list[pv.Actor]:
    """Draw the floater of a `scene` at a `position` (3,) m with its `moment` on a `plotter`; returns the actors.

    The columns of `axes` (3, 3) are the body's; None: those that the moment gives, which may be zero.
    """
    drawn, direction = [], moment / (np.linalg.norm(moment) or 1.0)
    for part in scene.floater.placed(position, direction if axes is None else axes):
        drawn += _add_body(plotter, part, METAL, opacity=0.45, specular=0.6)
    return [*drawn, *_add_arrow(plotter, 1e3 * position, moment, 1e3 * scene.floater.radius)]


def add_plate(plotter: pv.Plotter, scene: Scene, currents: Currents | None = None) -> None:
    """Draw the part of the plate near the rotor, if there is one, with its `currents`: the longest arrow is 12 mm."""
    if scene.plate is None:
        return
    _add_body(plotter, near_plate(scene.plate.body, SEEN * unit(scene)), METAL, opacity=0.2)
    if currents is not None:
        cloud = pv.PolyData(1e3 * currents.points)
        cloud["J"], cloud[CURRENT] = 1e-6 * currents.density, 1e-6 * np.linalg.norm(currents.density, axis=1)
        longest = float(cloud[CURRENT].max()) or 1.0
        arrows = cloud.glyph(orient="J", scale=CURRENT, factor=12.0 / longest, geom=pv.Arrow())
        bar = {**BAR, "title": f"{CURRENT}\n ", "fmt": "%.2g", "position_x": 0.04}  # the field's is on the right
        plotter.add_mesh(arrows, scalars=CURRENT, cmap="magma_r", scalar_bar_args=bar)


def _png(plotter: pv.Plotter) -> bytes:
    file = io.BytesIO()
    plotter.screenshot(file)
    plotter.close()
    return file.getvalue()


def _add_bodies(plotter: pv.Plotter, view: View) -> bool:
    """Draw rotor, floater, plate and path; returns whether the path is long enough to be seen."""
    scene, path = view.scene, 1e3 * view.path
    _add_rotor(plotter, scene)
    add_plate(plotter, scene, view.currents)
    add_floater(plotter, scene, view.position, view.moment, view.axes)
    if scene.frequency:
        _add_turning(plotter, scene, -1.5e3 * float(view.position[2]))
    seen = len(path) > 1 and float(np.ptp(path, axis=0).max()) > SHORTEST * 1e3 * scene.floater.radius
    if seen:
        plotter.add_mesh(pv.MultipleLines(path[:: max(1, len(path) // 20000)]), color="#0072B2", line_width=2)
    return seen


def _add_rotor(plotter: pv.Plotter, scene: Scene) -> list[pv.Actor]:
    actors = []
    for magnet in scene.rotor:
        actors += _add_body(plotter, magnet.body, DARK)
        center, radius = 1e3 * magnet.body.center, 1e3 * magnet.body.circumradius
        actors += _add_arrow(plotter, center, magnet.polarization_in_rotor, radius)
    return actors


def _add_turning(plotter: pv.Plotter, scene: Scene, depth: float) -> None:
    """The axis, and above the rotor an arrow in the sense in which it turns: in front of the field's plane."""
    corners, size = _rotor_corners(scene), unit(scene)
    height, radius = float(corners[:, 2].max()) + 3.0 * size, float(np.linalg.norm(corners[:, :2], axis=1).max())
    angles = np.radians(np.linspace(-185, -25, 60))
    arc = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(60, height)])
    plotter.add_mesh(pv.MultipleLines(arc).tube(radius=0.45 * size), color="black")
    tip = pv.Cone(center=arc[-1], direction=arc[-1] - arc[-3], height=4.0 * size, radius=1.6 * size, resolution=30)
    plotter.add_mesh(tip, color="black")
    plotter.add_mesh(pv.Line((0, 0, -depth), (0, 0, height + 5 * size)).tube(radius=0.12 * size), color="black")


def _add_field(plotter: pv.Plotter, view: View) -> None:
    """|B| on the plane y = 0 about the rotor, field lines, and how long 10 mm, or what is round of the scene, are."""
    plane = view.plane
    assert plane is not None
    size = 1e3 * np.linalg.norm(plane.field, axis=1)
    width, depth = plane.width, plane.depth
    grid = pv.ImageData(dimensions=(FINE, 1, FINE), spacing=(2 * width / (FINE - 1), 1.0, 2.4 * depth / (FINE - 1)))
    grid.origin = (-width, 0.0, -1.6 * depth)
    grid[FIELD] = np.nan_to_num(size, nan=np.nanmax(size))  # inside the magnets it is not seen, up to them it is
    low, high = np.floor(np.log10(np.nanpercentile(size, 0.1))), np.ceil(np.log10(np.nanpercentile(size, 99)))
    bar = {**BAR, "title": f"{FIELD}\n ", "fmt": "%.0f" if low >= 0 else "%g", "position_x": 0.9}
    bar["n_labels"] = int(high - low) + 1
    look: dict[str, Any] = {"log_scale": True, "cmap": "viridis", "opacity": 0.6}
    plotter.add_mesh(grid, scalars=FIELD, clim=[10**low, 10**high], scalar_bar_args=bar, lighting=False, **look)
    shown = plotter.scalar_bars[bar["title"]]
    table = pv.LookupTable()  # as the half transparent plane is seen on white
    table.DeepCopy(shown.GetLookupTable())
    for k in range(table.GetNumberOfTableValues()):
        table.SetTableValue(k, *(1 - look["opacity"] * (1 - c) for c in table.GetTableValue(k)[:3]), 1.0)
    shown.SetLookupTable(table)
    if view.lines:
        plotter.add_mesh(_polylines(view.lines).tube(radius=0.004 * width), color="#2E3440")
    mm = unit(view.scene)
    ends = np.array([(-width, 0.0, 0.8 * depth + 2 * mm), (10 * mm - width, 0.0, 0.8 * depth + 2 * mm)])
    plotter.add_mesh(pv.Line(*ends).tube(radius=0.3 * mm), color="black")
    plotter.add_point_labels(ends[1:] + mm, [f"{10 * mm:g} mm"], **NAME)


def _polylines(lines: Any) -> pv.PolyData:
    ends = np.cumsum([len(line) for line in lines])
    numbers = [np.r_[len(line), end - len(line) : end] for line, end in zip(lines, ends, strict=True)]
    return pv.PolyData(1e3 * np.concatenate(lines), lines=np.concatenate(numbers))


def _rotor_corners(scene: Scene) -> Array:
    return np.concatenate([1e3 * magnet.box.corners for magnet in scene.rotor])


def _look(plotter: pv.Plotter, scene: Scene) -> None:
    """Look from the front and from the side where no plate stands in the way, so near that a square just shows it all.

    From a little above, a finite distance and with VTK's usual angle of view: the viewer of a scene to turn knows no
    other. A corner at (x, z) across and towards the camera at (c, d) is within the half angle of tangent t if
    |x - c| <= t (d - z); two corners decide c and d, and the same holds upwards.
    """
    side = -1.0 if scene.plate and scene.plate.box.center[0] > 0 else 1.0
    away = np.array([side * 0.2, -1.0, 0.4])
    away /= np.linalg.norm(away)
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    boxes = [actor.bounds for actor in plotter.renderer.actors.values() if isinstance(actor, pv.Actor)]
    corners = np.array([corner for b in boxes for corner in product(b[:2], b[2:4], b[4:])])
    slope = MARGIN * np.tan(np.radians(plotter.camera.view_angle) / 2)
    middle, distance = np.zeros(3), 0.0
    for axis in (right, np.cross(away, right)):
        more, less = (float((corners @ (slope * away + sign * axis)).max()) for sign in (1, -1))
        middle += axis * (more - less) / 2
        distance = max(distance, (more + less) / 2 / slope)
    depth = float((corners @ away).mean())
    plotter.camera_position = [middle + distance * away, middle + depth * away, (0, 0, 1)]
    plotter.reset_camera_clipping_range()


def _add_body(plotter: pv.Plotter, body: Solids, color: str, **look: Any) -> list[pv.Actor]:
    corners, faces = triangles(body)
    mesh = pv.PolyData.from_regular_faces(1e3 * corners, faces)
    if isinstance(body, Box):
        edges = mesh.extract_feature_edges()
        return [plotter.add_mesh(mesh, color=color, **look), plotter.add_mesh(edges, color="#2E3440", line_width=3)]
    return [plotter.add_mesh(mesh.clean(), color=color, smooth_shading=True, split_sharp_edges=True, **look)]


def _add_arrow(plotter: pv.Plotter, center: Array, direction: Array, radius: float) -> list[pv.Actor]:
    if not (length := float(np.linalg.norm(direction))):
        return []
    corners, faces = arrow(center, direction / length, 1.5 * radius)
    return [plotter.add_mesh(pv.PolyData.from_regular_faces(corners, faces), color=NORTH)]
