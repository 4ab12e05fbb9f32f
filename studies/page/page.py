"""One page in the browser: what its reader moves, what is computed for it, and what it shows."""

from __future__ import annotations

import base64
import binascii
import html
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.events import PanEnd, PanStart, Tap
from bokeh.models import Slider

from ...geometry.common import Array
from . import work
from .layout import NO_IMAGE, Layout
from .state import Control, PageState, controls
from .work import Frame, Regions, Screen, Shown, Worker

REST = 250  # Milliseconds after which a slider is taken to rest
READING = 60.0  # Seconds that a scene may take to be read
SPEEDS = (1.0, 0.1, 0.01, 0.001)
FRAME, SLOWEST = 1 / 12, 0.25
"""Seconds between two pictures of a flight, if the page draws so fast; most seconds that are flown for one."""
POINTS = (13, 41)  # Of a map along each axis: first, and then
ROLLING = 4000  # Samples in a running plot
FOLLOW = "The selected models follow when you release the slider."
NO_MAP = "No map: it needs a horizontal, vertical or tilted rotor and gravity along the axis."


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
        self.builder = Worker(document, "Reading this scene", READING, self._failed)
        self.quick = Worker(document, "The preview", 60.0, self._failed)
        self.slow = Worker(document, "The answer by the chosen models", 600.0, self._failed, work.PATIENCE)
        self.mapper = Worker(document, "The map", 600.0, self._no_map, work.PATIENCE)
        self.porter = Worker(document, "The file", 600.0, self._failed, work.PATIENCE)
        self.flight = Flight(self)
        self.number, self.answered = 0, 0
        self.shown: Shown | None = None
        self.regions: Regions | None = None
        self.resting: Any = None
        self.mapped, self.begun = "", False
        self.drawn: tuple[str, str, list[Array]] = ("", "", [])
        self._listen()
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
        for worker in (self.builder, self.quick, self.slow, self.mapper, self.porter, self.flight.worker):
            worker.stop()

    # What the reader does

    def _listen(self) -> None:
        layout = self.layout
        layout.model.on_change("value", lambda _, old, new: self._choose("model", new))
        layout.plate_model.on_change("value", lambda _, old, new: self._choose("plate_model", new))
        layout.file.on_change("value", lambda _, old, new: self._opened(new))
        layout.map.on_event(Tap, self._clicked)
        for kind, button in layout.downloads.items():
            button.on_click(partial(self._download, kind))

    def _begin(self) -> None:
        """Show a new scene: its sliders, and then all else."""
        self.begun = True
        found = controls(self.state)
        self.layout.show_controls(self.state, [self._slider(control) for control in found])
        if work.has_map(self.state):
            self.layout.map_axes(found[0], found[1])
        self._changed()

    def _slider(self, control: Control) -> Slider:
        made = Slider(**vars(control), format="0[.]00", sizing_mode="stretch_width")
        made.on_change("value", lambda _, old, new: self._become("changed", control.name, round(float(new), 9)))
        return made

    def _choose(self, name: str, value: str) -> None:
        if getattr(self.state, name) != value or self.builder.busy:
            self._become("with_query", {name: value})

    def _become(self, method: str, *arguments: Any) -> None:
        """Ask for another state, by a method of the state at that time; of moves of one slider the last counts."""
        key = arguments[0] if method == "changed" else object()
        call = lambda: (work.build, self.state, method, arguments)  # noqa: E731
        self.builder.ask(key, call, lambda state: self._built(state, method == "opened"))

    def _built(self, state: PageState, is_other: bool) -> None:
        self.state = state
        self.layout.say("")
        if is_other or not self.begun:
            self._begin()
        else:
            self._changed()

    def _opened(self, text: Any) -> None:
        """A scene file of the reader's."""
        try:
            data = base64.b64decode(str(text))
        except binascii.Error:
            data = b"\xff"  # which is no text
        self._become("opened", data, str(self.layout.file.filename) or "scene")

    def _clicked(self, event: Tap) -> None:
        """Go to a point of the map, as far as the sliders reach."""
        if not work.has_map(self.state) or event.x is None or event.y is None:
            return
        for slider, place in zip(self.layout.sliders.children, (event.x, event.y), strict=False):
            steps = round((place - slider.start) / slider.step)
            slider.value = round(min(max(slider.start + steps * slider.step, slider.start), slider.end), 9)

    # What is computed

    def _changed(self) -> None:
        """The state is another: answer at once, and completely when it rests."""
        self.number += 1
        self.slow.stop()
        if self.flight.begun:
            self.flight.land()
        found = controls(self.state)
        if len(found) > 1:
            self.layout.point.data = {"x": [found[0].value], "y": [found[1].value]}
        self.quick.ask("", lambda: (work.preview, self.state), partial(self._answered, self.number, False))
        if self.resting is not None:
            self.document.remove_timeout_callback(self.resting)
        self.resting = self.document.add_timeout_callback(self._rest, REST)

    def _answered(self, number: int, complete: bool, found: Shown) -> None:
        """Numbers at once, and later by the models asked for."""
        waits = "" if complete or self.state.is_preview else FOLLOW
        if complete:
            self.slow.stop()
            self.answered = number
        elif number <= self.answered:
            return
        self.shown = found
        self.document.hold("combine")
        self.layout.numbers(found, number, waits)
        self.document.unhold()
        self.document.add_next_tick_callback(lambda: self._picture(found.lines))  # the numbers go first

    def _rest(self) -> None:
        self.resting = None
        self.layout.tell("address", self.state.query())
        self.slow.ask("", lambda: (work.complete, self.state), partial(self._answered, self.number, True))
        if not work.has_map(self.state):
            self._forget_map(NO_MAP)
        elif (key := work.map_key(self.state)) != self.mapped:
            self._forget_map("Map: being computed ...")
            self.mapped = key
            (x, y), state = ((control.start, control.end) for control in controls(self.state)[:2]), self.state
            for model in ("dipole", "cuboid") if state.model == "cuboid" else ("dipole",):
                for points in POINTS:
                    call = (work.regions, state, (x, y), model, points)
                    self.mapper.ask((model, points), lambda call=call: call, self._map)  # type: ignore[misc]

    def _picture(self, lines: list[Array]) -> None:
        """The bodies, where they are others than those that are drawn, with the field's lines as far as they hold."""
        self.document.hold("combine")
        keys = self.state.keys
        rotor, whole = str(keys["rotor"]), str((keys["rotor"], keys["floater"], keys.get("plate")))
        kept = lines or (self.drawn[2] if self.drawn[0] == rotor else [])
        if lines or self.drawn[1] != whole:
            self.drawn = rotor, whole, kept
            self.layout.draw(self.state.scene, kept)
        if not self.flight.begun:
            self.flight.show_rest()
        self.document.unhold()

    def _failed(self, message: str) -> None:
        if not self.begun:  # what the address asks for cannot be made
            self._begin()
        self.layout.say(message)

    def _forget_map(self, why: str) -> None:
        self.mapper.stop()
        self.mapped, self.regions = "", None
        self.layout.regions.data = NO_IMAGE
        self._map_says(why)

    def _no_map(self, why: str) -> None:
        self.mapper.stop()
        self._map_says(f"No map: {why}")

    def _map_says(self, text: str) -> None:
        self.layout.map_says.text = html.escape(text)

    def _map(self, found: Regions) -> None:
        self.regions = found
        self.layout.show_regions(found)
        name = {"dipole": "point dipole", "cuboid": "closed form"}[found.model]
        self._map_says(f"Stable (blue), only unstable (grey): {name}, without the plate. Click to go there.")
        if not self.mapper.waits:
            self.mapper.stop()

    # What goes home

    def _download(self, kind: str) -> None:
        self.layout.say("")
        known, samples = controls(self.state), self.layout.samples.data
        flown = (np.asarray(samples[key]) for key in ("time", "height", "tilt"))
        axes, point = (known[0].title, known[1].title), (known[0].value, known[1].value)
        screen = Screen(self.shown, self.regions, axes, point, *flown) if kind == "png" else None
        self.porter.ask(kind, lambda: (work.content, kind, self.state, screen), partial(self._downloaded, kind))

    def _downloaded(self, kind: str, data: bytes) -> None:
        name, form = work.FILES[kind]
        self.layout.tell("file", {"name": name, "kind": form, "content": base64.b64encode(data).decode()})


