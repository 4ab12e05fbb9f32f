"""Branches followed in a parameter, through folds; folds and losses of stability located on them.

W. J. F. Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000, ch. 1 and 3.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
import scipy

from ...geometry.basics import Array
from ..equilibria import END, ON, SHORTER, Equations, Steps, directions, follow, stepped
from ..steady import EquilibriumError, Indices
from .branch import FOLD, REAL, Solution

P = TypeVar("P", bound=Solution)
P_co = TypeVar("P_co", bound=Solution, covariant=True)


class Parametric(Equations, Protocol[P_co]):
    """Equations whose last unknown is a parameter by its `unit`; `what` solves them."""

    @property
    def what(self) -> str:
        """Such as "an equilibrium"."""

    @property
    def unit(self) -> float:
        """Of the parameter."""

    def guess(self, start: Array) -> Array:
        """The other unknowns (k,) of a state, or of states at the instants of a turn."""

    def solution(self, guess: Array, parameter: float) -> Array | None:
        """The unknowns (k + 1,) at one value of the parameter, if Newton's method finds them from a guess (k,)."""

    def at(self, unknowns: Array, tangent: Array, parameter: float) -> P_co:
        """What is known of a solution (k + 1,)."""


def follow_branch(
    family: Parametric[P],
    start: Array,
    parameter: float,
    end: float,
    steps: Steps | None = None,
    until: Callable[[P], bool] | None = None,
    tolerated: float = 0.0,
) -> list[P]:
    """The branch through a solution, towards `end` of the parameter and on through every fold.

    Parameters
    ----------
    family : the problem: `Family` for equilibria, `OrbitFamily` for periodic motions
    start : at `parameter`, or a guess: the scaled state (12,) of an equilibrium; states (n, 12), n odd, of an orbit
    end : the branch ends where the parameter reaches it, or comes back to `parameter` after folds
    until : ends the branch after the first point of which it is true
    tolerated : growth that still counts as stable, 1/s

    Returns
    -------
    Points in order, good to round-off.  Folds and changes of stability are points of their own, by `kind`; the
    parameter at a fold is good to round-off too.

    Raises
    ------
    EquilibriumError : there is no solution near `start`
    """
    first = family.solution(family.guess(start), parameter)
    if first is None:
        raise EquilibriumError(
            f"Input start must be near {family.what}; instead Newton's method found none at {parameter:.6g}."
        )
    forward = np.append(0.0 * first[:-1], np.sign(end - parameter))
    tangent = directions(family, first[None], forward[None])
    walk = _Walk(family, (parameter, end), until, tolerated, first, [family.at(first, tangent[0], parameter)])
    follow(family, first[None], tangent, steps or Steps(), walk.arrived)
    return walk.points


@dataclass(eq=False)
class _Walk(Generic[P]):
    """A branch on its way between two ends: its points so far, and the unknowns at the last of them."""

    family: Parametric[P]
    ends: tuple[float, float]
    until: Callable[[P], bool] | None
    tolerated: float
    unknowns: Array
    points: list[P]

    def arrived(self, which: Indices, points: Array, tangents: Array, lengths: Array) -> int:
        """Keep what was reached, with what is marked before it; says how to go on."""
        unknowns, step = points[0], float(lengths[0])
        point = self._at(unknowns, tangents[0])
        marked = self._marked(point, step)
        if any(mark.kind == FOLD and self._border(mark.parameter) is not None for mark in marked):
            return SHORTER  # past the end and on round a fold: the point at the end would be missed
        border = self._border(point.parameter)
        if border is not None:
            landed = self.family.solution(unknowns[:-1], border)
            if landed is not None:
                tangent = directions(self.family, landed[None], tangents)[0]
                point = self.family.at(landed, tangent, border)
            marked = self._marked(point, step)
        self.points += [*marked, point]
        self.unknowns = unknowns
        return END if border is not None or (self.until is not None and self.until(point)) else ON

    def _border(self, parameter: float) -> float | None:
        """The one of the ends beyond which a parameter is."""
        begin, end = self.ends
        if (parameter - end) * (end - begin) > 0:
            return end
        return begin if (parameter - begin) * (end - begin) < 0 else None

    def _at(self, unknowns: Array, tangent: Array) -> P:
        return self.family.at(unknowns, tangent, float(unknowns[-1]) * self.family.unit)

    def _marked(self, point: P, step: float) -> list[P]:
        """Folds and changes of stability between the last point and one that lies a step on, in order."""
        before, found = self.points[-1], list[tuple[float, P]]()
        folds = before.tangent[-1] * point.tangent[-1] < 0
        if folds:
            found.append(self._located(step, lambda x, t: float(t[-1]), FOLD))
        excess = before.excess(self.tolerated), point.excess(self.tolerated)
        if excess[0] * excess[1] < 0:
            kind = (before if excess[0] > 0 else point).loss
            if not (folds and kind == REAL):
                found.append(self._located(step, lambda x, t: self._at(x, t).excess(self.tolerated), kind))
        return [mark for _, mark in sorted(found, key=lambda pair: pair[0])]

    def _located(self, step: float, measure: Callable[[Array, Array], float], kind: str) -> tuple[float, P]:
        """How far beyond the last point a measure changes its sign within a step, and the point there."""
        here, tangent = self.unknowns, self.points[-1].tangent

        def at(length: float) -> tuple[Array, Array]:
            if length == 0:
                return here, tangent
            points, tangents, good = stepped(self.family, here[None], tangent[None], np.array([length]))
            if not good[0]:
                parameter = self.points[-1].parameter
                raise EquilibriumError(f"Lost the branch at {parameter:.6g}: give it shorter steps.")
            return points[0], tangents[0]

        if measure(*at(0.0)) * measure(*at(step)) <= 0:  # else a landed end: the change is beyond it
            step = float(scipy.optimize.brentq(lambda length: measure(*at(length)), 0.0, step, xtol=1e-13, rtol=1e-12))
        return step, replace(self._at(*at(step)), kind=kind)
