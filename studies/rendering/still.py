"""A 3-D picture of rotor, floater, field and path, rendered off screen."""

import io

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkLogger

from ...geometry.basics import Array, Box
from ...geometry.scenes import Scene
from .view import Currents, FieldPlane, View

MILLI = 1e-3
NORTH = "#D55E00"
METAL = "#9AA5B1"


def scene_picture(view: View) -> bytes:
    """A PNG of rotor, floater, plate, field and path, seen in the rotor's frame."""
    plotter = new_plotter()
    add_rotor(plotter, view.scene)
    add_plate(plotter, view.scene, view.currents)
    add_floater(plotter, view.scene, view.position, view.moment)
    depth = float(-view.position[2]) / MILLI
    if view.plane is not None:
        _field(plotter, view.plane)
    if len(view.path) > 1:
        plotter.add_mesh(pv.MultipleLines(view.path / MILLI), color="#0072B2", line_width=2)
    look(plotter, view.scene, depth)
    return _png(plotter)


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
        actors.append(plotter.add_mesh(_box(magnet.box), color="#4C566A", show_edges=True, opacity=0.95))
        center, radius = magnet.box.center / MILLI, magnet.box.circumradius / MILLI
        actors += _arrow(plotter, center, magnet.polarization_in_rotor, radius)
    return actors


def add_floater(plotter: pv.Plotter, scene: Scene, position: Array, moment: Array) -> list[pv.Actor]:
    """Draw the sphere and its moment; positions m."""
    radius, center = scene.floater.radius / MILLI, position / MILLI
    sphere = pv.Sphere(radius=radius, center=center, theta_resolution=60, phi_resolution=60)
    drawn = plotter.add_mesh(sphere, color=METAL, specular=0.6, opacity=0.6)
    return [drawn, *_arrow(plotter, center, moment, radius)]


def add_plate(plotter: pv.Plotter, scene: Scene, currents: Currents | None = None) -> None:
    """Draw the plate, with its currents where they are given."""
    if scene.plate is None:
        return
    plotter.add_mesh(_box(scene.plate.box), color=METAL, opacity=0.25, show_edges=True)
    if currents is not None:
        _add_currents(plotter, currents)


def _add_currents(plotter: pv.Plotter, currents: Currents) -> None:
    """Arrows of the current density; the longest is 12 mm."""
    current = 1e-6 * currents.density
    cloud = pv.PolyData(currents.points / MILLI)
    cloud["J"], cloud["|J| (A/mm²)"] = current, np.linalg.norm(current, axis=1)
    longest = float(cloud["|J| (A/mm²)"].max()) or 1.0
    arrows = cloud.glyph(orient="J", scale="|J| (A/mm²)", factor=12.0 / longest, geom=pv.Arrow())
    place = {"position_x": 0.9, "position_y": 0.3, "height": 0.5}
    bar = {"title": "J (A/mm²)", "color": "black", "fmt": "%.2g", "vertical": True, **place}
    plotter.add_mesh(arrows, scalars="|J| (A/mm²)", cmap="magma_r", scalar_bar_args=bar)


def look(plotter: pv.Plotter, scene: Scene, depth: float) -> None:
    """Look from the side where no plate stands in the way; `depth` of the floater, mm."""
    side = -1.0 if scene.plate and scene.plate.box.center[0] > 0 else 1.0
    plotter.camera_position = [(side * (depth + 20), -2.2 * depth - 60, 0.6 * depth), (0, 0, -0.6 * depth), (0, 0, 1)]
    plotter.add_axes()


def _box(box: Box) -> pv.DataSet:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = box.rotation, box.center / MILLI
    x, y, z = box.size / MILLI
    return pv.Cube(x_length=x, y_length=y, z_length=z).transform(pose, inplace=False)


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


def _field(plotter: pv.Plotter, shown: FieldPlane) -> None:
    """|B| on the plane y = 0 below the rotor, and field lines in it."""
    width, depth = shown.width, shown.depth
    grid = pv.ImageData(dimensions=(81, 3, 81), spacing=(2 * width / 80, 0.5, 1.6 * depth / 80))
    grid.origin = (-width, -0.5, -1.6 * depth - 2)
    grid["B"] = np.nan_to_num(shown.field)
    grid["|B| (mT)"] = 1e3 * np.linalg.norm(shown.field, axis=1)
    plane = grid.slice(normal="y", origin=(0, 0, 0))
    bar = {"title": "|B| (mT)", "color": "black", "fmt": "%.3g"}
    plotter.add_mesh(
        plane, scalars="|B| (mT)", log_scale=True, cmap="viridis", opacity=0.55, nan_opacity=0.0, scalar_bar_args=bar
    )
    seeds = [(x, 0.0, -depth * (0.5 + 0.25 * k)) for x in np.linspace(-width, width, 17) for k in range(3)]
    lines = grid.streamlines_from_source(pv.PolyData(np.array(seeds)), vectors="B", max_length=4 * width)
    if lines.n_points:
        plotter.add_mesh(lines, color="black", line_width=1)
