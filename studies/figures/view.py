"""What is shown in three dimensions: numbers only, which go to the process that draws them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.shapes import Box

FINE = 161
"""Points of a plane of the field along each of its edges."""
TURNS, FRAMES = 3, 16
"""Turns of the rotor that an animation shows at once, and frames for each."""


@dataclass(frozen=True, eq=False)
class FieldPlane:
    """B at the points of a thin grid about the plane y = 0 around the rotor.

    Parameters
    ----------
    width, depth : of the view, mm: the grid reaches from -width to width, and from 1.6 depth below the rotor's origin
        to 0.8 depth above it
    field : (n, 3) T, x running fastest; NaN inside the magnets
    """

    width: float
    depth: float
    field: Array

    @staticmethod
    def points(width: float, depth: float) -> Array:
        """The points of the grid, (n, 3) mm."""
        axes = (
            np.linspace(-1.6 * depth, 0.8 * depth, FINE),
            np.array([-0.5, 0.0, 0.5]),
            np.linspace(-width, width, FINE),
        )
        z, y, x = np.meshgrid(*axes, indexing="ij")
        return np.stack([x, y, z], axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Currents:
    """Current density (n, 3) A/m² at points (n, 3) m, laboratory frame."""

    points: Array
    density: Array


@dataclass(frozen=True, eq=False)
class View:
    """A scene at one instant, at which the rotor's axes are the laboratory's.

    Parameters
    ----------
    position, moment : of the floater, (3,) m, and the direction (3,) of its moment
    path : (n, 3) positions of the flight, m, in `frame`
    plane : the field; None for none
    currents : in the plate; None for none
    frame : of the path; "laboratory" where the floater does not turn with the rotor
    """

    scene: Scene
    position: Array
    moment: Array
    path: Array
    plane: FieldPlane | None = None
    currents: Currents | None = None
    frame: str = "rotor's frame"

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """A PNG."""
        from .still import scene_picture

        return scene_picture(self)


@dataclass(frozen=True, eq=False)
class Turnable:
    """A view that a page lets its reader turn."""

    view: View

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """The scene of a `page`."""
        from .turnable import turnable_scene

        return turnable_scene(self.view)


@dataclass(frozen=True, eq=False)
class Frames:
    """A flight in the laboratory frame, frame by frame.

    Parameters
    ----------
    time : (n,) s
    position, moment : of the floater (n, 3), laboratory frame, m
    """

    scene: Scene
    time: Array
    position: Array
    moment: Array

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """A GIF."""
        from .still import flight_animation

        return flight_animation(self, progress)


@dataclass(frozen=True)
class Sample:
    """A sphere on 64 × 64 pixels: tells whether anything can be drawn at all."""

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """A PNG."""
        from .still import sample_picture

        return sample_picture()


def current_places(box: Box, floater: Array) -> Array:
    """Places (n, 3) m just under that face of a plate which the floater (3,) m is before."""
    axes = [np.linspace(-0.48, 0.48, max(3, int(size * 1e3 / 5))) * size for size in box.size]
    normal = int(np.argmin(box.size))
    side = np.sign(box.to_body(floater[None])[0, normal]) or 1.0
    axes[normal] = np.array([0.49 * side * box.size[normal]])
    body = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    return np.asarray(box.center + body @ box.rotation.T)


def frame_times(scene: Scene, duration: float) -> Array:
    """Instants of the frames, s: three turns at the flight's beginning, its middle and its end."""
    shown = TURNS / scene.frequency if scene.frequency else duration
    steps = np.arange(TURNS * FRAMES) / (TURNS * FRAMES) * min(shown, duration)
    begins = [0.0, (duration - shown) / 2, duration - shown] if duration > 3 * shown else [0.0]
    return np.concatenate([begin + steps for begin in begins])


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


NAME = "field B (mT)"
LINES = 36
"""Field lines in the picture."""


def add_field(plotter: pv.Plotter, shown: FieldPlane, scene: Scene) -> None:
    """|B| on the plane y = 0 about the rotor, and field lines in it."""
    grid = _grid(shown)
    size = 1e3 * np.linalg.norm(shown.field, axis=1)
    grid[NAME] = size
    decades = np.floor(np.log10(np.nanpercentile(size, 0.1))), np.ceil(np.log10(np.nanpercentile(size, 99)))
    bar: dict[str, Any] = {
        "title": NAME,
        "color": "black",
        "fmt": "%.0f" if decades[0] >= 0 else "%g",
        "vertical": True,
    }
    bar |= {"n_labels": int(decades[1] - decades[0]) + 1, "position_x": 0.9, "position_y": 0.3, "height": 0.4}
    bar |= {"title_font_size": 24, "label_font_size": 22}
    look_of_it: dict[str, Any] = {"log_scale": True, "cmap": "viridis", "opacity": 0.6, "nan_opacity": 0.0}
    plane = grid.slice(normal="y", origin=(0, 0, 0))
    plotter.add_mesh(plane, scalars=NAME, clim=[10**d for d in decades], scalar_bar_args=bar, **look_of_it)
    lines = _lines(grid, shown.width, scene, 0.5)
    if lines.n_points:
        plotter.add_mesh(lines.tube(radius=0.004 * shown.width), color="#2E3440")


def add_lines(plotter: pv.Plotter, shown: FieldPlane, scene: Scene, step: float) -> None:
    """The field lines alone, thin, with steps of at most so many mm."""
    lines = _lines(_grid(shown), shown.width, scene, step)
    if lines.n_points:
        plotter.add_mesh(lines, color="#2E3440", line_width=1)


def _grid(shown: FieldPlane) -> pv.ImageData:
    width, depth = shown.width, shown.depth
    grid = pv.ImageData(dimensions=(FINE, 3, FINE), spacing=(2 * width / (FINE - 1), 0.5, 2.4 * depth / (FINE - 1)))
    grid.origin = (-width, -0.5, -1.6 * depth)
    grid["B"] = np.nan_to_num(shown.field)
    return grid


def _lines(grid: pv.ImageData, width: float, scene: Scene, step: float) -> pv.PolyData:
    seeds = pv.PolyData(_seeds(grid, scene))
    how: dict[str, Any] = {"vectors": "B", "max_length": 20 * width, "initial_step_length": 0.2}
    how |= {"max_step_length": step, "step_unit": "l", "max_steps": 5000, "integration_direction": "both"}
    return grid.streamlines_from_source(seeds, **how)


def _seeds(grid: pv.ImageData, scene: Scene) -> Array:
    """Places (LINES, 3) mm around the magnets where field lines start; between neighbours is equal flux."""
    corners = np.concatenate([corners_mm(magnet.box) for magnet in scene.rotor])
    middle = corners.mean(axis=0) * (1, 0, 1)
    radius = 1.02 * np.linalg.norm((corners - middle)[:, [0, 2]], axis=1).max()
    angles = np.linspace(-np.pi, np.pi, 721)
    outwards = np.column_stack([np.cos(angles), np.zeros(721), np.sin(angles)])
    circle = pv.PolyData(middle + radius * outwards).sample(grid)
    flux = np.cumsum(np.abs(np.einsum("nk,nk->n", circle["B"], outwards)))
    shares = (np.arange(LINES) + 0.5) / LINES * flux[-1]
    chosen = np.searchsorted(flux, shares)
    return np.asarray(middle + radius * outwards[chosen])
