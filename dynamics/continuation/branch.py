"""An equilibrium as a function of one parameter of its problem: points of a branch, and what happens along it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..equilibria.balance import CONVERGED_STEP, EVERY, Balance, Indices, solve
from ..equilibria.equilibrium import FOLD, EquilibriumError, Modes, modes
from ..equilibria.path import DIFFERENCE, END, ON, SHORTER, BalanceCurve, Steps, directions, follow, stepped
from ..equilibria.search import locked_modes, locked_poses
from ..motion.equations import parameters
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales, left_product, matrices_of

# Parameter -> values of the runtime parameters, with the drag along the moment left out, and body spin s.
Problem = Callable[[float], tuple[Array, float]]
# Kinds of marked points beside `FOLD`; `REAL` is a real eigenvalue through zero away from a fold: branches cross.
OSCILLATORY, REAL = "oscillatory", "real"


def frequencies(scene: Scene, spin: float = 0.0) -> Problem:
    """The problem whose parameter is the rotor's frequency, Hz."""

    def problem(frequency: float) -> tuple[Array, float]:
        there = replace(scene, frequency=frequency, drive=())
        return parameters(there, Scales.of(there), frozen_spin=scene.floater.round), spin

    return problem


def spins(scene: Scene) -> Problem:
    """The problem whose parameter is the body spin s."""
    values = parameters(scene, Scales.of(scene), frozen_spin=True)
    return lambda spin: (values, spin)


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """One equilibrium of a branch."""

    parameter: float  #: where on the axis of the parameter
    spin: float  #: body spin s
    position: Array  #: (3,) m, rotor's frame
    state: Array  #: (12,) scaled, or (13,) of a frequency-locked body
    #: (7 or 8,) unit direction of the branch: scaled position, moment or quaternion, and the parameter by its unit
    tangent: Array
    motion: Modes  #: its modes, in scaled time
    time_unit: float  #: s
    kind: str = ""  #: what is marked here: "fold", "oscillatory", "real"; "" at an ordinary point

    @property
    def distance(self) -> float:
        return float(np.linalg.norm(self.position))

    @property
    def orientation(self) -> Array:
        """Direction (3,) of the moment, or axes (3, 3) of a frequency-locked body."""
        return self.state[6:9] if len(self.state) == 12 else matrices_of(self.state[6:10])

    @property
    def growth_per_s(self) -> float:
        return self.motion.growth / self.time_unit

    @property
    def doubt_per_s(self) -> float:
        """Round-off error of the growth rate, 1/s."""
        return float(self.motion.errors.max()) / self.time_unit

    @property
    def leading_hz(self) -> float:
        """Frequency of the least stable mode, in the rotor's frame; 0 where it does not oscillate."""
        leading = self.motion.eigenvalues[np.argmax(self.motion.eigenvalues.real)]
        return float(abs(leading.imag)) / (2 * np.pi * self.time_unit)

    def excess(self, tolerated: float) -> float:
        """Growth beyond its error and beyond what is tolerated: of their squares, 1/s².

        Without losses growth begins where two frequencies ω meet, as a root: ((ω₁ - ω₂)/2)² goes on as -growth².
        """
        square = self.growth_per_s * abs(self.growth_per_s)
        if abs(self.growth_per_s) <= self.doubt_per_s:
            square = -(float(np.diff(np.sort(self.motion.eigenvalues.imag)).min() / (2 * self.time_unit)) ** 2)
        return square - max(tolerated, self.doubt_per_s) ** 2


