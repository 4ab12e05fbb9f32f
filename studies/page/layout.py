"""The widgets and plots of a page, and how they show what they are given."""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.events import PanEnd, PanStart
from bokeh.models import (
    Button,
    Column,
    ColumnDataSource,
    CustomJS,
    Div,
    FileInput,
    Model,
    RadioButtonGroup,
    Select,
    Slider,
    Spinner,
)

from .plots import ROLLING, MapPlot, RunningPlot, SideView
from .processes import Crew
from .state import Control, PageState, Shown
from .work import Frame, fly

SPEEDS = (1.0, 0.1, 0.01, 0.001)
FIELDS = [
    ("dipole", "Field: point dipole"),
    ("cuboid", "Field: closed form (μr = 1)"),
    ("fem", "Field: finite elements"),
]
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


class Layout:
    """All that a page shows; `roots` go into its template by their names."""

    def __init__(self) -> None:
        self.message = Div(name="message", visible=False, stylesheets=[MESSAGE], **WIDE)
        self.headline = Div(name="headline", stylesheets=[HEADLINE], **WIDE)
        self.sign = Div(name="sign", **WIDE)
        self.table = Div(name="table", stylesheets=[TABLES], **WIDE)
        self.modes = Div(name="modes", stylesheets=[TABLES], **WIDE)
        self.model = Select(name="model", **WIDE)
        self.plate_model = Select(name="plate_model", options=PLATES, **WIDE)
        self.file = FileInput(accept=".toml", name="file", **WIDE)
        self.sliders = Column(**WIDE)
        self.map, self.side = MapPlot(), SideView()
        self.map_says = Div(name="map_says", **WIDE)
        self.samples = ColumnDataSource({"time": [], "height": [], "tilt": []}, name="samples")
        self.height = RunningPlot(self.samples, "height", "Height (mm)")
        self.tilt = RunningPlot(self.samples, "tilt", "Tilt (°)")
        self.play = Button(label="Play", button_type="primary", name="play", width=90)
        self.again = Button(label="Reset", name="again", width=80)
        self.up = Button(label="Kick up", name="up", width=90)
        self.aside = Button(label="Kick aside", name="aside", width=100)
        self.strength = Spinner(value=20, low=1, high=1000, step=1, width=90, name="strength", title="Kick (mm/s)")
        self.speed = RadioButtonGroup(labels=["real time", "1/10", "1/100", "1/1000"], active=0, name="speed")
        self.says = Div(name="says", **WIDE)
        labels = {"toml": "Scene", "json": "Result (JSON)", "nc": "Result (netCDF)", "png": "Figure"}
        self.downloads = {kind: Button(label=label, name=f"get_{kind}") for kind, label in labels.items()}
        self._outside = {name: _outside(name) for name in ("bodies", "pose", "address", "file")}

    @property
    def drawn(self) -> Div:
        """Its text changes when a pose has been drawn."""
        return self._outside["pose"]

    @property
    def ready(self) -> CustomJS:
        """Tells the page's own program what was said before it could hear."""
        each = "const [name, line] of Object.entries(lines)"
        code = f"for ({each}) if (line.tags.length) window.spinlev[name](line.tags[0], line)"
        return CustomJS(args={"lines": dict(self._outside)}, code=code)

    @property
    def roots(self) -> list[Model]:
        """What the template places, by name."""
        buttons = [self.play, self.again, self.up, self.aside, self.strength, *self.downloads.values()]
        choices = Column(children=[self.sliders, self.model, self.plate_model, self.file], name="controls", **WIDE)
        flight = [self.speed, self.says, self.side.figure, self.height.figure, self.tilt.figure]
        shown = [self.message, self.headline, self.sign, self.table, self.modes, self.map_says, self.map.figure]
        return [*shown, choices, *flight, *buttons, *self._outside.values()]

    def show_controls(self, state: PageState, sliders: Sequence[Slider]) -> None:
        """The sliders and models of a scene."""
        self.sliders.children = list(sliders)
        known = [("map", "Field: its map")] if state.scene.field_map else []
        self.model.options = [
            *FIELDS,
            *known,
            *([("auto", "Field: chosen by accuracy")] if state.model == "auto" else []),
        ]
        self.model.value, self.plate_model.value = state.model, state.plate_model
        self.plate_model.visible = state.scene.plate is not None

    def set_sliders(self, values: Mapping[str, float]) -> None:
        """Move the sliders with these keys."""
        for moved in self.sliders.children:
            if moved.name in values:
                moved.value = values[str(moved.name)]

    def say(self, text: str) -> None:
        """A message to the reader; nothing where all is well."""
        self.message.text, self.message.visible = html.escape(text), bool(text)

    def numbers(self, found: Shown, number: int, waits: str) -> None:
        """The headline, the equilibria and the eigenvalues of the first."""
        self.headline.text = html.escape(found.headline)
        carried = "" if found.complete else "; carried here from a scene nearby"
        self.sign.text = f'<span data-number="{number}">By: {html.escape(found.sign + carried + waits)}.</span>'
        left_out = "".join(f"<p>{html.escape(line)}</p>" for line in found.left_out)
        self.table.text, self.modes.text = _table(found.rows) + left_out, _table(found.modes)

    def map_title(self, text: str) -> None:
        """Which map it is."""
        self.map_says.text = html.escape(text)

    def flight_says(self, text: str) -> None:
        """How the flight goes."""
        self.says.text = html.escape(text)

    def point(self, found: Sequence[Control]) -> None:
        """Mark the present point in the map."""
        if len(found) > 1:
            self.map.point.data = {"x": [found[0].value], "y": [found[1].value]}

    def bodies(self, drawn: Mapping[str, Any]) -> None:
        """Draw a scene in three dimensions."""
        self._outside["bodies"].tags = [json.dumps(drawn)]

    def pose(self, moved: Mapping[str, Any]) -> None:
        """Move rotor and floater."""
        self._outside["pose"].tags = [json.dumps(moved)]

    def address(self, query: str) -> None:
        """Let the browser's address hold the state."""
        self._outside["address"].tags = [query]

    def give(self, name: str, kind: str, content: str) -> None:
        """A file for the reader; its content in base 64."""
        self._outside["file"].tags = [json.dumps({"name": name, "kind": kind, "content": content})]


