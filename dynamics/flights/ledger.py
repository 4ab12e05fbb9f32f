"""The ledger of a flight: J - work, which never changes, and |m̂| = 1."""

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import Parameter, plate_places
from .compiled_flight import Flight


def booked(scene: Scene, flight: Flight, values: Array, times: Array, states: Array) -> Array:
    """States (n, s) at scaled times (n,) with J - work in the place of the work."""
    needed = values[: max(len(Parameter), flight.ledger.nparams)]
    books = flight.terms(times, states, plate_places(scene, needed, times)).sum(axis=0) - states[:, -1]
    return np.concatenate([states[:, :-1], books[:, None]], axis=1)


def ledger_scale(scene: Scene, flight: Flight, values: Array, state: Array) -> float:
    """Of the ledger, at the start in a state (s,): its sum, or its largest term where the terms nearly cancel."""
    start = np.zeros(1)
    terms = flight.terms(start, state[None], plate_places(scene, values, start))
    largest, whole = float(np.abs(terms).max()), abs(float(terms.sum()))
    return whole if whole > 1e-3 * largest else largest


def violation(states: Array, scale: float) -> float:
    """Largest relative violation of J - work = constant or of |m̂| = 1 in booked states (n, s)."""
    length = np.linalg.norm(states[:, 6:9], axis=1)
    return float(max(np.abs(states[:, -1] - states[0, -1]).max() / scale, np.abs(length - 1).max()))
