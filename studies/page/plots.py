"""The bodies of a scene as triangles and lines for the picture that turns with the mouse; lengths in mm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, LinearColorMapper, PointDrawTool, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.shapes import Box, Ring, Sphere
from ...geometry.solids import Part, Solid
from .state import Control
from .work import Regions

MAGNET, METAL, NORTH, BALL = "#434C5E", "#B08D57", "#D55E00", "#9AA5B1"
SEEN = 0.06
"""How far from the rotor's origin a plate is drawn, along its edges, m."""
SIDES = 20
"""Of what is round."""
FACES = np.array(
    [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
     (1, 5, 7), (1, 7, 3)]
)  # fmt: skip
"""Triangles of a box whose corners are numbered by the signs of x, y and z, the last changing fastest."""
EDGES = ((0, 1), (1, 3), (3, 2), (2, 0), (4, 5), (5, 7), (7, 6), (6, 4), (0, 4), (1, 5), (2, 6), (3, 7))


def scene_bodies(scene: Scene, lines: Sequence[Array]) -> dict[str, Any]:
    """What is drawn: what turns with the rotor, what stands still, and the floater about its own centre, moment up."""
    size = max(float(np.linalg.norm(m.box.size)) for m in scene.rotor) * 1e3
    turning = [_solid(magnet.body, MAGNET, 1.0) for magnet in scene.rotor]
    turning += [_solid(conductor.body, METAL, 1.0) for conductor in scene.conductors]
    for magnet in scene.rotor:
        turning.append(_arrow(1e3 * magnet.box.center, magnet.polarization_in_rotor, 0.55 * size))
    radius = 1e3 * scene.floater.radius
    floater = [_solid(scene.floater.solid, BALL, 1.0), _arrow(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.45 * radius)]
    fixed, edges = [], []
    if scene.plate is not None:
        near = _near(scene.plate.box)
        fixed, edges = [_solid(near, BALL, 0.25)], _edges(near)
    return {
        "turning": turning,
        "floater": floater,
        "fixed": fixed,
        "edges": edges,
        "lines": [np.round(1e3 * line, 2).tolist() for line in lines],
        "reach": _reach(scene),
    }


def outlines(scene: Scene) -> tuple[list[list[float]], list[list[float]]]:
    """The turning bodies seen along y, as polygons in mm: their x and their z."""
    from scipy.spatial import ConvexHull  # slow to load

    shapes = []
    for body in scene.turning_bodies:
        flat = 1e3 * _box_corners(body)[:, [0, 2]]
        shapes.append(flat[ConvexHull(flat).vertices])
    return [shape[:, 0].tolist() for shape in shapes], [shape[:, 1].tolist() for shape in shapes]


def _near(plate: Box) -> Box:
    """The part of a plate that is in the picture."""
    middle = plate.to_body(np.zeros((1, 3)))[0]
    low, high = np.maximum(-plate.size / 2, middle - SEEN), np.minimum(plate.size / 2, middle + SEEN)
    if not (high > low).all():
        return plate
    return replace(plate, size=high - low, center=plate.center + plate.rotation @ ((low + high) / 2))


def _reach(scene: Scene) -> list[float]:
    """Half the width of the picture, its lowest and its highest point, mm."""
    return [30.0, -50.0, 16.0] if scene.plate is None else [40.0, -64.0, 16.0]


