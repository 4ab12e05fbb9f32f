"""Equilibria and small motions of a floater that is more than a rigid dipole: rotor and floater magnetise each other.

The force and torque beyond the rigid dipole's are smooth and small. About an equilibrium they are taken as linear in
place and direction of the moment, which gives the exact equilibrium and the exact linear motion once the point about
which they were expanded is the equilibrium itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...fem.harmonics import Ball
from ...fem.mutual import RotorResponse, enough_degree, two_body
from ...geometry.basics import Array
from ...geometry.scenes import Floater
from ..motion import Parameter, Rates
from ..steady import EquilibriumError, moved_pose, tangent_basis
from .branch import BranchPoint, Family

STEP, SHORTEST = 0.02, 1e-3
"""Of the central differences, in floater radii and rad; their error is of its square, 1e-4 of the slope."""
POSE, ACCELERATED = np.array([0, 1, 2, 6, 7, 8]), np.array([3, 4, 5, 9, 10, 11])
"""Places in the state of position and moment, and of velocity and spin."""
TAIL, SERIES = 1e-6, 1e-8
"""Part of what the answers add that higher degrees hold, and part of the permanent sources at which their series ends:
a hundredth of what finite elements of degree two leave open."""
RENEWED, SETTLED, MOST = 1e-3, 1e-5, 8
"""Changes of the equilibrium (radii, rad) above which slopes are taken anew, and below which it is found; trials."""


@dataclass(frozen=True, eq=False)
class Mutual:
    """What the magnetisation of both bodies by each other adds to the rigid dipole's force and torque.

    Parameters
    ----------
    rotor : finite elements of the rotor
    floater : the sphere
    """

    rotor: RotorResponse
    floater: Floater

    def __call__(self, position: Array, moment: Array) -> Array:
        """Force (3,) N and torque (3,) N m in one vector (6,), at scaled position (3,) and direction (3,)."""
        center = position * self.floater.radius
        degree = enough_degree(self.rotor.magnets, Ball(center, self.floater.radius), TAIL)
        both = two_body(self.rotor, self.floater, center, moment, degree, SERIES)
        extra = both.total - both.rigid
        return np.concatenate([extra.force, extra.torque])

    def constant(self, position: Array, moment: Array) -> Expansion:
        """The value alone."""
        center = np.concatenate([position, moment])
        return Expansion(center, self(position, moment), np.zeros((6, 6)), self.floater)

    def expanded(self, position: Array, moment: Array) -> Expansion:
        """Value and slopes by central differences, whose steps are shorter where the bodies are about to touch."""
        columns, size = [], float(np.clip(0.9 * self._gap(position), SHORTEST, STEP))
        for step in np.eye(5) * size:
            ends = [moved_pose(position[None], moment[None], sign * step[None]) for sign in (1, -1)]
            columns.append((self(*(part[0] for part in ends[0])) - self(*(part[0] for part in ends[1]))) / (2 * size))
        across = np.zeros((5, 6))
        across[:3, :3], across[3:, 3:] = np.eye(3), tangent_basis(moment[None])[0]
        return replace(self.constant(position, moment), slope=np.column_stack(columns) @ across)

    def _gap(self, position: Array) -> float:
        """Distance between the bodies, in floater radii."""
        center, radius = position * self.floater.radius, self.floater.radius
        return min(float(magnet.box.distance(center)) / radius for magnet in self.rotor.magnets) - 1


@dataclass(frozen=True, eq=False)
class Expansion:
    """A force and torque (6,) that is linear about a scaled position and direction `center` (6,)."""

    center: Array
    value: Array
    slope: Array
    floater: Floater

    def about(self, position: Array, moment: Array, value: Array) -> Expansion:
        """The same slopes about another pose, where the force and torque are `value`."""
        return replace(self, center=np.concatenate([position, moment]), value=value)

    def added(self, rates: Rates) -> Rates:
        """Rates of the motion with the force and torque in it."""
        return _Answered(rates, self)


class _Answered(Rates):
    def __init__(self, rates: Rates, extra: Expansion) -> None:
        floater = extra.floater
        self._rates, self._extra = rates, extra
        self._per_unit = np.repeat([1 / (floater.mass * floater.radius), 1 / floater.inertia], 3)

    def __call__(self, states: ArrayLike, values: Array) -> tuple[Array, Array]:
        states = np.asarray(states, float)
        rates, slopes = self._rates(states, values)
        push, change = self._added(states[:, POSE], values)
        rates[:, ACCELERATED] += push
        slopes[:, ACCELERATED[:, None], POSE] += change
        return rates, slopes

    def balance(
        self, position: Array, moment: Array, tangents: Array, spin: Array, values: Array
    ) -> tuple[Array, Array]:
        value, slope = self._rates.balance(position, moment, tangents, spin, values)
        push, change = self._added(np.concatenate([position, moment], axis=1), values)
        across = np.swapaxes(tangents, 1, 2)
        change = np.concatenate([change[:, :, :3], change[:, :, 3:] @ across], axis=2)
        value = value + np.concatenate([push[:, :3], (push[:, None, 3:] @ across)[:, 0]], axis=1)
        slope = slope + np.concatenate([change[:, :3], tangents @ change[:, 3:]], axis=1)
        slope[:, [3, 4], [3, 4]] -= np.sum(moment * push[:, 3:], axis=1)[:, None]  # the tangents turn with the moment
        return value, slope

    def _added(self, poses: Array, values: Array) -> tuple[Array, Array]:
        """Accelerations (n, 6) at poses (n, 6), scaled, and their derivatives (n, 6, 6)."""
        scale = np.broadcast_to(values[..., Parameter.TIME], len(poses))[:, None] ** 2 * self._per_unit
        push = scale * (self._extra.value + (poses - self._extra.center) @ self._extra.slope.T)
        return push, scale[:, :, None] * self._extra.slope


def settled(
    family: Family,
    mutual: Mutual,
    start: BranchPoint,
    find: Callable[[Family, BranchPoint], BranchPoint],
    expansion: Expansion | None = None,
) -> BranchPoint:
    """What `find` finds once force and torque are expanded about it.

    Parameters
    ----------
    family : equilibria of the rigid dipole
    start : a first guess
    find : takes the equilibria with the force and torque in them, and the last guess
    expansion : the first one; without it the force and torque at `start`

    Raises EquilibriumError where `find` does or where it does not settle.
    """
    here = start
    expansion = expansion or mutual.constant(*pose(here))
    for k in range(MOST):
        new = find(replace(family, rates=expansion.added(family.rates)), here)
        change = np.abs(np.concatenate(pose(new)) - np.concatenate(pose(here))).max()
        here = new
        if k and change < SETTLED:
            return here
        if k == 0 or change > RENEWED:
            expansion = mutual.expanded(*pose(here))
        else:
            expansion = expansion.about(*pose(here), mutual(*pose(here)))
    raise EquilibriumError("The answers of rotor and floater to each other did not settle on an equilibrium.")


def pose(point: BranchPoint) -> tuple[Array, Array]:
    """Scaled place and direction of the moment, (3,) each."""
    return point.state[:3], point.state[6:9]
