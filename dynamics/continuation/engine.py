"""An equilibrium as a function of one parameter of its problem: points of a branch, and what happens along it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..equilibria import DIFFERENCE, AtRest, directions
from ..motion import Parameter, Rates, Scales, parameters
from ..steady import EVERY, FOLD as FOLD, Balance, Indices, Modes, modes, solve

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