def _box_corners(body: Solid) -> Array:
    """Corners (8, 3) m of the box around a body, numbered as `FACES` and `EDGES` have it."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray(body.center + (signs * body.size / 2) @ body.rotation.T)


def _solid(body: Solid, color: str, opacity: float) -> dict[str, Any]:
    if isinstance(body, Box):
        return _mesh(1e3 * _box_corners(body), FACES, color, opacity)
    if isinstance(body, Sphere):
        return _mesh(1e3 * body.center + _ball_places(1e3 * body.radius), _quads(SIDES // 2 + 1), color, opacity)
    if isinstance(body, Part):
        corners = body.center + body.triangles.reshape(-1, 3) @ body.rotation.T
        return _mesh(1e3 * corners, np.arange(len(corners)).reshape(-1, 3), color, opacity)
    if isinstance(body, Ring):
        outer, inner, half = body.filled.radius, body.hole.radius, body.size[2] / 2
        profile = [(inner, -half), (outer, -half), (outer, half), (inner, half), (inner, -half)]
    else:
        outer, half = body.radius, body.size[2] / 2
        profile = [(0.0, -half), (outer, -half), (outer, half), (0.0, half)]
    places = _revolved(1e3 * np.array(profile), 1e3 * body.center, body.rotation[:, 2])
    return _mesh(places, _quads(len(profile)), color, opacity)


def _edges(box: Box) -> list[list[list[float]]]:
    corners = 1e3 * _box_corners(box)
    return [np.round(corners[list(edge)], 3).tolist() for edge in EDGES]


def _ball_places(radius: float) -> Array:
    polar = np.linspace(0, np.pi, SIDES // 2 + 1)
    return _revolved(radius * np.column_stack([np.sin(polar), np.cos(polar)]), np.zeros(3), np.array([0.0, 0.0, 1.0]))


def _arrow(center: Array, direction: Array, length: float) -> dict[str, Any]:
    """An arrow of revolution through a centre, both ways so long."""
    axis = direction / (np.linalg.norm(direction) or 1.0)
    profile = np.array([(0, -1), (0.09, -1), (0.09, 0.35), (0.28, 0.35), (0, 1)]) * length
    return _mesh(_revolved(profile, center, axis), _quads(len(profile)), NORTH, 1.0)


def _revolved(profile: Array, center: Array, axis: Array) -> Array:
    """Points of a surface of revolution, ring after ring; the profile (n, 2) has radius and height."""
    side = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    side /= np.linalg.norm(side) or 1.0
    angles = np.arange(SIDES) * (2 * np.pi / SIDES)
    ring = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), np.cross(axis, side))
    return np.concatenate([center + r * ring + h * axis for r, h in profile])


def _quads(rows: int) -> Array:
    """Triangles of a surface of revolution with so many rings of points."""
    k = np.arange(SIDES)
    following = (k + 1) % SIDES
    found = []
    for row in range(rows - 1):
        below, above = row * SIDES, (row + 1) * SIDES
        found += [(below + a, below + b, above + b) for a, b in zip(k, following, strict=True)]
        found += [(below + a, above + b, above + a) for a, b in zip(k, following, strict=True)]
    return np.array(found)


def _mesh(corners: Array, faces: Array | NDArray[np.intp], color: str, opacity: float) -> dict[str, Any]:
    return {"at": np.round(corners, 3).tolist(), "faces": faces.tolist(), "color": color, "opacity": opacity}


REGION_COLORS = ("#FFFFFF", "#D8DEE9", "#56B4E9")
"""Where nothing levitates, only unstably, and stably."""
ROLLING = 4000
"""Samples in a running plot."""
LOW, HIGH, SIDE = -60.0, 15.0, 34.0
"""What the side view shows: heights, and to both sides, mm."""
FRAME = 300
"""Height of the side view, pixels."""
LOOK: dict[str, Any] = {"toolbar_location": None, "sizing_mode": "stretch_width"}


class MapPlot:
    """Stable regions in frequency × displacement or tilt, with the present point."""

    def __init__(self) -> None:
        self.regions = ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []}, name="regions")
        self.point = ColumnDataSource({"x": [], "y": []}, name="point")
        plot = figure(height=300, tools="", name="map", x_axis_label="Frequency (Hz)", **LOOK)
        plot.x_range, plot.y_range = Range1d(0, 1), Range1d(0, 1)
        mapper = LinearColorMapper(palette=REGION_COLORS, low=-0.5, high=2.5)
        plot.image("image", "x", "y", "dw", "dh", source=self.regions, color_mapper=mapper)
        plot.scatter("x", "y", source=self.point, size=12, color=NORTH, line_color="white")
        plot.grid.visible = False
        self.figure = plot
        self.known: Regions | None = None

    def show(self, found: Regions) -> None:
        """Draw a map."""
        self.known = found
        (x, width), (y, height) = (_pixels(axis) for axis in (found.frequencies, found.measures))
        self.regions.data = {"image": [found.kind.T], "x": [x], "y": [y], "dw": [width], "dh": [height]}

    def forget(self) -> None:
        """Nothing is known of this scene."""
        self.known = None
        self.regions.data = {"image": [], "x": [], "y": [], "dw": [], "dh": []}

    def axes(self, frequency: Control, measure: Control) -> None:
        """Take over what the sliders reach."""
        self.figure.x_range.update(start=frequency.low, end=frequency.high)
        self.figure.y_range.update(start=measure.low, end=measure.high)
        self.figure.yaxis.axis_label = measure.title


class SideView:
    """The floater from the side, in the frame that turns with the rotor; it can be dragged."""

    def __init__(self) -> None:
        self.floater = ColumnDataSource({"x": [], "z": [], "r": []}, name="floater")
        self.bodies = ColumnDataSource({"x": [], "z": []})
        self.equilibria = ColumnDataSource({"x": [], "z": []})
        look = {"toolbar_location": None, "frame_width": int(FRAME * 2 * SIDE / (HIGH - LOW)), "frame_height": FRAME}
        plot = figure(tools="", name="side", x_axis_label="x (mm)", y_axis_label="z (mm)", **look)
        plot.x_range, plot.y_range = Range1d(-SIDE, SIDE), Range1d(LOW, HIGH)
        plot.patches("x", "z", source=self.bodies, color=MAGNET, alpha=0.8)
        plot.scatter("x", "z", source=self.equilibria, marker="x", size=9, color="#2E3440", line_width=2)
        ball = plot.circle("x", "z", radius="r", source=self.floater, color=BALL, alpha=0.6, line_color=NORTH)
        drag = PointDrawTool(renderers=[ball], add=False)
        plot.add_tools(drag)
        plot.toolbar.active_tap = drag
        self.figure = plot

    def scene(self, scene: Scene) -> None:
        """Draw the rotor, and look at where the floater may be."""
        xs, zs = outlines(scene)
        self.bodies.data = {"x": xs, "z": zs}

    def place(self, x: float, z: float, radius: float) -> None:
        """Put the floater; mm."""
        self.floater.data = {"x": [x], "z": [z], "r": [radius]}
        low = min(LOW, z - 2 * radius)
        if self.figure.y_range.start != low:
            side = SIDE * (HIGH - low) / (HIGH - LOW)  # of one scale with the height
            self.figure.y_range.start = low
            self.figure.x_range.update(start=-side, end=side)


class RunningPlot:
    """A quantity of the flight over time."""

    def __init__(self, samples: ColumnDataSource, key: str, label: str) -> None:
        plot = figure(height=170, tools="", name=key, x_axis_label="Time (s)", y_axis_label=label, **LOOK)
        plot.line("time", key, source=samples, color="#0072B2", line_width=1.5)
        plot.y_range.min_interval = 0.02
        self.figure = plot


def _pixels(axis: np.ndarray[Any, Any]) -> tuple[float, float]:
    """Where an image begins whose pixels are about the values of an axis, and its width."""
    step = float(axis[1] - axis[0])
    return float(axis[0]) - step / 2, step * len(axis)
