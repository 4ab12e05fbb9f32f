"""The flight of a page: what its reader does to it, and what is shown of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.events import PanEnd, PanStart

from ..live import Frame, PageState, fly
from .layout import SPEEDS, Layout
from .plots import ROLLING
from .processes import Crew

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
