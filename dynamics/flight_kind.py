"""The article's three kinds of flight, told from the height: stable, linear fall, oscillating loss."""

from __future__ import annotations

import numpy as np

from .integration import DURATION
from .trajectory import Trajectory

STABLE, LINEAR_FALL, OSCILLATING_LOSS = "stable", "linear fall", "oscillating loss"
WINDOWS = 20
"""Parts into which a flight is divided; the last one, in which the floater may already fall freely, is left out."""


def flight_kind(flight: Trajectory) -> str:
    """How a flight went: it lasted, it sank, or its oscillation grew until it was lost.

    Told from the mean height and the size of the oscillation about its trend in twenty parts of the flight: an
    oscillating loss is one whose oscillation grew more than the mean height changed.  A flight too short to have been
    sampled in each part counts as a fall.
    """
    if flight.ended_by == DURATION:
        return STABLE
    if len(flight.time) < 4 * WINDOWS:
        return LINEAR_FALL
    distance = np.linalg.norm(flight.lab.position, axis=1)
    parts = np.array_split(np.arange(len(distance)), WINDOWS)[:-1]
    means = np.array([distance[part].mean() for part in parts])
    sizes = []
    for part in parts:
        trend = np.polynomial.Polynomial.fit(flight.time[part], distance[part], 2)
        sizes.append(float(np.std(distance[part] - trend(flight.time[part]))))
    grown = np.sqrt(2) * (max(sizes) - sizes[0])
    return OSCILLATING_LOSS if grown > abs(means[-1] - means[0]) else LINEAR_FALL
