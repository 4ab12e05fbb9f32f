"""Many flights of one scene: how each ends, at the speed of a processor's lanes and on every core."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import InputError
from ...geometry.scenes import Scene
from ..flights import DEGREE, LARGE, SMALL, TOLERANCE, LocalFlight, Parts, fly_on
from ..motion import CONTACT, Parameter, State, clearance, lost_distance
from .endings import Endings
from .lanes import Flying, Lanes


def ensemble(
    scene: Scene,
    table: FieldTable,
    starts: State,
    duration: float,
    mapped: Callable[[Callable[[State], Endings], Iterable[State]], Iterable[Any]] = map,
    together: int = 512,
) -> Endings:
    """Fly a scene's floater from many starts for `duration` (s) each, or until contact or loss.

    A plate is an obstacle only: its currents are not modelled.  A flight's numbers are the same to the last bit
    whichever flights fly beside it, in one worker or in many, where BLAS has one thread (the default).

    Parameters
    ----------
    scene, table : the problem
    starts : states (n, 3) at t = 0, SI units; the moments are made unit vectors
    mapped : as the built-in `map`; `concurrent.futures.ProcessPoolExecutor(2).map` uses two cores
    together : flights that a worker gets at once

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
    pieces = [slice(first, first + together) for first in range(0, count, together)]
    parts = mapped(partial(_flown, scene, table, duration), [State(*(v[p] for v in starts.vectors)) for p in pieces])
    return Endings.joined(list(parts))


def _flown(scene: Scene, table: FieldTable, duration: float, starts: State) -> Endings:
    """In lanes, in small balls first, then in large ones; at last one by one near bodies, and where it is too fast."""
    flight = LocalFlight(scene, table, Parts(scene, table, duration, TOLERANCE, True, None))
    flights = [_begun(flight, k, State(*(v[k] for v in starts.vectors))) for k in range(len(starts.position))]
    over: list[Flying] = []
    for formula in (SMALL, LARGE):
        here = [f for f in flights if not f.ended_by and f.values[DEGREE] == formula.degree]
        over += [f for f in flights if f.ended_by]
        rest = [f for f in flights if not f.ended_by and f.values[DEGREE] != formula.degree]
        flights = rest + Lanes(flight, formula, duration).fly(here)
    over += [f if f.ended_by else _alone(flight, f, duration) for f in flights]
    over.sort(key=lambda f: f.number)
    return Endings(
        np.array([f.ended_by for f in over]),
        np.minimum([f.time * flight.scales.time for f in over], duration),
        flight.scales.unpack(np.array([f.state for f in over])),
        np.array([f.changes for f in over]),
    )


def _begun(flight: LocalFlight, number: int, start: State) -> Flying:
    """A flight at t = 0; over if it begins in contact."""
    start = replace(start, moment=start.moment / np.linalg.norm(start.moment))
    values, state = flight.values, flight.scales.pack(start)
    values[Parameter.LOST_DISTANCE] = lost_distance(start.position) / flight.scales.length
    free = clearance(flight.scene, np.zeros(1), start.position[None])[0] >= 0
    if free:
        flight.enter(start, values)
    return Flying(number, values, 0.0, state, ended_by="" if free else CONTACT)


def _alone(flight: LocalFlight, flying: Flying, duration: float) -> Flying:
    ended_by, time, state = fly_on(flight.scene, flight, flying.values, flying.time, flying.state, duration)
    return replace(flying, time=time, state=state, ended_by=ended_by)
