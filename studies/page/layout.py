"""The widgets and plots of a page, and how they show what they are given; lengths in mm."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from typing import Any

import bokeh.models as bk
import numpy as np
from bokeh.plotting import figure

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..figures.view import SQUARES, Surface, arrow, near_plate, triangles
from .state import Control, PageState
from .work import MODEL_WORDS, Regions, Shown

PLATES = [
    ("none", "Plate: only an obstacle"),
    ("slab", "Plate: infinite slab"),
    ("auto", "Plate: as the accuracy needs it"),
    ("reduced", "Plate: finite, as a network"),
]
TABLES = """
table { border-collapse: collapse; font-size: 12px; width: 100%; }
th, td { padding: 2px 6px 2px 0; white-space: nowrap; text-align: right; border-bottom: 1px solid #e5e9f0; }
th { font-weight: 600; color: #4c566a; }
th:first-child, td:first-child, td:last-child { text-align: left; }
td:nth-child(7) { white-space: normal; min-width: 6em; }
"""
MESSAGE = "div { color: #8f1d1d; background: #fbe9e7; padding: 6px 10px; border-radius: 4px; white-space: pre-wrap; }"
HEADLINE = "div { font-size: 16px; font-weight: 600; }"
WIDE: dict[str, Any] = {"sizing_mode": "stretch_width"}
PLOT: dict[str, Any] = {"tools": "", "toolbar_location": None}
MAGNET, METAL, NORTH, BALL = "#434C5E", "#B08D57", "#D55E00", "#9AA5B1"
REGION_COLORS = ("#FFFFFF", "#D8DEE9", "#56B4E9")
"""Where nothing levitates, only unstably, and stably."""
LOW, HIGH, SIDE, TALL = -60.0, 15.0, 34.0, 300
"""What the side view shows: heights, and to both sides; and its height in pixels."""
SEEN = 0.06  # How far along its edges a plate is drawn, m
NO_IMAGE: dict[str, list[Any]] = {"image": [], "x": [], "y": [], "dw": [], "dh": []}


class Layout:
    """All that a page shows; `roots` go into its template by their names."""

    def __init__(self) -> None:
        self.message = bk.Div(name="message", visible=False, stylesheets=[MESSAGE], **WIDE)
        self.headline = bk.Div(name="headline", stylesheets=[HEADLINE], **WIDE)
        self.sign, self.map_says, self.says = (bk.Div(name=name, **WIDE) for name in ("sign", "map_says", "says"))
        self.table, self.modes = (bk.Div(name=name, stylesheets=[TABLES], **WIDE) for name in ("table", "modes"))
        self.model = bk.Select(name="model", **WIDE)
        self.plate_model = bk.Select(name="plate_model", options=PLATES, **WIDE)
        self.file = bk.FileInput(accept=".toml", name="file", **WIDE)
        self.sliders = bk.Column(**WIDE)
        self.play = bk.Button(label="Play", button_type="primary", name="play", width=90)
        self.again = bk.Button(label="Reset", name="again", width=80)
        self.up = bk.Button(label="Kick up", name="up", width=90)
        self.aside = bk.Button(label="Kick aside", name="aside", width=100)
        self.strength = bk.Spinner(value=20, low=1, high=1000, step=1, width=90, name="strength", title="Kick (mm/s)")
        self.speed = bk.RadioButtonGroup(labels=["real time", "1/10", "1/100", "1/1000"], active=0, name="speed")
        labels = {"toml": "Scene", "json": "Result (JSON)", "nc": "Result (netCDF)", "png": "Figure"}
        self.downloads = {kind: bk.Button(label=label, name=f"get_{kind}") for kind, label in labels.items()}
        # Lines to the page's own program, page.js; the text of `pose` changes when a pose has been drawn.
        lines = ("bodies", "pose", "address", "file")
        self.program = {name: bk.Div(name=f"to_{name}", visible=False) for name in lines}
        for name, line in self.program.items():
            line.js_on_change("tags", bk.CustomJS(code=f"window.spinlev.{name}(cb_obj.tags[0], cb_obj)"))

        self.regions = bk.ColumnDataSource(NO_IMAGE, name="regions")
        self.point = bk.ColumnDataSource({"x": [], "y": []}, name="point")
        self.map = figure(height=300, name="map", x_axis_label="Frequency (Hz)", **PLOT, **WIDE)
        self.map.x_range, self.map.y_range = bk.Range1d(0, 1), bk.Range1d(0, 1)
        mapper = bk.LinearColorMapper(palette=REGION_COLORS, low=-0.5, high=2.5)
        self.map.image("image", "x", "y", "dw", "dh", source=self.regions, color_mapper=mapper)
        self.map.scatter("x", "y", source=self.point, size=12, color=NORTH, line_color="white")
        self.map.grid.visible = False

        self.floater = bk.ColumnDataSource({"x": [], "z": [], "r": []}, name="floater")
        self.bodies, self.equilibria = (bk.ColumnDataSource({"x": [], "z": []}) for _ in range(2))
        size = {"frame_width": int(TALL * 2 * SIDE / (HIGH - LOW)), "frame_height": TALL}
        self.side = figure(name="side", x_axis_label="x (mm)", y_axis_label="z (mm)", **PLOT, **size)
        self.side.x_range, self.side.y_range = bk.Range1d(-SIDE, SIDE), bk.Range1d(LOW, HIGH)
        self.side.patches("x", "z", source=self.bodies, color=MAGNET, alpha=0.8)
        self.side.scatter("x", "z", source=self.equilibria, marker="x", size=9, color="#2E3440", line_width=2)
        ball = self.side.circle("x", "z", radius="r", source=self.floater, color=BALL, alpha=0.6, line_color=NORTH)
        drag = bk.PointDrawTool(renderers=[ball], add=False)
        self.side.add_tools(drag)
        self.side.toolbar.active_tap = drag

        self.samples = bk.ColumnDataSource({"time": [], "height": [], "tilt": []}, name="samples")
        self.running = []
        for key, label in (("height", "Height (mm)"), ("tilt", "Tilt (°)")):
            plot = figure(height=170, name=key, x_axis_label="Time (s)", y_axis_label=label, **PLOT, **WIDE)
            plot.line("time", key, source=self.samples, color="#0072B2", line_width=1.5)
            plot.y_range.min_interval = 0.02
            self.running.append(plot)

    @property
    def roots(self) -> list[bk.Model]:
        """What the template places, by name."""
        buttons = [self.play, self.again, self.up, self.aside, self.strength, *self.downloads.values()]
        choices = bk.Column(children=[self.sliders, self.model, self.plate_model, self.file], name="controls", **WIDE)
        shown = [self.message, self.headline, self.sign, self.table, self.modes, self.map_says, self.map, choices]
        return [*shown, self.speed, self.says, self.side, *self.running, *buttons, *self.program.values()]

    @property
    def ready(self) -> bk.CustomJS:
        """Tells the page's own program what was said before it could hear."""
        each = "const [name, line] of Object.entries(lines)"
        code = f"for ({each}) if (line.tags.length) window.spinlev[name](line.tags[0], line)"
        return bk.CustomJS(args={"lines": dict(self.program)}, code=code)

    def show_controls(self, state: PageState, sliders: Sequence[bk.Slider]) -> None:
        """The sliders and models of a scene."""
        self.sliders.children = list(sliders)
        names = ["dipole", "cuboid", "fem", *(["map"] if state.scene.field_map else [])]
        names += [state.model] if state.model not in names else []
        self.model.options = [(name, f"Field: {MODEL_WORDS.get(name, 'chosen by accuracy')}") for name in names]
        self.model.value, self.plate_model.value = state.model, state.plate_model
        self.plate_model.visible = state.scene.plate is not None

    def say(self, text: str) -> None:
        """A message to the reader; nothing where all is well."""
        self.message.text, self.message.visible = html.escape(text), bool(text)

    def numbers(self, found: Shown, number: int, waits: str) -> None:
        """The headline, the equilibria and the eigenvalues of the first, as the answer of this number."""
        self.headline.text = html.escape(found.headline)
        sign = f"Preview: {found.sign}. {waits}" if waits else f"By: {found.sign}."
        self.sign.text = f'<span data-number="{number}">{html.escape(sign)}</span>'
        left_out = "".join(f"<p>{html.escape(line)}</p>" for line in found.left_out)
        self.table.text, self.modes.text = _table(found.rows) + left_out, _table(found.modes)

    def show_regions(self, found: Regions) -> None:
        """Draw a map."""
        x, y = found.frequencies, found.measures
        dx, dy = float(x[1] - x[0]), float(y[1] - y[0])  # pixels are about the values
        place = {"x": [x[0] - dx / 2], "y": [y[0] - dy / 2], "dw": [dx * len(x)], "dh": [dy * len(y)]}
        self.regions.data = {"image": [found.kind.T], **place}

    def map_axes(self, frequency: Control, measure: Control) -> None:
        """Take over what the sliders reach."""
        self.map.x_range.update(start=frequency.start, end=frequency.end)
        self.map.y_range.update(start=measure.start, end=measure.end)
        self.map.yaxis.axis_label = measure.title

    def place(self, x: float, z: float, radius: float) -> None:
        """Put the floater into the side view."""
        self.floater.data = {"x": [x], "z": [z], "r": [radius]}
        low = min(LOW, z - 2 * radius)
        if self.side.y_range.start != low:
            side = SIDE * (HIGH - low) / (HIGH - LOW)  # of one scale with the height
            self.side.y_range.start = low
            self.side.x_range.update(start=-side, end=side)

    def draw(self, scene: Scene, lines: Sequence[Array]) -> None:
        """A scene from the side, and in three dimensions with these field lines, m."""
        from scipy.spatial import ConvexHull  # slow to load

        flat = [1e3 * triangles(body)[0][:, [0, 2]] for body in scene.turning_bodies]
        hulls = [shape[ConvexHull(shape).vertices] for shape in flat]
        self.bodies.data = {"x": [hull[:, 0].tolist() for hull in hulls], "z": [hull[:, 1].tolist() for hull in hulls]}
        self.tell("bodies", scene_bodies(scene, lines))

    def tell(self, name: str, what: Any) -> None:
        """Something for the page's own program."""
        self.program[name].tags = [json.dumps(what)]


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(text)}</th>" for text in rows[0])
    body = "".join(f"<tr>{''.join(f'<td>{html.escape(text)}</td>' for text in row)}</tr>" for row in rows[1:])
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def scene_bodies(scene: Scene, lines: Sequence[Array]) -> dict[str, Any]:
    """What page.js draws: what turns with the rotor, what stands still, and the floater about its centre, moment up.

    `reach`: half the width of the picture, its lowest and its highest point.
    """
    size = max(float(np.linalg.norm(magnet.box.size)) for magnet in scene.rotor)
    turning = [_mesh(triangles(magnet.body), MAGNET) for magnet in scene.rotor]
    turning += [_mesh(triangles(conductor.body), METAL) for conductor in scene.conductors]
    for magnet in scene.rotor:
        direction = magnet.polarization_in_rotor
        if (length := np.linalg.norm(direction)) > 0:
            turning.append(_mesh(arrow(magnet.box.center, direction / length, 0.55 * size), NORTH))
    up = arrow(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.45 * scene.floater.radius)
    fixed, edges = [], []
    if scene.plate is not None:
        near = near_plate(scene.plate.box, SEEN)
        fixed = [_mesh(triangles(near), BALL, 0.25)]
        edges = np.round(1e3 * near.corners[np.column_stack([SQUARES, SQUARES[:, 0]])], 3).tolist()
    return {
        "turning": turning,
        "floater": [_mesh(triangles(scene.floater.solid), BALL), _mesh(up, NORTH)],
        "fixed": fixed,
        "edges": edges,
        "lines": [np.round(1e3 * line, 2).tolist() for line in lines],
        "reach": [30.0, -50.0, 16.0] if scene.plate is None else [40.0, -64.0, 16.0],
    }


def _mesh(surface: Surface, color: str, opacity: float = 1.0) -> dict[str, Any]:
    corners, faces = surface
    return {"at": np.round(1e3 * corners, 3).tolist(), "faces": faces.tolist(), "color": color, "opacity": opacity}
