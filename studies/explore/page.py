"""One page in the browser: what its reader moves, what is computed for it, and what it shows."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np
from bokeh.document import Document
from bokeh.events import Tap
from bokeh.models import Slider

from ...geometry.basics import Array, InputError, SpinlevError
from ...geometry.scenes import parse_scene
from ..live import (
    FILES,
    TYPES,
    Control,
    Found,
    PageState,
    Regions,
    Screen,
    Shown,
    complete,
    controls,
    download,
    first_state,
    fly,
    follow,
    has_map,
    map_key,
    regions,
)
from .bodies import scene_bodies
from .flight_panel import FlightPanel
from .layout import Layout, slider
from .processes import Crew

REST = 250
"""Milliseconds after which a slider is taken to rest."""


class Page:
    """A page and its processes.

    Parameters
    ----------
    document : Bokeh's, of one browser page
    state : where it begins
    asked : the keys of its address
    """

    def __init__(self, document: Document, state: PageState, asked: Mapping[str, str]) -> None:
        self.document, self.state, self.layout = document, state, Layout()
        self.number, self.answered, self.shown = 0, 0, cast("Shown | None", None)
        self.crew = Crew(document, (follow, fly), self._failed)
        self.flight = FlightPanel(self.layout, self.crew, lambda: self.state, self._pose, self._rest_floater)
        self.resting: Any = None
        self.mapped, self.poses = "", 0
        self.drawn: tuple[str, str, tuple[Array, ...]] = ("", "", ())
        problem = ""
        try:
            self.state = state.with_query(asked)
        except SpinlevError as error:
            problem = str(error)
        self._listen()
        self._begin()
        self.layout.say(problem)
        with document.models.freeze():  # which models there are is found out once
            for root in self.layout.roots:
                document.add_root(root)
        document.js_on_event("document_ready", self.layout.ready)

    def close(self) -> None:
        """End all work."""
        self.crew.close()

    # What the reader does

    def _listen(self) -> None:
        layout = self.layout
        layout.model.on_change("value", lambda _, old, new: self._choose("model", new))
        layout.plate_model.on_change("value", lambda _, old, new: self._choose("plate_model", new))
        layout.file.on_change("value", self._opened)
        layout.map.figure.on_event(Tap, self._clicked)
        for kind, button in layout.downloads.items():
            button.on_click(partial(self._download, kind))

    def _begin(self) -> None:
        """Show a new scene: its sliders, and then all else."""
        found = controls(self.state)
        self.layout.show_controls(self.state, [self._slider(control) for control in found])
        if has_map(self.state):
            self.layout.map.axes(found[0], found[1])
        self._changed()

    def _slider(self, control: Control) -> Slider:
        made = slider(control)
        made.on_change("value", lambda _, old, new: self._moved(control.key, new))
        return made

    def _moved(self, key: str, value: float) -> None:
        value = round(float(value), 9)
        if (key, value) not in [(control.key, control.value) for control in controls(self.state)]:
            self._become(lambda state: state.changed(key, value))

    def _choose(self, name: str, value: str) -> None:
        if getattr(self.state, name) != value:
            change: dict[str, Any] = {name: value}
            self._become(lambda state: replace(state, **change))

    def _become(self, change: Callable[[PageState], PageState]) -> None:
        try:
            self.state = change(self.state)
        except SpinlevError as error:
            self.layout.say(str(error))
            return
        self.layout.say("")
        self._changed()

    def _opened(self, _: str, old: Any, content: Any) -> None:
        """A scene file of the reader's."""
        name = str(self.layout.file.filename) or "scene"
        try:
            scene = parse_scene(base64.b64decode(str(content)).decode(), name)
            if scene.field_map:
                raise InputError(
                    f"{name}: Input rotor.field_map must be left out of a scene that is opened in the page; instead "
                    f"received {scene.field_map}. Give the scene to the command line."
                )
        except SpinlevError as error:
            self.layout.say(str(error))
            return
        except (UnicodeDecodeError, binascii.Error):
            self.layout.say(f"{name}: Input scene must be a readable UTF-8 text; instead it is not.")
            return
        self.state = first_state(scene, name)
        self.layout.say("")
        self._begin()

    def _clicked(self, event: Tap) -> None:
        """Go to a point of the map, as far as the sliders reach."""
        if not has_map(self.state) or event.x is None or event.y is None:
            return
        found = controls(self.state)
        values = {
            control.key: _nearest(control, place) for control, place in zip(found, (event.x, event.y), strict=False)
        }

        def both(state: PageState) -> PageState:
            for key, value in values.items():
                state = state.changed(key, value)
            return state

        self._become(both)
        self.layout.set_sliders(values)

    # What is computed

    def _changed(self) -> None:
        """The state is another: answer at once, and completely when it rests."""
        self.number += 1
        self.crew.stop(complete)
        if fly in self.crew:
            self.flight.land()
        if follow not in self.crew:
            self.crew.start(follow, (), self._found)
        self.crew.tell(follow, (self.number, self._quick_state, None))
        self.layout.point(controls(self.state))
        if self.resting is not None:
            self.document.remove_timeout_callback(self.resting)
        self.resting = self.document.add_timeout_callback(self._rest, REST)

    @property
    def _quick_state(self) -> PageState:
        """What can be told at once: without the plate's currents, by the closed form where elements are asked for."""
        model = "cuboid" if self.state.model in ("fem", "auto") else self.state.model
        return replace(self.state, model=cast("Any", model), plate_model="none")

    def _rest(self) -> None:
        self.resting = None
        self.layout.address(self.state.query())
        self.crew.start(complete, (self.number, self.state), self._completed)
        spans = [(control.low, control.high) for control in controls(self.state)[:2]]
        if not has_map(self.state):
            self.crew.stop(regions)
            self.layout.map_title("No map: it needs a horizontal, vertical or tilted rotor and gravity along the axis.")
            self.layout.map.forget()
        elif (key := map_key(self.state)) != self.mapped:
            self.mapped = key
            self.layout.map_title("Map: being computed ...")
            self.layout.map.forget()
            self.crew.start(regions, (self.state, tuple(spans)), self._mapped)

    def _found(self, found: Found) -> None:
        """Numbers at once."""
        if found.number <= self.answered:
            return
        waits = "" if self.state.whole_quickly else "; those asked for follow when the slider rests"
        self._show(found, waits if complete in self.crew or self.resting is not None else "")

    def _completed(self, found: Found) -> None:
        if found.number != self.number:
            return
        self.crew.stop(complete)
        self.answered = found.number
        self._show(found, "")
        if found.survey is not None and self.state.model == self._quick_state.model:
            self.crew.tell(follow, (found.number, self._quick_state, found.survey))

    def _show(self, found: Found, waits: str) -> None:
        if found.shown is None:
            self.layout.say(found.message)
            return
        self.shown = found.shown
        self.document.hold("combine")
        self.layout.numbers(found.shown, found.number, waits)
        self.document.unhold()
        self.document.add_next_tick_callback(lambda: self._picture(found.lines))  # the numbers go first

    def _picture(self, lines: tuple[Array, ...]) -> None:
        self.document.hold("combine")
        self._draw(lines)
        if fly not in self.crew:
            self._rest_floater()
        self.document.unhold()

    def _draw(self, lines: tuple[Array, ...]) -> None:
        """The bodies, where they are others than those that are drawn, with the field's lines as far as they hold."""
        keys = self.state.keys
        rotor, whole = str(keys["rotor"]), str((keys["rotor"], keys["floater"]["diameter_mm"], keys.get("plate")))
        kept = lines or (self.drawn[2] if self.drawn[0] == rotor else ())
        if lines or self.drawn[1] != whole:
            self.drawn = rotor, whole, kept
            self.layout.bodies(scene_bodies(self.state.scene, kept))
            self.layout.side.scene(self.state.scene)

    def _failed(self, message: str) -> None:
        if fly not in self.crew and self.flight.playing:
            self.flight.land()
        self.layout.say(message)

    def _rest_floater(self) -> None:
        """Draw the floater where it would hang, and the other equilibria."""
        places = self.shown.places if self.shown else []
        self.layout.side.equilibria.data = {"x": [p[0] for p, _, _ in places], "z": [p[2] for p, _, _ in places]}
        if places:
            position, moment, _ = places[0]
            tilt = float(np.degrees(np.arctan2(np.hypot(moment[0], moment[1]), moment[2])))
            self.layout.samples.data = {"time": [0.0], "height": [position[2]], "tilt": [tilt]}
            self._pose(position, moment, 0.0, position)

    def _pose(self, position: list[float], moment: list[float], angle: float, seen: list[float]) -> None:
        self.poses += 1  # so that each is another, and is answered for
        moved = {"position": position, "moment": moment, "angle": angle, "flying": fly in self.crew}
        self.layout.pose({**moved, "number": self.poses})
        if not self.flight.held:
            self.layout.side.place(seen[0], seen[2], 1e3 * self.state.scene.floater.radius)

    def _mapped(self, found: Regions) -> None:
        if found.message:
            self.layout.map_title(f"No map: {found.message}")
            return
        self.layout.map.show(found)
        name = {"dipole": "point dipole", "cuboid": "closed form"}[found.model]
        self.layout.map_title(f"Stable (blue), only unstable (grey): {name}, without the plate. Click to go there.")

    # What goes home

    def _download(self, kind: str) -> None:
        self.layout.say("")
        self.crew.start(download, (kind, self.state, self._screen() if kind == "png" else None), self._downloaded)

    def _downloaded(self, answer: tuple[str, bytes, str]) -> None:
        kind, data, problem = answer
        self.crew.stop(download)
        if problem:
            self.layout.say(problem)
            return
        self.layout.give(FILES[kind], TYPES[kind], base64.b64encode(data).decode())

    def _screen(self) -> Screen:
        known, found = self.layout.map.known, controls(self.state)
        none = np.zeros(0)
        mapped = (known.frequencies, known.measures, known.kind) if known else (none, none, none)
        samples = {key: np.asarray(values) for key, values in self.layout.samples.data.items()}
        title = f"Stable regions ({known.model})" if known else ""
        axes, point = (found[0].title, found[1].title), (found[0].value, found[1].value)
        return Screen(self.shown, title, axes, *mapped, point, samples["time"], samples["height"], samples["tilt"])


def _nearest(control: Control, value: float) -> float:
    """The slider's value nearest to a place of the map."""
    steps = round((value - control.low) / control.step)
    return round(min(max(control.low + steps * control.step, control.low), control.high), 9)
