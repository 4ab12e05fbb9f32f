"""A 3-D picture of rotor, floater, field and path, rendered off screen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkLogger

from ..fem.table import FieldTable
from ..geometry.atomic import replacing
from ..geometry.box import Array, Box
from ..geometry.scene import Scene

MILLI = 1e-3
NORTH = "#D55E00"
METAL = "#9AA5B1"


def scene_picture(scene: Scene, table: FieldTable, floater: Array, moment: Array, path: Array, file: Path) -> None:
    """Write a PNG of the scene.

    Parameters
    ----------
    scene, table : what is drawn, and the field in it
    floater, moment : (3,) position (m) and moment direction of the floater, rotor's frame
    path : (n, 3) positions of the flight, m
    file : a PNG
    """
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # that there is no screen is no news here
    plotter = pv.Plotter(off_screen=True, window_size=(1400, 1100), lighting="three lights")
    plotter.set_background("white")
    for magnet in scene.rotor:
        plotter.add_mesh(_box(magnet.box), color="#4C566A", show_edges=True, opacity=0.95)
        _arrow(plotter, magnet.box.center / MILLI, magnet.polarization_in_rotor, magnet.box.circumradius / MILLI)
    if scene.plate:
        plotter.add_mesh(_box(scene.plate.box), color=METAL, opacity=0.25, show_edges=True)
    radius = scene.floater.radius / MILLI
    sphere = pv.Sphere(radius=radius, center=floater / MILLI, theta_resolution=60, phi_resolution=60)
    plotter.add_mesh(sphere, color=METAL, specular=0.6, opacity=0.6)
    _arrow(plotter, floater / MILLI, moment, radius)
    depth = float(-floater[2]) / MILLI
    _field(plotter, table, depth, radius)
    if len(path) > 1:
        plotter.add_mesh(pv.MultipleLines(path / MILLI), color="#0072B2", line_width=2)
    # Look from the side where no plate stands in the way.
    side = -1.0 if scene.plate and scene.plate.box.center[0] > 0 else 1.0
    plotter.camera_position = [(side * (depth + 20), -2.2 * depth - 60, 0.6 * depth), (0, 0, -0.6 * depth), (0, 0, 1)]
    plotter.add_axes()
    with replacing(file) as temporary:
        plotter.screenshot(temporary)
    plotter.close()


def _box(box: Box) -> pv.DataSet:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = box.rotation, box.center / MILLI
    x, y, z = box.size / MILLI
    return pv.Cube(x_length=x, y_length=y, z_length=z).transform(pose, inplace=False)


def _arrow(plotter: pv.Plotter, center: Array, direction: Array, radius: float) -> None:
    """An arrow of two radii through `center`; none where there is no direction."""
    length = float(np.linalg.norm(direction))
    if length:
        unit = np.asarray(direction) / length
        arrow = pv.Arrow(
            start=center - 1.5 * radius * unit, direction=unit, scale=3.0 * radius, shaft_radius=0.03, tip_radius=0.09
        )
        plotter.add_mesh(arrow, color=NORTH)


def _field(plotter: pv.Plotter, table: FieldTable, depth: float, radius: float) -> None:
    """|B| on the plane y = 0 below the rotor, and field lines in it."""
    width = max(1.2 * depth, 30.0)
    grid = pv.ImageData(dimensions=(81, 3, 81), spacing=(2 * width / 80, 0.5, 1.6 * depth / 80))
    grid.origin = (-width, -0.5, -1.6 * depth - 2)
    field = np.zeros((grid.n_points, 3))
    known = table.in_range(np.asarray(grid.points) * MILLI)
    field[known] = table.evaluate(np.asarray(grid.points)[known] * MILLI)[0]
    grid["B"] = field
    grid["|B| (mT)"] = np.where(known, 1e3 * np.linalg.norm(field, axis=1), np.nan)
    plane = grid.slice(normal="y", origin=(0, 0, 0))
    bar = {"title": "|B| (mT)", "color": "black", "fmt": "%.3g"}
    plotter.add_mesh(
        plane, scalars="|B| (mT)", log_scale=True, cmap="viridis", opacity=0.55, nan_opacity=0.0, scalar_bar_args=bar
    )
    seeds = [(x, 0.0, -depth * (0.5 + 0.25 * k)) for x in np.linspace(-width, width, 17) for k in range(3)]
    lines = grid.streamlines_from_source(pv.PolyData(np.array(seeds)), vectors="B", max_length=4 * width)
    if lines.n_points:
        plotter.add_mesh(lines, color="black", line_width=1)
