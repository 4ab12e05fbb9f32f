"""The plots of a page: the map, the floater from the side, and the running plots of the flight."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, LinearColorMapper, PointDrawTool, Range1d
from bokeh.plotting import figure

from ...geometry.scenes import Scene
from ..live import Control, Regions
from .bodies import BALL, MAGNET, NORTH, outlines

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
