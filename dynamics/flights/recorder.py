"""Samples of a long motion: evenly spaced, and never more than fit."""

import numpy as np

from ...geometry.basics import Array


class Recorder:
    """Samples at multiples of an interval, which doubles, dropping every other sample, when there are too many.

    Parameters
    ----------
    state : (n,) at the first time
    interval : first spacing of the samples
    capacity : most samples kept
    now : the first time
    """

    def __init__(self, state: Array, interval: float, capacity: int, now: float = 0.0) -> None:
        self.interval, self.capacity = interval, capacity
        self.put(np.array([now]), state[None])

    @property
    def times(self) -> Array:
        """(m,) of the samples."""
        return self._times[: self._count]

    @property
    def states(self) -> Array:
        """(m, n) samples."""
        return self._states[: self._count]

    def put(self, times: Array, states: Array) -> None:
        """Forget all samples and have these instead."""
        self._count, self._times, self._states = len(times), times.copy(), states.copy()

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
        self._append(times[on_grid | last], states[on_grid | last])
        while self._count > self.capacity:
            self.interval *= 2
            even = np.round(self.times / self.interval) * self.interval
            kept = np.abs(self.times - even) < 1e-6 * self.interval
            kept[-1] |= last
            self.put(self.times[kept], self.states[kept])

    def _append(self, times: Array, states: Array) -> None:
        """At the end, in arrays that double where they are full."""
        count = self._count + len(times)
        if count > len(self._times):
            roomy = np.empty(2 * count), np.empty((2 * count, states.shape[1]))
            roomy[0][: self._count], roomy[1][: self._count] = self.times, self.states
            self._times, self._states = roomy
        self._times[self._count : count], self._states[self._count : count] = times, states
        self._count = count
