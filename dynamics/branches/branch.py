"""An equilibrium as a function of one parameter of its problem: points of a branch, and what happens along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import Parameter, Rates, Scales, parameters
from ..steady import Balance, Modes, modes, tangent_basis

Problem = Callable[[float], tuple[Array, float]]
"""Parameter -> values of the runtime parameters, with the drag along the moment left out, and body spin s."""

FOLD, OSCILLATORY, REAL = "fold", "oscillatory", "real"
"""Kinds of marked points; `REAL` is a real eigenvalue through zero away from a fold (a crossing of branches)."""


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


@dataclass(frozen=True, eq=False)
class Point:
    """One equilibrium of a branch.

    Parameters
    ----------
    parameter : where on the axis of the parameter
    spin : body spin s
    position : (3,) m, rotor's frame
    state : (12,) scaled
    tangent : (7,) unit direction of the branch: place and direction of the moment, scaled; the parameter by its unit
    motion : small motions, in scaled time
    time_unit : s
    kind : what is marked here: "fold", "oscillatory", "real"; "" at an ordinary point
    """

    parameter: float
    spin: float
    position: Array
    state: Array
    tangent: Array
    motion: Modes
    time_unit: float
    kind: str = ""

    @property
    def distance(self) -> float:
        """Distance from the rotor's origin, m."""
        return float(np.linalg.norm(self.position))

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


@dataclass(frozen=True, eq=False)
class Family:
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

    def balance(self, parameter: float) -> Balance:
        """Forces and torques at one value of the parameter."""
        values, spin = self.problem(parameter)
        return Balance(self.rates, values, spin)

    def slope(self, position: Array, moment: Array, parameter: float) -> tuple[Array, Array]:
        """Balance (5,) at scaled position and moment (3,), and its derivatives (5, 6), the last by parameter/unit.

        That by the parameter is a central difference, good to 1e-9; a fold is found where the other five columns are
        singular, which does not depend on it.
        """
        value, exact = self.balance(parameter)(position[None], moment[None])
        step = 1e-5
        ends = [self.balance(parameter + s * step * self.unit)(position[None], moment[None])[0][0] for s in (1, -1)]
        return value[0], np.column_stack([exact[0], (ends[0] - ends[1]) / (2 * step)])

    def point(self, position: Array, moment: Array, parameter: float, before: Array | None = None) -> Point:
        """The equilibrium at a solution of the balance; its tangent goes on in the direction of `before` (7,)."""
        balance = self.balance(parameter)
        slope = self.slope(position, moment, parameter)[1]
        along = np.linalg.svd(slope)[2][5]
        tangent = np.concatenate([along[:3], along[3:5] @ tangent_basis(moment[None])[0], along[5:]])
        reference = tangent[6] if before is None else tangent @ before
        state = balance.states(position[None], moment[None])
        motion = modes(state[0], self.rates(state, balance.values)[1][0])
        return Point(
            parameter=parameter,
            spin=balance.spin,
            position=position * balance.values[Parameter.LENGTH],
            state=state[0],
            tangent=tangent if reference > 0 else -tangent,
            motion=motion,
            time_unit=float(balance.values[Parameter.TIME]),
        )