@dataclass(frozen=True, eq=False)
class Family(BalanceCurve):
    """The equilibria of a problem with one parameter, as a curve."""

    rates: Rates  #: compiled once for all values of the parameter
    problem: Problem  #: what the parameter does
    unit: float = 1.0  #: of the parameter, a typical change over which the equilibrium moves by its radius
    spin_ratio: float = 1.0  #: of the floater's moments of inertia, by which spins are in a `Balance`

    def balance(self, parameter: float) -> Balance:
        """Forces and torques at one value of the parameter."""
        values, spin = self.problem(parameter)
        return Balance(self.rates, values, spin * self.spin_ratio)

    def balances(self, parameter: Array, which: Indices) -> Balance:
        values, spins = zip(*map(self.problem, parameter.tolist()), strict=True)
        return Balance(self.rates, np.array(values), np.array(spins) * self.spin_ratio)

    def solution(self, guess: Array, parameter: float) -> Array | None:
        """Unknowns (7,) of the equilibrium near a place and moment (6,) at one value of the parameter, or None."""
        position, moment, size = solve(self.balance(parameter), guess[None, :3], guess[None, 3:], EVERY)
        if not size[0] < CONVERGED_STEP:
            return None
        return np.concatenate([position[0], moment[0], [parameter / self.unit]])

    def at(self, unknowns: Array, tangent: Array, parameter: float) -> BranchPoint:
        """The equilibrium at a solution `unknowns` (7,) at `parameter`, whose branch goes on along a `tangent` (7,)."""
        balance = self.balance(parameter)
        length, time = balance.values[[Parameter.LENGTH, Parameter.TIME]].tolist()
        (state,) = states = balance.states(unknowns[None, :3], unknowns[None, 3:6])
        motion, spin = modes(state, self.rates(states, balance.values)[1][0]), float(balance.spin) / self.spin_ratio
        return BranchPoint(parameter, spin, unknowns[:3] * length, state, tangent, motion, time)

    def after(self, unknowns: Array, tangent: Array, step: float) -> BranchPoint:
        """The equilibrium a `step` along the branch from `unknowns` (7,) on a `tangent`. Raises EquilibriumError."""
        points, tangents, good = stepped(self, unknowns[None], tangent[None], np.array([step]))
        if not good[0]:
            raise EquilibriumError(f"Lost the branch at {unknowns[-1] * self.unit:.6g}: give it shorter steps.")
        return self.at(points[0], tangents[0], float(points[0, -1]) * self.unit)

    def point(self, position: Array, turn: Array, parameter: float) -> BranchPoint:
        """Equilibrium at a scaled `position` (3,) and `turn`, moment or quaternion, towards growing `parameter`."""
        unknowns = np.concatenate([position, turn, [parameter / self.unit]])
        return self.at(unknowns, directions(self, unknowns[None], np.eye(len(unknowns))[-1:])[0], parameter)


