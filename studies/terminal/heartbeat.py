"""A sign of life while one step of the work takes long and says nothing."""

import threading
import time
from collections.abc import Callable

PAUSE = 2.5
"""Silence after which a line is said, s."""


class Heartbeat(threading.Thread):
    """Says for how long a step of the work has gone on, as often as nothing else was said for a while.

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

    def said(self, text: str = "") -> None:
        """Something was shown; a text that ends in " ..." begins a step, any other ends it."""
        self._said = time.monotonic()
        if text:
            self._began = self._said if text.endswith(" ...") else None

    def stop(self) -> None:
        """Say no more; returns when the thread has ended."""
        self._over.set()
        self.join()

    def run(self) -> None:
        """The thread's work."""
        while not self._over.wait(self._pause / 5):
            now, began = time.monotonic(), self._began
            if began is not None and now - self._said > self._pause:
                self._said = now
                self._say(f"  {now - began:.0f} s so far")
