"""An equilibrium as a function of one parameter of its problem: points of a branch, and what happens along it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Generic, Protocol, TypeVar

import numpy as np
import scipy

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..equilibria.balance import EVERY, Balance, Indices, solve
from ..equilibria.equilibrium import FOLD, EquilibriumError
from ..equilibria.modes import Modes, modes
from ..equilibria.path import DIFFERENCE, END, ON, SHORTER, AtRest, Equations, Steps, directions, follow, stepped
from ..motion.equations import parameters
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales

Problem = Callable[[float], tuple[Array, float]]
"""Parameter -> values of the runtime parameters, with the drag along the moment left out, and body spin s."""
OSCILLATORY, REAL = "oscillatory", "real"
"""Kinds of marked points beside `FOLD`; `REAL` is a real eigenvalue through zero away from a fold: branches cross."""


def scenes(make: Callable[[float], Scene], spin: float = 0.0) -> Problem:
    """The problem in which a parameter makes the scene: anything but the rotor, whose field is compiled in."""

    def problem(parameter: float) -> tuple[Array, float]:
        scene = make(parameter)
        return parameters(scene, Scales.of(scene), frozen_spin=True), spin

    return problem


def frequencies(scene: Scene, spin: float = 0.0) -> Problem:
    """The problem whose parameter is the rotor's frequency, Hz."""
    return scenes(lambda frequency: replace(scene, frequency=frequency), spin)


def spins(scene: Scene) -> Problem:
    """The problem whose parameter is the body spin s."""
    values = parameters(scene, Scales.of(scene), frozen_spin=True)
    return lambda spin: (values, spin)


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """One solution of a branch.

    Parameters
    ----------
    parameter : where on the axis of the parameter
    tangent : (k + 1,) unit direction of the branch in its unknowns, the last of which is the parameter by its unit
    motion : small motions, in scaled time
    time_unit : s
    kind : what is marked here: "fold", "oscillatory", "real"; "" at an ordinary point
    """

    parameter: float
    tangent: Array
    motion: Modes
    time_unit: float
    kind: str = ""

    @property
    def growth_per_s(self) -> float:
        """Largest growth rate of a small motion, 1/s."""
        return self.motion.growth / self.time_unit

    @property
    def doubt_per_s(self) -> float:
        """What round-off may do to it, 1/s."""
        return float(self.motion.errors.max()) / self.time_unit

    @property
    def leading_hz(self) -> float:
        """Frequency of the motion that grows fastest, in the rotor's frame; 0 for one that does not oscillate."""
        leading = self.motion.eigenvalues[np.argmax(self.motion.eigenvalues.real)]
        return float(abs(leading.imag)) / (2 * np.pi * self.time_unit)

    def excess(self, tolerated: float) -> float:
        """Growth beyond its error and beyond what is tolerated, 1/s."""
        return self.growth_per_s - max(tolerated, self.doubt_per_s)

    @property
    def loss(self) -> str:
        """Kind of the point at which the motion that grows fastest begins to grow."""
        return OSCILLATORY if self.leading_hz * self.time_unit > 1e-6 else REAL


@dataclass(frozen=True, eq=False, kw_only=True)
class BranchPoint(Solution):
    """One equilibrium of a branch; unknown are its place and the direction of its moment, scaled, (6,).

    Parameters
    ----------
    spin : body spin s
    position : (3,) m, rotor's frame
    state : (12,) scaled
    """

    spin: float
    position: Array
    state: Array

    @property
    def distance(self) -> float:
        """Distance from the rotor's origin, m."""
        return float(np.linalg.norm(self.position))


@dataclass(frozen=True, eq=False)
class Family(AtRest):
    """The balance of a floater in a problem with one parameter.

    Parameters
    ----------
    rates : compiled once for all values of the parameter
    problem : what the parameter does
    unit : of the parameter, a typical change over which the equilibrium moves by its radius
    """

    rates: Rates
    problem: Problem
    unit: float = 1.0
    what: ClassVar[str] = "an equilibrium"

    def balance(self, parameter: float) -> Balance:
        """Forces and torques at one value of the parameter."""
        values, spin = self.problem(parameter)
        return Balance(self.rates, values, spin)

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Balance and |m̂| = 1 (1, 6) at one point (1, 7), and their derivatives (1, 6, 7).

        That by the parameter is a central difference, good to 1e-9; a fold is found where the other columns are
        singular, which does not depend on it.
        """
        position, moment, parameter = points[:, :3], points[:, 3:6], float(points[0, 6]) * self.unit
        value, slope = self.balance(parameter)(position, moment)
        ends = [self.balance(parameter + s * DIFFERENCE * self.unit)(position, moment)[0] for s in (1, -1)]
        along = (ends[0] - ends[1]) / (2 * DIFFERENCE)
        return self.extended(value, np.concatenate([slope, along[:, :, None]], axis=2), moment)

    def guess(self, state: Array) -> Array:
        """Place and moment (6,) of a scaled state (12,)."""
        return state[[0, 1, 2, 6, 7, 8]]

    def solution(self, guess: Array, parameter: float) -> Array | None:
        """Unknowns (7,) of the equilibrium near a place and moment (6,) at one value of the parameter."""
        position, moment, size = solve(self.balance(parameter), guess[None, :3], guess[None, 3:], EVERY)
        return np.concatenate([position[0], moment[0], [parameter / self.unit]]) if size[0] < 1e-8 else None

    def at(self, unknowns: Array, tangent: Array, parameter: float) -> BranchPoint:
        """The equilibrium at a solution (7,)."""
        balance = self.balance(parameter)
        state = balance.states(unknowns[None, :3], unknowns[None, 3:6])
        return BranchPoint(
            parameter=parameter,
            spin=float(balance.spin),
            position=unknowns[:3] * balance.values[Parameter.LENGTH],
            state=state[0],
            tangent=tangent,
            motion=modes(state[0], self.rates(state, balance.values)[1][0]),
            time_unit=float(balance.values[Parameter.TIME]),
        )

    def point(self, position: Array, moment: Array, parameter: float) -> BranchPoint:
        """The same at scaled place and moment (3,), with the tangent towards growing values of the parameter."""
        unknowns = np.concatenate([position, moment, [parameter / self.unit]])
        return self.at(unknowns, directions(self, unknowns[None], np.eye(7)[6:])[0], parameter)


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
