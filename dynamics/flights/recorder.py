"""Samples of a long motion: evenly spaced, and never more than fit."""

import numpy as np

from ...geometry.basics import Array


class Recorder:
    """Samples at multiples of an interval, which doubles, dropping every other sample, when there are too many.

    Parameters
    ----------
    state : (n,) at time zero
    interval : first spacing of the samples
    capacity : most samples kept
    """

    def __init__(self, state: Array, interval: float, capacity: int) -> None:
        self.times, self.states = np.zeros(1), state[None].copy()
        self.interval, self.capacity = interval, capacity

    def grid(self, now: float, end: float, count: int) -> Array:
        """Times to visit next: `now`, then at most `count` multiples of the interval, and `end` if they reach it."""
        first = int(np.floor(now / self.interval + 1e-9)) + 1
        times = self.interval * np.arange(first, first + count)
        times = times[times < end - 1e-9 * self.interval]
        return np.concatenate([[now], times, [end] if len(times) < count else []])

    def due(self, seen: float, now: float, end: float) -> Array:
        """Multiples of the interval after `seen`, up to `now` and before `end`."""
        first, last = (int(np.floor(time / self.interval + 1e-9)) for time in (seen, now))
        times = self.interval * np.arange(first + 1, last + 1)
        return np.asarray(times[times < end - 1e-9 * self.interval])

    def add(self, times: Array, states: Array, last: bool) -> None:
        """Keep samples at multiples of the interval; of the `last` ones all."""
        on_grid = np.abs(times / self.interval - np.round(times / self.interval)) < 1e-9
        keep = on_grid | last
        self.times = np.concatenate([self.times, times[keep]])
        self.states = np.concatenate([self.states, states[keep]])
        while len(self.times) > self.capacity:
            self.interval *= 2
            even = np.round(self.times / self.interval) * self.interval
            kept = np.abs(self.times - even) < 1e-6 * self.interval
            kept[-1] |= last
            self.times, self.states = self.times[kept], self.states[kept]
