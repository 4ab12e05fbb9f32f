"""One page in the browser: what its reader moves, what is computed for it, and what it shows."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np
from bokeh.document import Document
from bokeh.events import Tap
from bokeh.models import Slider

from ...dynamics.equilibria.equilibrium import Survey
from ...geometry.common import Array
from .layout import FlightPanel, Layout, slider
from .plots import scene_bodies
from .processes import Crew, Task
from .state import FILES, TYPES, Control, PageState, Screen, Shown, controls
from .work import Found, Regions, build, complete, download, fly, follow, has_map, map_key, regions

REST = 250
"""Milliseconds after which a slider is taken to rest."""
LIMITS: dict[Task, tuple[float, str]] = {
    build: (60.0, "Reading this scene"),
    follow: (60.0, "The preview"),
    complete: (600.0, "The answer by the chosen models"),
    regions: (600.0, "The map"),
    fly: (600.0, "Preparing the flight"),
    download: (600.0, "The file"),
}
"""Seconds after which an answer is cut off; what takes longer is for the command line."""


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
        self.crew = Crew(document, (build, follow, fly), LIMITS, self._failed)
        self.flight = FlightPanel(self.layout, self.crew, lambda: self.state, self._pose, self._rest_floater)
        self.resting: Any = None
        self.mapped, self.poses = "", 0
        self.drawn: tuple[str, str, tuple[Array, ...]] = ("", "", ())
        self.begun = False
        self._listen()
        self._hold_ready()
        if asked:
            self._become("with_query", dict(asked))
        else:
            self._begin()
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
        self.begun = True
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
        self._become("changed", key, round(float(value), 9))

    def _choose(self, name: str, value: str) -> None:
        if getattr(self.state, name) != value or self.crew.waits_for(build):
            self._become("with_query", {name: value})

    def _become(self, method: str, *arguments: Any) -> None:
        """Ask for another state, by a method of the present one; it is made in a process of its own."""
        if build not in self.crew:
            self._hold_ready()

        def older(other: tuple[str, tuple[Any, ...]]) -> bool:
            return method == other[0] == "changed" and other[1][0] == arguments[0]

        self.crew.ask(build, (method, arguments), older)

    def _hold_ready(self) -> None:
        """Begin the process that makes states: a slider that moves shall not wait for it."""
        self.crew.start(build, (self.state,), self._built)
        self.crew.rest(build)

    def _built(self, answer: tuple[str, PageState | None, str]) -> None:
        method, state, message = answer
        self.state = state or self.state
        self.layout.say(message)
        if not self.begun or (state and method == "opened"):
            self._begin()
        elif state:
            self._changed()

    def _opened(self, _: str, old: Any, content: Any) -> None:
        """A scene file of the reader's."""
        name = str(self.layout.file.filename) or "scene"
        try:
            data = base64.b64decode(str(content))
        except binascii.Error:
            data = b"\xff"  # which is no text
        self._become("opened", data, name)

    def _clicked(self, event: Tap) -> None:
        """Go to a point of the map, as far as the sliders reach."""
        if not has_map(self.state) or event.x is None or event.y is None:
            return
        found = controls(self.state)
        values = {
            control.key: _nearest(control, place) for control, place in zip(found, (event.x, event.y), strict=False)
        }

        self.layout.set_sliders(values)  # each of which says so

    # What is computed

    def _changed(self) -> None:
        """The state is another: answer at once, and completely when it rests."""
        self.number += 1
        self.crew.stop(complete)
        if fly in self.crew:
            self.flight.land()
        if follow not in self.crew:
            self.crew.start(follow, (), self._found)
        self._ask_quickly(self.number, None)
        self.layout.point(controls(self.state))
        if self.resting is not None:
            self.document.remove_timeout_callback(self.resting)
        self.resting = self.document.add_timeout_callback(self._rest, REST)

    def _ask_quickly(self, number: int, known: Survey | None) -> None:
        """A preview, or equilibria for it to begin with; earlier questions that wait need no answer any more."""
        self.crew.ask(follow, (number, self._quick_state, known), lambda other: other[2] is None)

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

    def _found(self, found: Found | None) -> None:
        """Numbers at once."""
        if found is None or found.number <= self.answered:
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
            self._ask_quickly(found.number, found.survey)

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
        rotor, whole = str(keys["rotor"]), str((keys["rotor"], keys["floater"], keys.get("plate")))
        kept = lines or (self.drawn[2] if self.drawn[0] == rotor else ())
        if lines or self.drawn[1] != whole:
            self.drawn = rotor, whole, kept
            self.layout.bodies(scene_bodies(self.state.scene, kept))
            self.layout.side.scene(self.state.scene)

    def _failed(self, message: str) -> None:
        if not self.begun:  # what the address asks for cannot be made
            self._begin()
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
        if found.last:
            self.crew.stop(regions)
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
