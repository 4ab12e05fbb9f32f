"""What vanishes on a boundary of stability: the five balances of an equilibrium and one test, smooth across it.

- fold: the determinant of the balances' derivatives;
- crossing (Hopf): the real part of the pair of eigenvalues that crosses the imaginary axis;
- collision: -(λ₁ - λ₂)² of the two eigenvalues that meet on the imaginary axis.  Without drag, where the small motions
  are Hamiltonian, stability is lost in no other way but a fold (M. G. Krein, 1950): two frequencies become one, and
  beyond it one of the two motions grows.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from ..equilibria.balance import Balance, Indices, moved_pose
from ..equilibria.equilibrium import FOLD, EquilibriumError
from ..equilibria.modes import spectra
from ..equilibria.orbits import Orbit, OrbitProblem, floquet_modes
from ..equilibria.path import AtRest, Steps, near_curve, whole_curves
from ..equilibria.periodic import OrbitCurve
from ..motion.rates import Rates
from ..motion.state import Parameter
from .engine import REAL, BranchPoint, Solution

COLLISION, CROSSING = "collision", "crossing"
DIFFERENCE = 1e-5
"""Step of the central differences, good to 1e-10, from which the corrector converges to round-off all the same."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Two parameters of a scene.

    Parameters
    ----------
    rates : compiled once for the whole plane
    values : parameters (n,) and (n,) -> values (n, p) of the runtime parameters, drag along the moment left out
    spin : body spin s
    units : of the two, changes over which an equilibrium moves by about its radius
    lower, upper : (2,) corners of the part of the plane that is looked at
    """

    rates: Rates
    values: Callable[[Array, Array], Array]
    spin: float
    units: Array
    lower: Array
    upper: Array

    def holds(self, places: Array) -> NDArray[np.bool_]:
        """Which places (n, 2) lie in the part that is looked at."""
        return np.asarray(((places >= self.lower) & (places <= self.upper)).all(axis=1))


@dataclass(frozen=True, eq=False)
class BoundaryPoint:
    """A point of a boundary.

    Parameters
    ----------
    place : (2,) the two parameters
    position, moment : (3,) of the equilibrium there, scaled, and direction
    angular_frequency : of the motion that becomes unstable, in units of the rotor's; 0 at a fold
    """

    place: Array
    position: Array
    moment: Array
    angular_frequency: float


@dataclass(frozen=True, eq=False)
class Boundary(AtRest):
    """What vanishes on a boundary.

    Unknown are place, direction of the moment, the two parameters by their units, and the angular frequency of the
    motion that becomes unstable: (9,).

    Parameters
    ----------
    plane : the two parameters
    kind : "fold", "crossing" or "collision"
    scale : typical size of the determinant
    """

    plane: Plane
    kind: str
    scale: float

    def linear(self, points: Array, which: Indices) -> tuple[Array, Array]:
        """Balance, test, frequency and |m̂| = 1 (n, 8) at points (n, 9), and their derivatives (n, 8, 9)."""
        changes = np.concatenate([np.zeros((1, 7)), DIFFERENCE * np.eye(7), -DIFFERENCE * np.eye(7)])
        values = self._after(np.repeat(points, 15, axis=0), np.tile(changes, (len(points), 1))).reshape(-1, 15, 7)
        values[:, :, 6] -= points[:, None, 8]
        slope = np.zeros((len(points), 7, 8))
        slope[:, :, :7] = np.swapaxes(values[:, 1:8] - values[:, 8:], 1, 2) / (2 * DIFFERENCE)
        slope[:, 6, 7] = -1.0
        return self.extended(values[:, 0], slope, points[:, 3:6])

    def _after(self, at: Array, change: Array) -> Array:
        """Balance, test, frequency (n, 7) after changes (n, 7) of position, tilts, parameters at points (n, 9)."""
        position, moment = moved_pose(at[:, :3], at[:, 3:6], change[:, :5])
        place = (at[:, 6:8] + change[:, 5:]) * self.plane.units
        balance = Balance(self.plane.rates, self.plane.values(*place.T), self.plane.spin)
        value, slope = balance(position, moment)
        return np.column_stack([value, *self._test(balance, position, moment, slope, at[:, 8:])])

    def _test(self, balance: Balance, position: Array, moment: Array, slope: Array, near: Array) -> tuple[Array, Array]:
        if self.kind == FOLD:
            return np.linalg.det(slope) / self.scale, np.zeros(len(slope))
        states = balance.states(position, moment)
        values = spectra(states, balance.rates(states, balance.values)[1])[0]
        order = np.argsort(np.abs(values - 1j * near), axis=1)
        first, second = np.take_along_axis(values, order[:, :2], axis=1).T
        if self.kind == CROSSING:
            return first.real, first.imag
        return -np.real((first - second) ** 2), (first + second).imag / 2


DISSIPATIVE = [Parameter.LINEAR_DRAG, Parameter.TILT_DRAG, Parameter.TILT_EDDY]
STEPS = Steps(longest=0.1, shortest=1e-6, turn=0.2, most=500)


def follow_boundary(plane: Plane, start: BranchPoint, place: Array, kind: str | None = None) -> list[BoundaryPoint]:
    """The boundary through a marked point of a branch, both ways, until it leaves the plane's part or closes.

    Parameters
    ----------
    start : a point of `arclength.follow_branch` with a kind, "fold" or "oscillatory"
    place : (2,) the two parameters there
    kind : "fold", "collision" or "crossing"; None: that of the start, a collision where nothing damps the motion.
        A drag so weak that it moves frequencies by less than 1e-4 of the rotor's counts as none here: take "collision"

    Returns
    -------
    Points in order along the curve, good to round-off.

    Raises
    ------
    EquilibriumError : there is no such boundary near the start
    """
    state = start.state
    values = plane.values(*np.asarray(place, float)[:, None])[0]
    kind = kind or (FOLD if start.kind == FOLD else CROSSING if values[DISSIPATIVE].any() else COLLISION)
    slope = Balance(plane.rates, values, plane.spin)(state[None, :3], state[None, 6:9])[1][0]
    boundary = Boundary(plane, kind, float(np.prod(np.linalg.svd(slope)[1][:4])))
    frequency = 0.0 if kind == FOLD else 2 * np.pi * start.leading_hz * start.time_unit
    guess = np.concatenate([state[:3], state[6:9], place / plane.units, [frequency]])
    first = near_curve(boundary, guess, 1.0)
    found = (
        None
        if first is None
        else whole_curves(boundary, first[None], STEPS, lambda x: plane.holds(x[:, 6:8] * plane.units))[0]
    )
    if found is None:
        raise EquilibriumError(f"Input start must lie on a {kind} of the plane; instead there was none near it.")
    points = [BoundaryPoint(x[6:8] * plane.units, x[:3], x[3:6], float(x[8])) for x in found[0]]
    return [point for point in points if plane.holds(point.place[None])[0]]


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
