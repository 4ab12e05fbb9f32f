"""Periodic motions as a function of one parameter: gravity's angle, the plate's distance, anything else.

Unknown are the floater's states at instants of a turn, as in `orbit`, and the parameter.  Stability is lost where a
Floquet multiplier leaves the unit circle: at +1 (a fold, or a crossing of branches), at -1 (period doubling) or as a
pair (Neimark-Sacker).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...geometry.basics import Array
from ..equilibria import Steps
from ..motion import Parameter, PlateForce, Rates
from ..steady import Indices, Orbit, OrbitProblem, conserved, floquet_modes, orbit_near
from .branch import DIFFERENCE, REAL, Solution

DOUBLING, TORUS = "period doubling", "Neimark-Sacker"
ORBIT_STEPS = Steps(longest=0.05, shortest=1e-6, turn=0.2, most=300)
"""For branches of orbits; lengths are root mean squares over a turn."""


def kind_of(multiplier: complex) -> str:
    """What happens where this multiplier leaves the unit circle."""
    if abs(multiplier.imag) > 1e-6 * abs(multiplier):
        return TORUS
    return REAL if multiplier.real > 0 else DOUBLING


@dataclass(frozen=True, eq=False, kw_only=True)
class OrbitPoint(Solution):
    """One periodic motion of a branch; its unknowns are the states, divided by √n.

    Parameters
    ----------
    states : (n, 12) scaled, at equidistant instants of a turn
    motion : Floquet's modes, in scaled time
    kind : what is marked here: "fold", "real", "period doubling", "Neimark-Sacker"; "" at an ordinary point
    """

    states: Array

    def excess(self, tolerated: float) -> float:
        """Largest growth beyond its own error and beyond what is tolerated, 1/s."""
        allowed = np.maximum(self.motion.errors, tolerated * self.time_unit)
        return float((self.motion.eigenvalues.real - allowed).max()) / self.time_unit

    @property
    def leaving(self) -> complex:
        """The largest multiplier, as far as errors allow: in a fold two meet at 1 and are known least of all."""
        rates = self.motion.eigenvalues
        return complex(np.exp(2 * np.pi * rates[np.argmax(rates.real + self.motion.errors)]))

    @property
    def loss(self) -> str:
        """Kind of the point at which this multiplier leaves the unit circle."""
        return kind_of(self.leaving)


@dataclass(frozen=True, eq=False)
class OrbitFamily:
    """A periodic motion as a function of one parameter.

    Parameters
    ----------
    rates : compiled equations of the rotor's field
    problem : parameter -> values of the runtime parameters, drag along the moment left out, and the plate's forces
    spin : body spin s
    unit : of the parameter, a typical change over which the motion moves by its radius
    """

    rates: Rates
    problem: Callable[[float], tuple[Array, PlateForce | None]]
    spin: float
    unit: float
    what: ClassVar[str] = "a periodic motion"

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """What shall vanish (1, 12 n) at one point (1, 12 n + 1), and its derivatives (1, 12 n, 12 n + 1).

        The equations of an orbit keep |m̂| and the spin, so that two of the 12 n + 2 follow from the others; of their
        singular value decomposition as many are taken as there are unknowns but one.
        """
        states, parameter = _states(points[0, :-1]), float(points[0, -1]) * self.unit
        problem = self._at(states, parameter)
        residual, slope = problem(states)
        ends = [self._at(states, parameter + s * DIFFERENCE * self.unit)(states)[0] for s in (1, -1)]
        rows, aims = conserved(states, self.spin * abs(problem.values[Parameter.RATE]))
        column = np.append((ends[0] - ends[1]) / (2 * DIFFERENCE), [0.0, 0.0])
        every = np.column_stack([np.vstack([slope, rows]) * np.sqrt(len(states)), column])
        if not np.isfinite(every).all():
            return np.full((1, states.size), np.nan), np.full((1, states.size, states.size + 1), np.nan)
        left = np.linalg.svd(every)[0][:, : states.size].T
        return (left @ np.append(residual, aims))[None], (left @ every)[None]

    def onto(self, points: Array) -> Array:
        """The points: that moments have length one is among the equations."""
        return points

    def guess(self, states: Array) -> Array:
        """Unknowns (12 n,) of states (n, 12), n odd."""
        return np.asarray(states.ravel() / np.sqrt(len(states)))

    def solution(self, guess: Array, parameter: float) -> Array | None:
        """Unknowns (12 n + 1,) of the orbit near a guess (12 n,) at one value of the parameter."""
        values, plate = self.problem(parameter)
        found = orbit_near(self.rates, values, self.spin, plate, _states(guess))
        return None if found is None else np.append(self.guess(found.states), parameter / self.unit)

    def at(self, unknowns: Array, tangent: Array, parameter: float) -> OrbitPoint:
        """The orbit at a solution (12 n + 1,)."""
        states = _states(unknowns[:-1])
        problem = self._at(states, parameter)
        motion = floquet_modes(Orbit(states, *problem.whole(states), 0.0))
        time = float(problem.values[Parameter.TIME])
        return OrbitPoint(parameter=parameter, tangent=tangent, motion=motion, time_unit=time, states=states)

    def _at(self, states: Array, parameter: float) -> OrbitProblem:
        return OrbitProblem(self.rates, *self.problem(parameter), len(states))


def _states(unknowns: Array) -> Array:
    """States (n, 12) of unknowns (12 n,)."""
    states = unknowns.reshape(-1, 12)
    return np.asarray(states * np.sqrt(len(states)))
