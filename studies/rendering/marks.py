"""What explains a picture: the path, the sense of rotation, and places for names."""

import numpy as np
import pyvista as pv

from ...geometry.basics import Array, Box
from ...geometry.scenes import Scene

MILLI = 1e-3


def corners_mm(box: Box) -> Array:
    """(8, 3) mm."""
    return np.asarray(box.corners / MILLI)


def beside_the_rotor(scene: Scene) -> Array:
    """A place for the rotor's name, mm."""
    corners = np.concatenate([corners_mm(magnet.box) for magnet in scene.rotor])
    return np.array([corners[:, 0].max() + 3.0, 0.0, corners[:, 2].max()])


def add_path(plotter: pv.Plotter, path: Array, radius: float) -> float:
    """The path (n, 3) mm about its middle, enlarged until it can be seen inside the floater; by how much."""
    middle = (path.max(axis=0) + path.min(axis=0)) / 2
    reach = float(np.abs(path - middle).max())
    steps = [times for k in range(7) for times in (10.0**k, 2 * 10.0**k, 5 * 10.0**k)]
    times = max([1.0, *(t for t in steps if t * reach <= 0.8 * radius)])
    shown = middle + times * (path - middle)[:: max(1, len(path) // 20000)]
    plotter.add_mesh(pv.MultipleLines(shown), color="#0072B2", line_width=2, opacity=0.8)
    return times


def add_turning(plotter: pv.Plotter, scene: Scene) -> None:
    """An arrow above the rotor in the sense in which it turns."""
    corners = np.concatenate([corners_mm(magnet.box) for magnet in scene.rotor])
    height, radius = float(corners[:, 2].max()) + 3.0, float(np.linalg.norm(corners[:, :2], axis=1).max())
    angles = np.radians(np.linspace(-200, 60, 60))
    arc = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(60, height)])
    plotter.add_mesh(pv.MultipleLines(arc).tube(radius=0.45), color="black")
    tip = pv.Cone(center=arc[-1], direction=arc[-1] - arc[-3], height=4.0, radius=1.6, resolution=30)
    plotter.add_mesh(tip, color="black")
    plotter.add_mesh(pv.Line((0, 0, height - 2), (0, 0, height + 5)).tube(radius=0.15), color="black")
