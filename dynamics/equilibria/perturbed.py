"""Where a synchronous equilibrium moves to when more acts on the floater than the field of its table."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..effects import with_effects
from ..motion import Rates, Scales, parameters
from ..steady import Balance, moved_pose, solve, tangent_basis

Extra = Callable[[Array, Array], tuple[Array, Array]]
"""Position (3,) m and moment direction (3,) -> additional force (3,) N and torque (3,) N m, rotor's frame."""
TILTS = np.array([3, 4])
MOST = 20
"""Steps of the quasi-Newton method."""


@dataclass(frozen=True, eq=False)
class Shift:
    """How an equilibrium moves.

    Parameters
    ----------
    linear : (3,) m, by the additional force and torque at the old place and the rigidity of the old balance
    position, moment : (3,) m and (3,) the new equilibrium; NaN if none was reached
    """

    linear: Array
    position: Array
    moment: Array


@dataclass(frozen=True, eq=False)
class PerturbedBalance:
    """Balance of a floater at rest in the rotor's frame with additional forces."""

    balance: Balance
    scales: Scales
    scene: Scene

    @classmethod
    def of(cls, scene: Scene, table: FieldTable, spin: float = 0.0) -> Self:
        """The balance in a table's field, for body spin s."""
        scales = Scales.of(scene)
        return cls(
            Balance(Rates(with_effects(scene, table)), parameters(scene, scales, frozen_spin=True), spin), scales, scene
        )

    def direction(self, position: Array, guess: Array) -> Array:
        """Moment direction (3,) whose torque is balanced at a place (3,) m; `guess` itself if none is near."""
        place = position[None] / self.scales.length
        _, moment, step = solve(self.balance, place, guess[None], TILTS)
        return np.asarray(moment[0] if step[0] < 1e-8 else guess)

    def directions(self, places: Array, start: float, guess: Array) -> Array:
        """Balanced moment directions (n, 3) at places (n, 3) m, followed downwards and upwards from `start` (m) below.

        Each begins at its neighbour's, the first ones at `guess`.
        """
        result = np.zeros_like(places)
        depths = -places[:, 2]
        downwards = [k for k in np.argsort(depths) if depths[k] >= start]
        upwards = [k for k in np.argsort(-depths) if depths[k] < start]
        for chain in (downwards, upwards):
            direction = guess
            for k in chain:
                direction = result[k] = self.direction(places[k], direction)
        return result

    def shift(self, position: Array, moment: Array, extra: Extra, tolerance: float = 1e-7) -> Shift:
        """Follow an equilibrium, position (3,) m and moment direction (3,), to where the additional forces put it.

        Quasi-Newton from the table's own Jacobian (C. G. Broyden, Math. Comp. 19 (1965) 577), to `tolerance` of the
        floater's radius.
        """
        position = position / self.scales.length
        inverse = np.linalg.inv(self.balance(position[None], moment[None])[1][0])
        residual = self._residual(position, moment, extra)
        step = -inverse @ residual
        linear = step[:3] * self.scales.length
        for _ in range(MOST):
            places, moments = moved_pose(position[None], moment[None], step[None])
            position, moment = places[0], moments[0]
            if np.linalg.norm(step) < tolerance:
                return Shift(linear, position * self.scales.length, moment)
            if np.linalg.norm(step) > 1.0 or not self._free(position):
                break
            new = self._residual(position, moment, extra)
            change = inverse @ (new - residual)
            inverse = inverse + np.outer(step - change, step @ inverse) / (step @ change)
            residual, step = new, -inverse @ new
        return Shift(linear, np.full(3, np.nan), np.full(3, np.nan))

    def _free(self, position: Array) -> bool:
        place = position * self.scales.length
        return all(body.distance(place) > self.scene.floater.radius for body in self.scene.turning_bodies)

    def _residual(self, position: Array, moment: Array, extra: Extra) -> Array:
        value = self.balance(position[None], moment[None])[0][0]
        force, torque = extra(position * self.scales.length, moment)
        floater, square = self.scene.floater, self.scales.time**2
        value[:3] += force * square / (floater.mass * self.scales.length)
        value[3:] += tangent_basis(moment[None])[0] @ torque * square / floater.inertia
        return np.asarray(value)