class Flight:
    """Play, pause, slow motion, kicks, and a floater that can be dragged."""

    def __init__(self, page: Page) -> None:
        self.page, self.layout = page, page.layout
        self.worker = Worker(page.document, "The flight", 600.0, self._failed)
        self.begun, self.playing, self.held, self.ended = False, False, False, False
        self.asked, self.due, self.poses = False, 0.0, 0
        layout = self.layout
        layout.side.on_event(PanStart, lambda _: self._hold())
        layout.side.on_event(PanEnd, lambda _: self._release())
        layout.program["pose"].on_change("text", lambda _, old, new: self._drawn())
        layout.play.on_click(lambda: self._pause() if self.playing else self._play())
        layout.again.on_click(self.land)
        layout.up.on_click(lambda: self._push([0.0, 0.0, 1.0]))
        layout.aside.on_click(lambda: self._push([1.0, 0.0, 0.0]))

    def land(self) -> None:
        """Forget the flight."""
        self.worker.stop()
        self.begun = self.ended = self.asked = False
        self._pause()
        self.layout.says.text = ""
        self.show_rest()

    def show_rest(self) -> None:
        """Draw the floater where it would levitate, and the other equilibria."""
        places = self.page.shown.places if self.page.shown else []
        self.layout.equilibria.data = {"x": [p[0] for p, _ in places], "z": [p[2] for p, _ in places]}
        if places:
            position, moment = places[0]
            tilt = float(np.degrees(np.arctan2(np.hypot(moment[0], moment[1]), moment[2])))
            self.layout.samples.data = {"time": [0.0], "height": [position[2]], "tilt": [tilt]}
            self._pose(position, moment, 0.0, position)

    def _play(self) -> None:
        if self.ended:
            self.land()
        self._begin()
        self.playing, self.due = True, time.monotonic()
        self.layout.play.label = "Pause"
        self._drawn()

    def _pause(self) -> None:
        self.playing, self.layout.play.label = False, "Play"

    def _begin(self) -> None:
        if not self.begun:
            self.begun = True
            self.layout.says.text = "Preparing the flight ..."
            self.layout.samples.data = {"time": [], "height": [], "tilt": []}
            self.worker.ask("begin", lambda: (work.begin_flight, self.page.state), self._flown)

    def _push(self, way: list[float]) -> None:
        self._begin()
        vector = [1e-3 * float(self.layout.strength.value or 0.0) * part for part in way]
        self.worker.ask(object(), lambda: (work.wish, "push", vector), self._flown)

    def _hold(self) -> None:
        self.held = True
        self._pause()

    def _release(self) -> None:
        """Let the floater go where it was dragged to."""
        self.held = self.ended = False
        x, z = (1e-3 * float(self.layout.floater.data[key][0]) for key in "xz")
        self._begin()
        self.worker.ask(object(), lambda: (work.wish, "put", [x, 0.0, z]), self._put)

    def _put(self, frame: Frame) -> None:
        """Fly on from there; where it cannot be the page waits, so that the reason can be read."""
        self._flown(frame)
        if not frame.message:
            self._play()

    def _drawn(self) -> None:
        """A pose has been drawn: the next one may come, one at a time; a page too slow for its speed falls behind."""
        if self.playing and not self.asked:
            self.asked = True
            wait = max(0.0, self.due - time.monotonic())
            self.page.document.add_timeout_callback(self._fly, int(1000 * wait))

    def _fly(self) -> None:
        if not self.playing:
            self.asked = False
            return
        now = time.monotonic()
        late, self.due = max(0.0, now - self.due), now + FRAME
        seconds = SPEEDS[int(self.layout.speed.active or 0)] * min(FRAME + late, SLOWEST)
        self.worker.ask("fly", lambda: (work.fly, seconds), self._flew)

    def _flew(self, frame: Frame) -> None:
        self.asked = False
        self._flown(frame)

    def _flown(self, frame: Frame) -> None:
        samples = {key: np.asarray(getattr(frame, key)) for key in ("time", "height", "tilt")}
        self.layout.samples.stream(samples, rollover=ROLLING)
        self._pose(frame.position, frame.moment, frame.angle, frame.seen)
        self.layout.says.text = html.escape(frame.message or frame.ended or f"t = {frame.time[-1]:.4g} s")
        if frame.ended:
            self.ended = True
            self._pause()

    def _failed(self, message: str) -> None:
        self.land()
        self.layout.says.text = html.escape(message)

    def _pose(self, position: list[float], moment: list[float], angle: float, seen: list[float]) -> None:
        self.poses += 1  # so that each is another, and is answered for
        moved = {"position": position, "moment": moment, "angle": angle, "flying": self.begun, "number": self.poses}
        self.layout.tell("pose", moved)
        if not self.held:
            self.layout.place(seen[0], seen[2], 1e3 * self.page.state.scene.floater.radius)
