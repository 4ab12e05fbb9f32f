"""Many flights of one scene: how each ends, at the speed of a processor's lanes and on every core."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import InputError
from ...geometry.scenes import Scene
from ..flights import TOLERANCE, LocalFlight, Parts
from ..motion import State
from .endings import Endings
from .lanes import Lanes

TOGETHER = 512
"""Flights that a worker gets at once."""


def ensemble(
    scene: Scene,
    table: FieldTable,
    starts: State,
    duration: float,
    mapped: Callable[[Callable[[State], Endings], Iterable[State]], Iterable[Any]] = map,
) -> Endings:
    """Fly a scene's floater from many starts for `duration` (s) each, or until contact or loss.

    A plate is an obstacle only: its currents are not modelled.  A flight's numbers are the same to the last bit
    whichever flights fly beside it, in one worker or in many.

    Parameters
    ----------
    scene, table : the problem
    starts : states (n, 3) at t = 0, SI units; the moments are made unit vectors
    mapped : as the built-in `map`; `concurrent.futures.ProcessPoolExecutor(2).map` uses two cores

    Accuracy: that of a flight in balls, whose field errs by 1e-6 of its gradient.

    Raises
    ------
    InputError : `duration` is not positive, or there is no start
    IntegrationError : a state became infinite
    """
    count = len(starts.position)
    if not duration > 0:
        raise InputError(f"Input duration must be positive; instead received {duration} s.")
    if not count:
        raise InputError("Input starts must have one state at least; instead received none.")
    pieces = [slice(first, first + TOGETHER) for first in range(0, count, TOGETHER)]
    parts = mapped(partial(_flown, scene, table, duration), [State(*(v[p] for v in starts.vectors)) for p in pieces])
    return Endings.joined(list(parts))


def _flown(scene: Scene, table: FieldTable, duration: float, starts: State) -> Endings:
    moment = starts.moment / np.linalg.norm(starts.moment, axis=1, keepdims=True)
    starts = State(starts.position, starts.velocity, moment, starts.spin)
    flight = LocalFlight(scene, table, Parts(scene, table, duration, TOLERANCE, True, None))
    ends = Lanes(flight, duration).fly(starts)
    return Endings(
        np.array([end.ended_by for end in ends]),
        np.minimum([end.time * flight.scales.time for end in ends], duration),
        flight.scales.unpack(np.array([end.state for end in ends])),
        np.array([end.changes for end in ends]),
    )