def slider(control: Control) -> Slider:
    """The slider of a control."""
    return Slider(
        start=control.low,
        end=control.high,
        step=control.step,
        value=control.value,
        title=control.title,
        name=control.key,
        format="0[.]00",
        **WIDE,
    )


def _outside(name: str) -> Div:
    """A line to the page's own program, page.js."""
    line = Div(name=f"to_{name}", visible=False)
    line.js_on_change("tags", CustomJS(code=f"window.spinlev.{name}(cb_obj.tags[0], cb_obj)"))
    return line


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(text)}</th>" for text in rows[0])
    body = "".join(f"<tr>{''.join(f'<td>{html.escape(text)}</td>' for text in row)}</tr>" for row in rows[1:])
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


Place = list[float]


class FlightPanel:
    """Play, pause, slow motion, kicks, and a floater that can be dragged.

    Parameters
    ----------
    layout, crew : of the page
    state : gives the page's state
    pose : draws position mm, moment, angle of the rotor, and position in the rotor's frame
    rest : draws the floater where it would hang
    """

    def __init__(
        self,
        layout: Layout,
        crew: Crew,
        state: Callable[[], PageState],
        pose: Callable[[Place, Place, float, Place], None],
        rest: Callable[[], None],
    ) -> None:
        self.layout, self.crew, self.state, self.pose, self.rest = layout, crew, state, pose, rest
        self.playing, self.held, self.ended = False, False, False
        layout.side.figure.on_event(PanStart, lambda _: self._hold())
        layout.side.figure.on_event(PanEnd, lambda _: self._release())
        layout.drawn.on_change("text", lambda _, old, new: crew.tell(fly, ("drawn",)))
        layout.play.on_click(self._play)
        layout.again.on_click(self.land)
        layout.speed.on_change("active", lambda _, old, new: self._set_speed())
        layout.up.on_click(lambda: self._push([0.0, 0.0, 1.0]))
        layout.aside.on_click(lambda: self._push([1.0, 0.0, 0.0]))

    def _play(self) -> None:
        if self.ended:
            self.land()
        if self.playing:
            self._tell(("pause",))
            self._playing(False)
        else:
            self._playing(True)
            self._tell(("play", self._speed))

    @property
    def _speed(self) -> float:
        return SPEEDS[int(self.layout.speed.active or 0)]

    def _set_speed(self) -> None:
        if self.playing:
            self._tell(("play", self._speed))

    def _playing(self, yes: bool) -> None:
        self.playing = yes
        self.layout.play.label = "Pause" if yes else "Play"

    def _push(self, way: list[float]) -> None:
        self._tell(("push", [1e-3 * float(self.layout.strength.value or 0.0) * part for part in way]))

    def _hold(self) -> None:
        self.held = True
        self.crew.tell(fly, ("pause",))

    def _release(self) -> None:
        """Let the floater go where it was dragged to."""
        self.held, self.ended = False, False
        x, z = (float(self.layout.side.floater.data[key][0]) for key in "xz")
        self._tell(("put", [1e-3 * x, 0.0, 1e-3 * z]))
        self._playing(True)
        self._tell(("play", self._speed))

    def _tell(self, wish: tuple[Any, ...]) -> None:
        """A wish to the flight, which begins with the first."""
        if fly not in self.crew:
            self.layout.flight_says("Preparing the flight ...")
            self.crew.start(fly, (self.state(),), self._flown)
            self.layout.samples.data = {"time": [], "height": [], "tilt": []}
        self.crew.tell(fly, wish)

    def land(self) -> None:
        """Forget the flight."""
        self.crew.stop(fly)
        self.ended = False
        self._playing(False)
        self.layout.flight_says("")
        self.rest()

    def _flown(self, frame: Frame | str) -> None:
        self.crew.rest(fly)
        if isinstance(frame, str):
            self.land()
            self.layout.flight_says(frame)
            return
        samples = {"time": frame.time, "height": frame.height, "tilt": frame.tilt}
        self.layout.samples.stream({key: np.asarray(values) for key, values in samples.items()}, rollover=ROLLING)
        self.pose(frame.position, frame.moment, frame.angle, frame.seen)
        self.layout.flight_says(frame.message or frame.ended or f"t = {frame.time[-1]:.4g} s")
        if frame.ended:
            self.ended = True
            self._playing(False)
