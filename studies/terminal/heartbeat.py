"""A sign of life while one step of the work takes long and says nothing."""

import threading
import time
from collections.abc import Callable

PAUSE = 2.5
"""Silence after which a line is said, s."""
SHARE = 1 / 60
"""The same as a part of the time that the step has taken, once that is longer."""
TELLING = 0.01
"""Finished share from which the time left can be told."""
ALL = 0.995
"""Share that would be shown as the whole; what still goes on then has no share."""


class Heartbeat(threading.Thread):
    """Says for how long a step of the work has gone on, as often as nothing else was said for a while.

    The thread begins with the first step.

    Parameters
    ----------
    say : prints a line
    pause : the silence, s
    """

    def __init__(self, say: Callable[[str], None], pause: float = PAUSE) -> None:
        super().__init__(name="heartbeat", daemon=True)
        self._say, self._pause, self._over = say, pause, threading.Event()
        self._began: float | None = None
        self._said = time.monotonic()
        self._stage, self._stage_began, self._fraction, self._advanced = "", self._said, 0.0, self._said

    def said(self, text: str = "") -> None:
        """Something was shown; a text that ends in " ..." begins a step, any other ends it."""
        self._said = time.monotonic()
        if text:
            self._began = self._said if text.endswith(" ...") else None
            self.advanced(0.0)
        if self._began and self.ident is None:
            self.start()

    def advanced(self, fraction: float, stage: str = "") -> None:
        """How much of the step is finished, 0 to 1, or of one of its stages."""
        now = time.monotonic()
        if stage != self._stage or fraction < self._fraction:
            self._stage, self._stage_began = stage, now
        self._fraction, self._advanced = fraction, now

    def stop(self) -> None:
        """Say no more; returns when the thread has ended."""
        self._over.set()
        if self.ident is not None:
            self.join()

    def run(self) -> None:
        """The thread's work."""
        while not self._over.wait(self._pause / 5):
            now, began = time.monotonic(), self._began
            if began is not None and now - self._said > max(self._pause, SHARE * (now - began)):
                self._said = now
                self._say(f"  {self._progress(now, began)}")

    def _progress(self, now: float, began: float) -> str:
        if not TELLING <= self._fraction < ALL:
            return f"{self._stage}{self._stage and ', '}{_rounded(now - began)} so far"
        left = (self._advanced - self._stage_began) * (1 / self._fraction - 1) - (now - self._advanced)
        told = f", {_rounded(left)} left" if left > 0 else ""  # a part that takes longer than its share tells no time
        return f"{self._stage}{self._stage and ', '}{self._fraction:.0%}{told}"


def _rounded(seconds: float) -> str:
    if seconds < 300:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
