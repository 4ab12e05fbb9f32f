"""How a flight went, told from its places: the article's three kinds, and those that a simulation also has."""

import numpy as np

from ...geometry.basics import Array
from ..steady import Indices
from .trajectory import DURATION, STOPPED, Trajectory

STABLE, LINEAR_FALL, OSCILLATING_LOSS = "stable", "linear fall", "oscillating loss"
DRIFTING, GROWING, NOT_HELD = "drifting", "growing oscillation", "not held"
NOT_FOLLOWED = "not followed"
"""To its end: it left the range of the plate's table."""
WINDOWS = 20
"""Parts into which a flight is divided; the last one, in which the floater may already fall freely, is left out."""
FEWEST = 4
"""Samples in a part: a trend takes three."""
VISIBLE = 2e-5
"""Smallest drift or oscillation that counts while the floater is still up, m."""
HELD = 0.5
"""A loss before this time, s, is no flight: the floater had no time for a few bounces; nor is a trend seen in less."""


def flight_kind(flight: Trajectory) -> str:
    """How a flight went.

    Told from the mean distance, and from the size of the oscillation in the rotor's frame about its trend, in twenty
    parts of the flight.  Lost or in contact: "not held" from the beginning; an "oscillating loss" if the oscillation
    grew more than the mean distance changed, in the whole flight or in its last part; else a "linear fall".  Still up
    at the end: "growing oscillation" if it became more than twice as large, or "drifting" if the distance goes on
    changing steadily in the second half, both by 0.02 mm at least; else "stable".
    """
    if flight.left_plate_table:
        return NOT_FOLLOWED
    lasted = flight.ended_by in (DURATION, STOPPED)
    distance = np.linalg.norm(flight.lab.position, axis=1)
    if len(distance) < FEWEST * WINDOWS or flight.levitated_s <= HELD:
        return STABLE if lasted else NOT_HELD
    parts = np.array_split(np.arange(len(distance)), WINDOWS)
    if not lasted:
        whole, end = np.arange(len(distance)), parts[-1]
        return OSCILLATING_LOSS if _swings(flight, whole) or _swings(flight, end) else LINEAR_FALL
    places = flight.rotor.position
    means = np.array([distance[part].mean() for part in parts])
    sizes = np.array([_oscillation(flight.time[part], places[part]) for part in parts])
    late = sizes[-WINDOWS // 4 :].mean()
    if late > VISIBLE and late > 2 * sizes[: WINDOWS // 4].mean():
        return GROWING
    return DRIFTING if _drifts(means[WINDOWS // 2 :]) else STABLE


def _swings(flight: Trajectory, samples: Indices) -> bool:
    """Whether the oscillation grew more than the mean distance changed among samples (n,), but for the last of them.

    Where there are too few it is not known, and said not to.
    """
    if len(samples) < FEWEST * WINDOWS:
        return False
    distance, places = np.linalg.norm(flight.lab.position, axis=1), flight.rotor.position
    parts = np.array_split(samples, WINDOWS)[:-1]
    means = [distance[part].mean() for part in parts]
    sizes = [_oscillation(flight.time[part], places[part]) for part in parts]
    return bool(max(sizes) - sizes[0] > abs(means[-1] - means[0]))


def _oscillation(time: Array, places: Array) -> float:
    """Amplitude of places (n, 3) about a smooth trend, m."""
    terms = np.vander((time - time[0]) / np.ptp(time), 3)
    rest = places - terms @ np.linalg.lstsq(terms, places)[0]
    return float(np.sqrt(2 * np.mean(rest**2, axis=0).sum()))


def _drifts(means: Array) -> bool:
    """Whether means (n,) in turn change along a straight line, and visibly."""
    steps = np.arange(len(means))
    line = np.polynomial.Polynomial.fit(steps, means, 1)
    change = abs(float(line(steps[-1]) - line(0)))
    return change > max(VISIBLE, 3 * float(np.std(means - line(steps))))
