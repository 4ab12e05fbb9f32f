"""Branches of equilibria followed by pseudo-arclength, through folds; folds and losses of stability located on them.

H. B. Keller, Applications of Bifurcation Theory, 1977; W. J. F. Govaerts, Numerical Methods for Bifurcations of
Dynamical Equilibria, 2000, ch. 1 and 3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from ...geometry.basics import Array
from ..steady import EVERY, EquilibriumError, moved, solve, tangent_basis
from .branch import FOLD, OSCILLATORY, REAL, Family, Point

MOST_POINTS = 2000


@dataclass(frozen=True)
class Steps:
    """How a branch is followed.

    Parameters
    ----------
    longest, shortest : steps along the branch, in floater radii, rad and units of the parameter
    turn : largest angle between the tangents at the ends of a step, rad
    tolerated : growth that still counts as stable, 1/s
    """

    longest: float = 0.05
    shortest: float = 1e-7
    turn: float = 0.1
    tolerated: float = 0.0


def follow_branch(
    family: Family,
    start: Array,
    parameter: float,
    end: float,
    steps: Steps | None = None,
    until: Callable[[Point], bool] | None = None,
) -> list[Point]:
    """The branch through an equilibrium, towards `end` of the parameter and on through every fold.

    Parameters
    ----------
    family : the problem
    start : (12,) scaled state of the equilibrium, or a guess, at `parameter`
    end : the branch ends where the parameter reaches it, or comes back to `parameter` after folds
    until : ends the branch after the first point of which it is true

    Returns
    -------
    Points in order, equilibria to round-off.  Folds and changes of stability are points of their own, by `kind`; the
    parameter at a fold is good to round-off too.

    Raises
    ------
    EquilibriumError : there is no equilibrium near `start`
    """
    steps = steps or Steps()
    here = _start(family, start, parameter, end)
    points, step = [here], steps.longest / 8

    def outside(value: float) -> bool:
        return (value - end) * (end - parameter) > 0 or (value - parameter) * (end - parameter) < 0

    while len(points) < MOST_POINTS and step > steps.shortest:
        new = _stepped(family, here, step)
        if new is None or new.tangent @ here.tangent < np.cos(steps.turn):
            step /= 2
            continue
        marked = _marked(family, here, new, step, steps.tolerated)
        if any(point.kind == FOLD and outside(point.parameter) for point in marked):
            step /= 2  # past the end and on round a fold: the point at the end would be missed
            continue
        out = outside(new.parameter)
        if out:
            border = end if (new.parameter - end) * (end - parameter) > 0 else parameter
            new = _landed(family, new, border)
            marked = _marked(family, here, new, step, steps.tolerated)
        points += [*marked, new]
        if out or (until is not None and until(new)):
            break
        here, step = new, min(1.4 * step, steps.longest)
    return points


def _start(family: Family, start: Array, parameter: float, end: float) -> Point:
    position, moment, size = solve(family.balance(parameter), start[None, :3], start[None, 6:9], EVERY)
    if not size[0] < 1e-8:
        raise EquilibriumError(
            f"Input start must be near an equilibrium; instead Newton's method found none at {parameter:.6g}."
        )
    direction = np.append(np.zeros(6), np.sign(end - parameter))
    return family.point(position[0], moment[0], parameter, direction)


def _stepped(family: Family, here: Point, step: float) -> Point | None:
    """The point at `step` along the tangent, corrected across it; None where the step is too long."""
    position = here.state[:3] + step * here.tangent[:3]
    moment = here.state[6:9] + step * here.tangent[3:6]
    moment = moment / np.linalg.norm(moment)
    parameter = here.parameter + step * here.tangent[6] * family.unit
    for _ in range(8):
        value, slope = family.slope(position, moment, parameter)
        if not np.isfinite(slope).all():
            return None
        along = here.tangent
        across = np.concatenate([along[:3], tangent_basis(moment[None])[0] @ along[3:6], along[6:]])
        try:
            change = np.linalg.solve(np.vstack([slope, across]), -np.append(value, 0.0))
        except np.linalg.LinAlgError:
            return None
        size = float(np.linalg.norm(change))
        if size > max(step / 2, 1e-8):
            return None
        places, moments = moved(position[None], moment[None], change[None, :5])
        position, moment, parameter = places[0], moments[0], parameter + change[5] * family.unit
        if size < 1e-10:
            return family.point(position, moment, parameter, here.tangent)
    return None


def _landed(family: Family, near: Point, border: float) -> Point:
    """The equilibrium exactly at the border of the parameter."""
    position, moment, size = solve(family.balance(border), near.state[None, :3], near.state[None, 6:9], EVERY)
    return family.point(position[0], moment[0], border, near.tangent) if size[0] < 1e-8 else near


def _marked(family: Family, a: Point, b: Point, step: float, tolerated: float) -> list[Point]:
    """Folds and changes of stability between two neighbours, in order."""
    found: list[tuple[float, Point]] = []
    folds = a.tangent[6] * b.tangent[6] < 0
    if folds:
        found.append(_located(family, a, step, lambda p: float(p.tangent[6]), FOLD))
    if _excess(a, tolerated) * _excess(b, tolerated) < 0:
        unstable = a if _excess(a, tolerated) > 0 else b
        kind = OSCILLATORY if unstable.leading_hz * unstable.time_unit > 1e-6 else REAL
        if not (folds and kind == REAL):
            found.append(_located(family, a, step, lambda p: _excess(p, tolerated), kind))
    return [point for _, point in sorted(found, key=lambda pair: pair[0])]


def _excess(point: Point, tolerated: float) -> float:
    return point.growth_per_s - max(tolerated, point.doubt_per_s)


def _located(
    family: Family, a: Point, step: float, measure: Callable[[Point], float], kind: str
) -> tuple[float, Point]:
    """How far beyond `a` a measure changes its sign, and the point."""

    def at(length: float) -> Point:
        found = _stepped(family, a, length) if length > 0 else a
        if found is None:
            raise EquilibriumError(f"Lost the branch at {a.parameter:.6g}: give it shorter steps.")
        return found

    ends = measure(a), measure(at(step))
    if ends[0] * ends[1] > 0:  # a landed end: the change is beyond it
        return step, replace(at(step), kind=kind)
    length = float(brentq(lambda s: measure(at(s)), 0.0, step, xtol=1e-13, rtol=1e-12))
    return length, replace(at(length), kind=kind)
