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

from ...geometry.basics import Array
from ..equilibria import AtRest
from ..motion import Rates
from ..steady import Balance, Indices, moved_pose, spectra
from .branch import FOLD

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
