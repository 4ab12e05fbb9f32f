"""Periodic motions as a function of one parameter: gravity's angle, the plate's distance, anything else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ..motion import Parameter, PlateForce, Rates
from ..steady import Modes, OrbitProblem, kept


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

    def at(self, states: Array, parameter: float) -> OrbitProblem:
        """The equations of an orbit at one value of the parameter."""
        return OrbitProblem(self.rates, *self.problem(parameter), len(states))

    def linear(self, states: Array, parameter: float) -> tuple[Array, Array]:
        """What shall vanish (12 n + 2,), and its derivatives (12 n + 2, 12 n + 1), the last by parameter/unit."""
        problem, step = self.at(states, parameter), 1e-5
        residual, slope = problem(states)
        ends = [self.at(states, parameter + s * step * self.unit)(states)[0] for s in (1, -1)]
        rows, aims = kept(states, self.spin * abs(problem.values[Parameter.RATE]))
        column = np.append((ends[0] - ends[1]) / (2 * step), [0.0, 0.0])
        return np.append(residual, aims), np.column_stack([np.vstack([slope, rows]), column])


@dataclass(frozen=True, eq=False)
class OrbitPoint:
    """One periodic motion of a branch.

    Parameters
    ----------
    parameter : where on the axis of the parameter
    states : (n, 12) scaled, at equidistant instants of a turn
    tangent : (12 n + 1,) unit direction of the branch, the parameter by its unit
    motion : Floquet's modes, in scaled time
    kind : what is marked here: "fold", "real", "period doubling", "Neimark-Sacker"; "" at an ordinary point
    """

    parameter: float
    states: Array
    tangent: Array
    motion: Modes
    kind: str = ""

    @property
    def excess(self) -> float:
        """Largest growth above its own error, scaled; positive where the motion is unstable."""
        return float((self.motion.eigenvalues.real - self.motion.errors).max())

    @property
    def leaving(self) -> complex:
        """The largest multiplier."""
        rates = self.motion.eigenvalues
        return complex(np.exp(2 * np.pi * rates[np.argmax(rates.real)]))
