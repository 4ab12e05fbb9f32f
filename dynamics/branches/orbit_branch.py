"""Periodic motions followed by pseudo-arclength in a parameter.

The unknowns of `orbit`, the floater's states at instants of a turn, and the parameter; otherwise as in `arclength`.
Stability is lost where a Floquet multiplier leaves the unit circle: at +1 (a fold, or a crossing of branches), at -1
(period doubling) or as a pair (Neimark-Sacker).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from ...geometry.basics import Array
from ..steady import EquilibriumError, Orbit, floquet_modes
from .branch import FOLD, REAL
from .orbit_family import OrbitFamily, OrbitPoint

DOUBLING, TORUS = "period doubling", "Neimark-Sacker"
LONGEST, SHORTEST, MOST, TURN = 0.05, 1e-6, 300, 0.2


def follow_orbits(family: OrbitFamily, states: Array, parameter: float, end: float) -> list[OrbitPoint]:
    """The branch through a periodic motion, towards `end` of the parameter and on through every fold.

    Parameters
    ----------
    states : (n, 12) scaled, n odd, an orbit at `parameter` or a guess; n stays what it is
    end : the branch ends where the parameter reaches it, or comes back to `parameter` after folds

    Returns
    -------
    Points in order; folds and changes of stability are points of their own.

    Raises
    ------
    EquilibriumError : there is no periodic motion near the start
    """
    size = states.size
    forward = np.append(np.zeros(size), np.sign(end - parameter))
    here = _corrected(family, states, parameter, forward, fixed=True)
    if here is None:
        raise EquilibriumError(
            f"Input states must be near a periodic motion; instead none was found at {parameter:.6g}."
        )
    points, step = [here], LONGEST / 4
    while len(points) < MOST and step > SHORTEST:
        new = _stepped(family, here, step)
        if new is None or new.tangent @ here.tangent < np.cos(TURN):
            step /= 2
            continue
        over = (new.parameter - end) * (end - parameter) > 0
        out = over or (new.parameter - parameter) * (end - parameter) < 0
        if out:
            border = end if over else parameter
            new = _corrected(family, new.states, border, new.tangent, fixed=True) or new
        points += [*_marked(family, here, new, step, out), new]
        if out:
            break
        here, step = new, min(1.4 * step, LONGEST)
    return points


def _stepped(family: OrbitFamily, here: OrbitPoint, step: float) -> OrbitPoint | None:
    change = step * here.tangent * np.sqrt(len(here.states))  # lengths are root mean squares over a turn
    states = here.states + change[:-1].reshape(here.states.shape)
    return _corrected(family, states, here.parameter + change[-1] * family.unit, here.tangent)


def _corrected(
    family: OrbitFamily, states: Array, parameter: float, tangent: Array, fixed: bool = False
) -> OrbitPoint | None:
    """The orbit across the tangent from a guess, or at the guess' parameter if that is fixed."""
    across = np.append(np.zeros(states.size), 1.0) if fixed else tangent
    for _ in range(8):
        value, slope = family.linear(states, parameter)
        if not np.isfinite(slope).all():
            return None
        change = -np.linalg.lstsq(np.vstack([slope, across]), np.append(value, 0.0), rcond=1e-14)[0]
        largest = float(np.abs(change).max())
        if largest > 0.3:
            return None
        states = states + change[:-1].reshape(states.shape)
        parameter = parameter if fixed else parameter + change[-1] * family.unit
        if largest < 1e-10:
            return _point(family, states, float(parameter), tangent)
    return None


def _point(family: OrbitFamily, states: Array, parameter: float, before: Array) -> OrbitPoint:
    slope = family.linear(states, parameter)[1]
    along = np.linalg.lstsq(np.vstack([slope, before]), np.append(np.zeros(len(slope)), 1.0), rcond=1e-14)[0]
    orbit = Orbit(states, *family.at(states, parameter).whole(states), 0.0)
    return OrbitPoint(parameter, states, along / np.linalg.norm(along), floquet_modes(orbit))


def _marked(family: OrbitFamily, a: OrbitPoint, b: OrbitPoint, step: float, landed: bool) -> list[OrbitPoint]:
    """Folds and changes of stability between two neighbours."""
    found = []
    folds = a.tangent[-1] * b.tangent[-1] < 0
    if folds:
        found.append(_located(family, a, step, lambda p: float(p.tangent[-1]), FOLD))
    if not landed and a.excess * b.excess < 0:
        kind = kind_of(max(a, b, key=lambda p: p.excess).leaving)
        if not (folds and kind == REAL):
            found.append(_located(family, a, step, lambda p: p.excess, kind))
    return [point for point in found if point is not None]


def kind_of(multiplier: complex) -> str:
    """What happens where this multiplier leaves the unit circle."""
    if abs(multiplier.imag) > 1e-6 * abs(multiplier):
        return TORUS
    return REAL if multiplier.real > 0 else DOUBLING


def _located(
    family: OrbitFamily, a: OrbitPoint, step: float, measure: Callable[[OrbitPoint], float], kind: str
) -> OrbitPoint | None:
    def at(length: float) -> OrbitPoint:
        found = _stepped(family, a, length) if length > 0 else a
        if found is None:
            raise EquilibriumError(f"Lost the branch of periodic motions at {a.parameter:.6g}.")
        return found

    if measure(a) * measure(at(step)) > 0:
        return None
    length = float(brentq(lambda s: measure(at(s)), 0.0, step, xtol=1e-11, rtol=1e-10))
    return replace(at(length), kind=kind)
