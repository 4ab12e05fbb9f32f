"""The field on a plane, in colours and lines."""

from typing import Any

import numpy as np
import pyvista as pv

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from .marks import corners_mm
from .view import FINE, FieldPlane

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
