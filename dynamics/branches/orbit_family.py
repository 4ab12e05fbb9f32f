"""Periodic motions as a function of one parameter: gravity's angle, the plate's distance, anything else.

Unknown are the floater's states at instants of a turn, as in `orbit`, and the parameter.  Stability is lost where a
Floquet multiplier leaves the unit circle: at +1 (a fold, or a crossing of branches), at -1 (period doubling) or as a
pair (Neimark-Sacker).
"""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ..equilibria import OrbitCurve, Steps
from ..motion import Parameter
from ..steady import Orbit, OrbitProblem, floquet_modes
from .branch import REAL, Solution

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


class OrbitFamily(OrbitCurve):
    """A periodic motion as a function of one parameter, see `OrbitCurve`; with its stability."""

    def at(self, unknowns: Array, tangent: Array, parameter: float) -> OrbitPoint:
        """The orbit at a solution (12 n + 1,)."""
        states = self.states(unknowns[:-1])
        values, plate = self.problem(parameter)
        problem = OrbitProblem(self.rates, values, plate, len(states))
        motion = floquet_modes(Orbit(states, *problem.whole(states), 0.0))
        time = float(values[Parameter.TIME])
        return OrbitPoint(parameter=parameter, tangent=tangent, motion=motion, time_unit=time, states=states)
