"""Many flights of one scene: how each ends, at the speed of a processor's lanes and on every core."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import InputError
from ...geometry.scenes import Scene, startless_text
from ..flights import LARGE, SMALL, TOLERANCE, LocalFlight, Parts, Trajectory
from ..motion import State
from .endings import Endings
from .flying import Flying
from .lanes import Lanes


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
    InputError : `duration` is not positive, there is no start, or the floater is no sphere
    IntegrationError : a state became infinite
    """
    scene.floater.must_be("sphere", where="where many fly side by side", instead="Fly them one by one.")
    count = len(starts.position)
    if not duration > 0:
        raise InputError(f"Input duration must be positive; instead received {duration} s.")
    if not count:
        raise InputError("Input starts must have one state at least; instead received none.")
    pieces = [slice(first, first + together) for first in range(0, count, together)]
    parts = mapped(partial(_ended, scene, table, duration), [State(*(v[p] for v in starts.vectors)) for p in pieces])
    return Endings.joined(list(parts))


def fly_together(
    scenes: Sequence[Scene], table: FieldTable, starts: Sequence[State], duration: float
) -> list[Trajectory | None]:
    """Flights of scenes whose equations are the same but for runtime parameters, from one start each, with samples.

    Each is what `simulate` gives without a plate's currents, but for round-off; None where the start is in contact.

    Raises
    ------
    IntegrationError : a state became infinite
    """
    known: dict[str, LocalFlight] = {}
    flights = []
    began = perf_counter()
    for scene, start in zip(scenes, starts, strict=True):
        key = startless_text(scene)
        if key not in known:
            known[key] = _local_flight(scene, table, duration)
        flights.append(Flying.begun(known[key], start, duration, True))
    _fly_all(flights)
    speed = sum(f.seconds for f in flights) / (perf_counter() - began)
    return [None if f.recorder is None else f.trajectory(speed) for f in flights]


def _local_flight(scene: Scene, table: FieldTable, duration: float) -> LocalFlight:
    """What flies in balls, without a plate's currents."""
    return LocalFlight(scene, table, Parts(scene, table, duration, TOLERANCE, True, None))


def _fly_all(flights: Sequence[Flying]) -> None:
    """In lanes, in small balls first, then in large ones; at last one by one near bodies, and where it is too fast."""
    for formula in (SMALL, LARGE):
        here = [f for f in flights if not f.over and f.degree == formula.degree]
        if here:
            Lanes(here[0].flight, formula).fly(here)
    for flight in flights:
        if not flight.over:
            flight.alone()


def _ended(scene: Scene, table: FieldTable, duration: float, starts: State) -> Endings:
    flight = _local_flight(scene, table, duration)
    count = len(starts.position)
    flights = [Flying.begun(flight, State(*(v[k] for v in starts.vectors)), duration, False) for k in range(count)]
    _fly_all(flights)
    return Endings(
        np.array([f.log.ended_by for f in flights]),
        np.minimum([f.seconds for f in flights], duration),
        flight.scales.unpack(np.array([f.state[:12] for f in flights])),
        np.array([f.log.changes.count for f in flights]),
        np.zeros(count, bool),
    )