class LockedFamily(Family):
    """The frequency-locked equilibria of a body that is not round, with six balances: a quaternion is the moment's."""

    def onto(self, points: Array) -> Array:
        points = points.copy()
        points[:, 3:7] /= np.linalg.norm(points[:, 3:7], axis=1, keepdims=True)
        return points

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Balances and |q| = 1 (n, 7) at points (n, 8), and their derivatives (n, 7, 8), as of `BalanceCurve`."""
        n, quaternion = len(points), points[:, 3:7]
        around = np.concatenate([points[:, 7] + s * DIFFERENCE for s in (0, 1, -1)]) * self.unit
        given = np.array([self.problem(parameter)[0] for parameter in around.tolist()])
        found, by = self.rates.locked_balance(np.tile(points[:, :3], (3, 1)), np.tile(quaternion, (3, 1)), given)
        turns = np.array([left_product([*e], [*quaternion.T]) for e in np.eye(3)])  # (3, 4, n) twice those by turns
        values, slopes = np.zeros((n, 7)), np.zeros((n, 7, 8))
        values[:, :6], slopes[:, 6, 3:7] = found[:n], quaternion
        slopes[:, :6, :3], slopes[:, :6, 3:7] = by[:n, :, :3], 2 * np.einsum("nbk,kqn->nbq", by[:n, :, 3:], turns)
        slopes[:, :6, 7] = (found[n : 2 * n] - found[2 * n :]) / (2 * DIFFERENCE)
        return values, slopes

    def solution(self, guess: Array, parameter: float) -> Array | None:
        values, axes = self.problem(parameter)[0], matrices_of(guess[None, 3:])
        position, turn = locked_poses(self.rates, values, guess[None, :3], axes)
        if not len(position):
            return None
        return np.concatenate([position[0], turn[0] * np.sign(turn[0] @ guess[3:]), [parameter / self.unit]])

    def at(self, unknowns: Array, tangent: Array, parameter: float) -> BranchPoint:
        values = self.problem(parameter)[0]
        length, time = values[[Parameter.LENGTH, Parameter.TIME]].tolist()
        state, motion, _ = locked_modes(self.rates, values, unknowns[:3], unknowns[3:7])
        spin = float(matrices_of(unknowns[3:7])[2] @ values[Parameter.POINTING_X : Parameter.POINTING_Z + 1])
        return BranchPoint(parameter, spin, unknowns[:3] * length, state, tangent, motion, time)


def follow_branch(
    family: Family,
    start: Array,
    parameter: float,
    end: float,
    steps: Steps | None = None,
    until: Callable[[BranchPoint], bool] | None = None,
    tolerated: float = 0.0,
) -> list[BranchPoint]:
    """The branch of a `family` through an equilibrium, towards `end` of the parameter and on through every fold.

    Points are in order and good to round-off.  Folds and changes of stability are points of their own, by `kind`.
    Raises EquilibriumError: there is no equilibrium near `start`, a scaled state (12 or 13,) at `parameter`, or a guess
    of it. The branch ends where the parameter reaches `end`, comes back to where it began after folds, or after the
    first point of which `until` is true. It goes in `steps`, `Steps()` if not given; growth up to `tolerated` (1/s)
    counts as stable.
    """
    if (first := family.solution(np.concatenate([start[:3], start[6:-3]]), parameter)) is None:
        raise EquilibriumError(
            f"Input start must be near an equilibrium; instead Newton's method found none at {parameter:.6g}."
        )
    unknowns, tangent = first, directions(family, first[None], np.sign(end - parameter) * np.eye(len(first))[-1:])
    points = [family.at(unknowns, tangent[0], parameter)]

    def beyond(value: float) -> float | None:
        """The one of the two ends beyond which a value of the parameter is."""
        if (value - end) * (end - parameter) > 0:
            return end
        return parameter if (value - parameter) * (end - parameter) < 0 else None

    def arrived(which: Indices, places: Array, tangents: Array, lengths: Array) -> int:
        nonlocal unknowns
        step = float(lengths[0]), tolerated
        point = family.at(places[0], tangents[0], float(places[0, -1]) * family.unit)
        marked = _marked(family, unknowns, points[-1], point, *step)
        if any(mark.kind == FOLD and beyond(mark.parameter) is not None for mark in marked):
            return SHORTER  # past the end and on round a fold: the point at the end would be missed
        if (border := beyond(point.parameter)) is not None:
            if (landed := family.solution(places[0, :-1], border)) is not None:
                point = family.at(landed, directions(family, landed[None], tangents)[0], border)
            marked = _marked(family, unknowns, points[-1], point, *step)
        points.extend([*marked, point])
        unknowns = places[0]
        return END if border is not None or (until is not None and until(point)) else ON

    follow(family, unknowns[None], tangent, steps or Steps(), arrived)
    return points


def _marked(
    family: Family, unknowns: Array, before: BranchPoint, after: BranchPoint, length: float, tolerated: float
) -> list[BranchPoint]:
    """Folds and changes of stability, in order, on a step from unknowns (7,) of the point before to a point after."""
    at = partial(family.after, unknowns, before.tangent)

    def located(measure: Callable[[BranchPoint], float], kind: str) -> tuple[float, BranchPoint]:
        """Length along the step at which a measure changes its sign, and the point there."""
        begin, step = measure(before), length
        if begin * measure(at(step)) <= 0:  # else a landed end: the change is beyond it
            root = scipy.optimize.brentq
            step = float(root(lambda way: measure(at(way)) if way else begin, 0.0, step, xtol=1e-12, rtol=1e-12))
        return step, replace(at(step), kind=kind)

    found = []
    folds = before.tangent[-1] * after.tangent[-1] < 0
    if folds:
        found.append(located(lambda point: float(point.tangent[-1]), FOLD))
    excess = before.excess(tolerated), after.excess(tolerated)
    if excess[0] * excess[1] < 0:
        growing = before if excess[0] > 0 else after
        kind = OSCILLATORY if growing.leading_hz * growing.time_unit > 1e-6 else REAL
        if not (folds and kind == REAL):
            found.append(located(lambda point: point.excess(tolerated), kind))
    return [point for _, point in sorted(found, key=lambda pair: pair[0])]
