"""Folds and losses of stability as curves in the plane of two parameters of a scene.

Beside the five balances one more number shall vanish, the test of the boundary.  Seven unknowns (place, direction of
the moment, two parameters) leave a curve, which is followed by its arc length (W. J. F. Govaerts, Numerical Methods for
Bifurcations of Dynamical Equilibria, 2000, ch. 4).  The tests are smooth across the boundary:

- fold: the determinant of the balances' derivatives;
- crossing (Hopf): the real part of the pair of eigenvalues that crosses the imaginary axis;
- collision: -(λ₁ - λ₂)² of the two eigenvalues that meet on the imaginary axis.  Without drag, where the small motions
  are Hamiltonian, stability is lost in no other way but a fold (M. G. Krein, 1950): two frequencies become one, and
  beyond it one of the two motions grows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.box import Array
from .balance import Balance, moved, tangent_basis
from .branch import FOLD, Point
from .equilibrium import EquilibriumError
from .rates import Rates
from .stability import spectra
from .symbols import Parameter

COLLISION, CROSSING = "collision", "crossing"
DISSIPATIVE = [Parameter.LINEAR_DRAG, Parameter.TILT_DRAG, Parameter.TILT_EDDY]
DIFFERENCE = 1e-5
"""Step of the central differences, good to 1e-10, from which the corrector converges to round-off all the same."""
LONGEST, SHORTEST, MOST, TURN = 0.1, 1e-6, 500, 0.2


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

    def holds(self, place: Array) -> bool:
        """Whether a place (2,) lies in the part that is looked at."""
        return bool(np.all((place >= self.lower) & (place <= self.upper)))


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
class _Boundary:
    plane: Plane
    kind: str
    scale: float

    def residual(self, at: BoundaryPoint, change: Array) -> tuple[Array, Array]:
        """What shall vanish (n, 6) after changes (n, 7) of a point, and the imaginary part (n,) that is followed."""
        here = np.zeros((len(change), 3))
        position, moment = moved(here + at.position, here + at.moment, change[:, :5])
        place = at.place + change[:, 5:] * self.plane.units
        balance = Balance(self.plane.rates, self.plane.values(*place.T), self.plane.spin)
        value, slope = balance(position, moment)
        test, frequency = self._test(balance, position, moment, slope, at.angular_frequency)
        return np.column_stack([value, test]), frequency

    def _test(self, balance: Balance, position: Array, moment: Array, slope: Array, near: float) -> tuple[Array, Array]:
        if self.kind == FOLD:
            return np.linalg.det(slope) / self.scale, np.zeros(len(slope))
        states = balance.states(position, moment)
        values = spectra(states, balance.rates(states, balance.values)[1])[0]
        order = np.argsort(np.abs(values - 1j * near), axis=1)
        first, second = np.take_along_axis(values, order[:, :2], axis=1).T
        if self.kind == CROSSING:
            return first.real, first.imag
        return -np.real((first - second) ** 2), (first + second).imag / 2


def follow_boundary(plane: Plane, start: Point, place: Array, kind: str | None = None) -> list[BoundaryPoint]:
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
    boundary = _Boundary(plane, kind, float(np.prod(np.linalg.svd(slope)[1][:4])))
    frequency = 0.0 if kind == FOLD else 2 * np.pi * start.leading_hz * start.time_unit
    guess = BoundaryPoint(np.asarray(place, float), state[:3], state[6:9], frequency)
    first = _corrected(boundary, guess, None)
    if first is None:
        raise EquilibriumError(f"Input start must lie on a {kind} of the plane; instead there was none near it.")
    ahead, closed = _half(boundary, first, 1.0)
    return [first, *ahead] if closed else [*_half(boundary, first, -1.0)[0][::-1], first, *ahead]


def _half(boundary: _Boundary, start: BoundaryPoint, sense: float) -> tuple[list[BoundaryPoint], bool]:
    """Points after `start`, and whether they came back to it."""
    tangent = sense * _tangent(boundary, start, None)
    here, step, points = start, LONGEST / 10, list[BoundaryPoint]()
    while len(points) < MOST and step > SHORTEST:
        new = _corrected(boundary, _stepped(boundary, here, step * _local(here, tangent)), tangent)
        turned = None if new is None else _tangent(boundary, new, tangent)
        if new is None or turned is None or turned @ tangent < np.cos(TURN) or _apart(boundary, new, here) > 2 * step:
            step /= 2
            continue
        if not boundary.plane.holds(new.place):
            break
        points.append(new)
        if len(points) > 3 and _apart(boundary, new, start) < step:
            return points, True
        here, tangent, step = new, turned, min(1.4 * step, LONGEST)
    return points, False


def _corrected(boundary: _Boundary, guess: BoundaryPoint, tangent: Array | None) -> BoundaryPoint | None:
    """The nearest point of the boundary, across the tangent (8,) if there is one; None where Newton's method fails."""
    point = guess
    for _ in range(10):
        value, slope, frequency = _linear(boundary, point)
        if not np.isfinite(slope).all():
            return None
        if tangent is None:
            change = -np.asarray(np.linalg.lstsq(slope, value, rcond=None)[0])
        else:
            matrix = np.vstack([slope, _local(point, tangent)])
            change = -np.asarray(np.linalg.lstsq(matrix, np.append(value, 0.0), rcond=None)[0])
        size = float(np.linalg.norm(change))
        if size > 1.0:
            return None
        point = _stepped(boundary, replace(point, angular_frequency=frequency), change)
        if size < 1e-10:
            return point
    return None


def _linear(boundary: _Boundary, at: BoundaryPoint) -> tuple[Array, Array, float]:
    """Residual (6,), its derivatives (6, 7) and the frequency at a point."""
    changes = np.concatenate([np.zeros((1, 7)), DIFFERENCE * np.eye(7), -DIFFERENCE * np.eye(7)])
    values, frequencies = boundary.residual(at, changes)
    return values[0], (values[1:8] - values[8:]).T / (2 * DIFFERENCE), float(frequencies[0])


def _stepped(boundary: _Boundary, at: BoundaryPoint, change: Array) -> BoundaryPoint:
    position, moment = moved(at.position[None], at.moment[None], change[None, :5])
    return replace(at, position=position[0], moment=moment[0], place=at.place + change[5:] * boundary.plane.units)


def _tangent(boundary: _Boundary, at: BoundaryPoint, before: Array | None) -> Array:
    """Unit direction (8,) of the boundary: place, direction of the moment, parameters by their units."""
    along = np.linalg.svd(_linear(boundary, at)[1])[2][6]
    tangent = np.concatenate([along[:3], along[3:5] @ tangent_basis(at.moment[None])[0], along[5:]])
    return tangent if before is None or tangent @ before > 0 else -tangent


def _local(at: BoundaryPoint, tangent: Array) -> Array:
    """A direction (8,) in the seven unknowns of a point."""
    return np.concatenate([tangent[:3], tangent_basis(at.moment[None])[0] @ tangent[3:6], tangent[6:]])


def _apart(boundary: _Boundary, a: BoundaryPoint, b: BoundaryPoint) -> float:
    places = (a.place - b.place) / boundary.plane.units
    return float(np.linalg.norm(np.concatenate([a.position - b.position, a.moment - b.moment, places])))
