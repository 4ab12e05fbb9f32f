"""Derivatives of an equilibrium and its modes by a number of its scene: implicit differentiation.

With the equations of a periodic motion F(x, p) = 0 (a fixed point is one of one instant), dx/dp = -F_x⁻¹ F_p.  A mode
e^{λτ} v(τ) solves T(λ) v = 0 with the pencil of `orbits.Pencil`, and with its left vector u

    dλ/dp = -uᴴ (dT/dp) v / uᴴ T_λ v,

where dT is that along the tangent (x + h dx/dp, p + h), so that it has the shift of the equilibrium in it (A. Andrew,
K.-W. E. Chu and P. Lancaster, SIAM J. Matrix Anal. Appl. 14 (1993) 903).  The plate's states are eliminated from both.

Of p are differenced the equations at a fixed state alone, smooth functions of the step; no equilibrium is sought anew.
Equations of different p are each in their own units: as F and T v vanish, the units' change by p adds nothing.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from ..motion.plate import PlateForce
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales, State
from .equilibrium import Equilibrium, Mode
from .orbits import CONVERGED, ROUNDED, SHAKING, OrbitProblem, Pencil, conserved, one_sided

SINGULAR = 1e-9  # Smallest singular value of F_x, by the largest, below which the equilibrium is at a fold to round-off
SLOWEST = 1e-7  # λ of a mode, rad⁻¹, that is no eigenvalue but one of the kept |m̂| and body spin
COLLIDED = 1e-7  # |uᴴ T_λ v| by ‖T_λ v‖ below which two eigenvalues have met, where they have no derivative
STEP = 1e-5  # Of differences along the tangent of what is a plain function of the state, scaled
ALONG = 5e-4  # Of differences of F of fourth order along it: where both their errors are 1e-12
NEWTON_STEPS, FARTHEST = 20, 0.5  # Most steps to an equilibrium nearby, and the longest, in floater radii and rad
POLISHED = 3  # Steps of Newton's method that make a known λ one of the pencil
SOLVED = 10.0  # Relative error of a derivative, by the Newton step that is left at the equilibrium, in radii and rad


@dataclass(frozen=True, eq=False)
class Setting:
    """The equations of motion of a scene, in its own units."""

    scales: Scales
    rates: Rates
    values: Array  # runtime parameters, drag along the moment left out
    plate: PlateForce | None = None

    def linear(self, turn: State, spin: float, like: Array | None = None) -> tuple[Array, Pencil, Array, Array]:
        """Residual (m n,) and pencil of n states (n, 3), and what is `conserved` with a body `spin` s.

        m is 12, or 13 of a body that is not round; `like` as of `packed`.
        """
        states, values = self.packed(turn, like), self.values
        if len(states) == 1:  # what shakes a fixed point moves its mean to second order alone
            values = values.copy()
            values[SHAKING] = 0.0
        residual, pencil = OrbitProblem(self.rates, values, self.plate, len(states)).linear(states)
        rate = abs(float(self.values[Parameter.RATE]))
        return residual, pencil, *conserved(states, spin * self.scales.spin_ratio * rate)

    def packed(self, turn: State, like: Array | None = None) -> Array:
        """Scaled states (n, m), `one_sided` with a state `like` (m,) or the first, as differences need them."""
        states = self.scales.pack(turn)
        return one_sided(states, states[0] if like is None else like) if self.rates.turning else states

    def jacobi(self, turn: State) -> float:
        """Jacobi integral of a fixed point, energy less ω times the angular momentum about the axis, J."""
        scaled = self.rates.jacobi(self.scales.pack(turn), self.values)[0]
        return float(scaled / self.values[Parameter.PLATE_SHARE] ** 2)


@dataclass(frozen=True, eq=False)
class Nearby:
    """Equations at p + `offset`, with the weight of what they give in the derivative by p."""

    offset: float
    weight: float
    lower: float  # its weight in a difference of two orders less, which tells how far the derivative may be off
    setting: Setting


@dataclass(frozen=True, eq=False)
class _ModeAt:
    name: str
    value: complex  # λ per unit of scaled time
    left: NDArray[Any]
    right: NDArray[Any]
    speed: complex  # uᴴ T_λ v; 0 where it has no derivative


@dataclass(frozen=True, eq=False)
class Tangent:
    """The way of an equilibrium by one number."""

    start: Array  # (n, m) scaled states
    change: Array  # (n, m) their derivatives
    modes: dict[str, complex]  # derivatives of growth rate + 2πi frequency of each mode, 1/s
    unpack: Callable[[Array], Equilibrium] = field(repr=False)
    unsolved: float = 0.0  # relative error by how far the equilibrium is off
    lower: "Tangent | None" = field(default=None, repr=False)  # by differences of two orders less
    without: "Tangent | None" = field(default=None, repr=False)  # of the fixed point that it is without the plate

    def of(self, quantity: Callable[[Equilibrium], Any]) -> Array:
        """Derivative of a function of the motion alone, such as its distance."""
        size = float(np.abs(self.change).max())
        if not np.isfinite(size):
            return np.full(np.shape(quantity(self.unpack(self.start))), np.nan)
        if not size:
            return np.zeros(np.shape(quantity(self.unpack(self.start))))
        step = STEP / size
        ends = [np.asarray(quantity(self.unpack(self.start + s * step * self.change)), float) for s in (1, -1, 2, -2)]
        return np.asarray((8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * step))


def _eigenvalue(pencil: Pencil, near: _ModeAt, value: complex) -> complex:
    """An eigenvalue of a pencil, by inverse iteration from one nearby (A. Ruhe, SIAM J. Numer. Anal. 10 (1973) 674)."""
    right = near.right
    for _ in range(POLISHED if np.isfinite(value) else 0):
        slope = (pencil.applied(right, value + STEP) - pencil.applied(right, value - STEP)) / (2 * STEP)
        try:
            after = np.linalg.solve(pencil.matrix(value), slope)
        except np.linalg.LinAlgError:  # it is one to the last bit
            break
        change = complex(np.vdot(near.right, right) / np.vdot(near.right, after))
        right, value = after / np.linalg.norm(after), value - change
        if abs(change) < CONVERGED:
            break
    return value


class Implicit:
    """An equilibrium's equations, factorised for derivatives by many numbers."""

    def __init__(self, known: Equilibrium, setting: Setting) -> None:
        self.known, self.setting = known, setting
        turn = known.turn or known.state[None]
        self.start = setting.packed(turn)
        residual, self._pencil, rows, aims = setting.linear(turn, known.spin)
        left, values, right = np.linalg.svd(np.vstack([self._pencil.matrix(0.0), rows]), full_matrices=False)
        self.conditioning = float(values[-1] / values[0])  # zero at a fold
        self._lost = left[:, -1]  # what balances no change of the state there
        self._inverse = (right.T / values) @ left.T
        self.unsolved = SOLVED * float(np.abs(self._inverse @ np.append(residual, aims)).max())

    @property
    def at_fold(self) -> bool:
        """Whether the equilibrium is at a fold, where it has no derivatives."""
        return self.conditioning < SINGULAR

    @cached_property
    def modes(self) -> list[_ModeAt]:
        scale = 2j * np.pi * self.setting.scales.time
        given = [m.growth_per_s * self.setting.scales.time + scale * m.frequency_hz for m in self.known.modes]
        return [self._mode(mode.name, complex(value)) for mode, value in zip(self.known.modes, given, strict=True)]

    def _mode(self, name: str, value: complex) -> _ModeAt:
        left = right = np.zeros(self.start.size)
        speed = 0j
        for _ in range(POLISHED):
            vectors, _, rows = np.linalg.svd(self._pencil.matrix(value or 1e-300))
            left, right = vectors[:, -1], rows[-1].conj()
            ends = [self._pencil.applied(right, value + s * STEP) for s in (1, -1)]
            speed = complex(np.vdot(left, (ends[0] - ends[1]) / (2 * STEP)))
            if abs(speed) < COLLIDED or abs(value) < SLOWEST:
                return _ModeAt(name, value, left, right, 0j)
            value -= np.vdot(left, self._pencil.applied(right, value)) / speed
        return _ModeAt(name, value, left, right, speed)

    def _linear(self, setting: Setting, turn: State) -> tuple[Array, Pencil, Array, Array]:
        return setting.linear(turn, self.known.spin, self.start[0])

    def missed(self, nearby: Sequence[Nearby]) -> Array:
        """F_p (2, m n + 2 or 1) by a number, from the equations at some values of it, and that of two orders less."""
        turn, found = self.setting.scales.unpack(self.start), np.zeros((2, self._inverse.shape[1]))
        for there in nearby:
            residual, _, _, aims = self._linear(there.setting, turn)
            found += np.outer([there.weight, there.lower], np.append(residual, aims))
        return found

    def fold_by(self, missed: Array, by_parameter: Array) -> Array:
        """Derivatives (2,) of the parameter of a fold, here, by a number, from what both have `missed`."""
        return np.asarray(-(missed @ self._lost) / (by_parameter @ self._lost))

    def _along(self, change: Array) -> Array:
        """Derivative (m n + 2 or 1,) of F along a change of a periodic motion's states.

        F_x has the brake of the rotor's metal at each instant's place as if it did not change with the place, which is
        exact where the floater rests in the rotor's frame alone, and else leaves 5e-6 of a derivative.
        """
        size, ends = float(np.abs(change).max()) or 1.0, []
        for steps in (1, -1, 2, -2):
            states = self.start + (steps * ALONG / size) * change.reshape(self.start.shape)
            residual, _, _, aims = self._linear(self.setting, self.setting.scales.unpack(states))
            ends.append(np.append(residual, aims))
        return (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) * (size / (12 * ALONG))

    def by(self, nearby: Sequence[Nearby]) -> Tangent:
        """The way by a number, from the equations at some values of it."""
        scales = self.setting.scales
        missed = self.missed(nearby)
        changes = (np.nan if self.at_fold else -1.0) * missed @ self._inverse.T
        if self.known.turn is not None and not self.at_fold:
            changes[0] -= self._inverse @ (missed[0] + self._along(changes[0]))
        change, lower = changes.reshape(2, *self.start.shape)
        lost = complex(np.nan, np.nan)
        by = {mode.name: np.full(2, 0j if not self.at_fold and mode.speed else lost) for mode in self.modes}
        faster = 0.0  # derivative of the unit of the eigenvalues
        for there in nearby:
            faster += there.weight / there.setting.scales.time
            if self.at_fold:
                continue
            pencil = self._linear(there.setting, scales.unpack(self.start + there.offset * change))[1]
            for mode in self.modes:
                if mode.speed:
                    found = np.vdot(mode.left, pencil.applied(mode.right, mode.value))
                    by[mode.name] -= np.array([there.weight, there.lower]) * complex(found) / mode.speed
        rates = [
            {mode.name: complex(by[mode.name][k]) / scales.time + mode.value * faster for mode in self.modes}
            for k in range(2)
        ]
        below = Tangent(self.start, lower, rates[1], self._equilibrium)
        return Tangent(self.start, change, rates[0], self._equilibrium, self.unsolved, below)

    def jacobi_by(self, nearby: Sequence[Nearby]) -> Array:
        """Derivatives (2,) of a fixed point's Jacobi integral, J, as of `missed`."""
        change = -(self._inverse @ self.missed(nearby)[0]).reshape(self.start.shape)
        found, scales = np.zeros(2), self.setting.scales
        for there in nearby:
            energy = there.setting.jacobi(scales.unpack(self.start + there.offset * change))
            found += energy * np.array([there.weight, there.lower])
        return found

    def moved(
        self, setting: Setting, tangents: Sequence[tuple[float, Tangent]], with_modes: bool = True
    ) -> Equilibrium | None:
        """The equilibrium that equations nearby have, by Newton's method from where tangents lead; None where none is.

        `setting`: the equations; `tangents`: steps of numbers with the way by each; `with_modes`: whether its modes are
        computed, or left as they are.
        """
        scales = setting.scales
        begun = self.start + sum((step * way.change for step, way in tangents), np.zeros_like(self.start))
        states = self._solved(setting, setting.packed(self.setting.scales.unpack(begun), self.start[0]))
        if states is None:
            return None
        if not with_modes:
            return self._equilibrium(self.setting.packed(scales.unpack(states), self.start[0]))
        modes, pencil = [], self._linear(setting, scales.unpack(states))[1]
        for mode in self.modes:
            rate = mode.value / self.setting.scales.time + sum(step * way.modes[mode.name] for step, way in tangents)
            value = _eigenvalue(pencil, mode, complex(rate) * scales.time)
            modes.append(Mode(mode.name, value.real / scales.time, abs(value.imag) / (2 * np.pi * scales.time)))
        growth = max((mode.growth_per_s for mode in modes), default=np.nan)
        found = self._equilibrium(self.setting.packed(scales.unpack(states), self.start[0]))
        return replace(found, modes=tuple(modes), growth_per_s=growth)

    def _solved(self, setting: Setting, states: Array) -> Array | None:
        """States (n, m) near others that are in balance."""
        size = np.inf
        for _ in range(NEWTON_STEPS):
            residual, pencil, rows, aims = self._linear(setting, setting.scales.unpack(states))
            step = np.linalg.lstsq(np.vstack([pencil.matrix(0.0), rows]), -np.append(residual, aims))[0]
            before, size = size, float(np.abs(step).max())
            if not size < FARTHEST:
                return None
            states = states + step.reshape(states.shape)
            if size < CONVERGED or before / 2 < size < ROUNDED:
                return states
        return None

    def _equilibrium(self, states: Array) -> Equilibrium:
        mean = states.mean(axis=0)
        mean[6:-3] /= np.linalg.norm(mean[6:-3])
        scales = self.setting.scales
        turn = None if self.known.turn is None else scales.unpack(states)
        return replace(self.known, state=scales.unpack(mean), turn=turn)
