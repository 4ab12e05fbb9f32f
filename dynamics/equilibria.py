"""All synchronous equilibria of a floater: fixed points in the frame that turns with the rotor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from ..fem.table import FieldTable
from ..geometry.box import Array
from ..geometry.scene import Scene
from .balance import AXIAL, Balance, solve
from .curves import Curve, all_curves
from .equations import Parameter, parameters
from .rates import Rates
from .stability import modes
from .state import Scales, State

EVERY = np.arange(5)


class EquilibriumError(RuntimeError):
    """There is no synchronous equilibrium, or not of the kind that was asked for."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One synchronous equilibrium, along the rotor's axes.

    Parameters
    ----------
    state : position m, velocity m/s, moment direction, spin rad/s
    spin : body spin s = Ω·m̂/ω
    residual : largest unbalanced acceleration, as a part of gravity (or of ω²R without gravity)
    position_error : estimated error of the position, from round-off and from the table's own error, m
    stable : whether every small motion stays small; with drag, whether it dies out
    growth_per_s : largest growth rate of a small motion, 1/s
    growth_error_per_s : what round-off may do to it, 1/s
    frequencies_hz : (k,) frequencies of the small motions in the rotor's frame
    """

    state: State
    spin: float
    residual: float
    position_error: float
    stable: bool
    growth_per_s: float
    growth_error_per_s: float
    frequencies_hz: Array

    @property
    def position(self) -> Array:
        """(3,) m."""
        return self.state.position

    @property
    def distance(self) -> float:
        """Distance from the rotor's origin, m."""
        return float(np.linalg.norm(self.position))

    @property
    def polar_angle_deg(self) -> float:
        """Angle between the moment and +z."""
        return float(np.degrees(np.arctan2(np.hypot(*self.state.moment[:2]), self.state.moment[2])))

    @property
    def lag_deg(self) -> float:
        """Angle by which the moment's azimuth is behind the rotor's +x, in (-180, 180]."""
        x, y = self.state.moment[:2]
        lag = float(np.degrees(np.arctan2(-y, x)))
        return 180.0 if lag < -180 + 1e-9 else lag


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Axial force where everything else is balanced: figure "force against distance".

    Parameters
    ----------
    position : (n, 3) m, rotor's frame
    moment : (n, 3) direction
    magnetic_force : (n,) along +z, N
    weight : the force that it has to balance, along +z, N
    """

    position: Array
    moment: Array
    magnetic_force: Array
    weight: float


@dataclass(frozen=True, eq=False)
class Survey:
    """Equilibria sorted by distance, and the curves on which they lie."""

    equilibria: tuple[Equilibrium, ...]
    curves: tuple[ForceCurve, ...]


def find_equilibria(
    scene: Scene, table: FieldTable, spin: float = 0.0, farthest: float = 0.1, rates: Rates | None = None
) -> list[Equilibrium]:
    """All synchronous equilibria below the rotor, sorted by distance; see `survey`."""
    return list(survey(scene, table, spin, farthest, rates).equilibria)


def survey(
    scene: Scene, table: FieldTable, spin: float = 0.0, farthest: float = 0.1, rates: Rates | None = None
) -> Survey:
    """All synchronous equilibria with z < 0 between contact with the rotor and `farthest`, with their stability.

    Parameters
    ----------
    scene : the scene; its plate is left out
    table : the rotor's field
    spin : body spin s = Ω·m̂/ω, which magnetic torque does not change
    farthest : largest depth, and distance from the axis, m
    rates : `Rates` of the same table, to compile them once for many scenes

    Returns
    -------
    Equilibria accurate to round-off in the table's field: every curve of lateral balance that is met from some two
    thousand starts at sixteen heights is followed, and every zero of the axial force on it is polished.

    Raises
    ------
    EquilibriumError : the rotor is at rest, or gravity is not along its axis
    """
    _check(scene)
    scales = Scales.of(scene)
    balance = Balance(rates or Rates(table), parameters(scene, scales, frozen_spin=True), spin)
    bound = farthest / scales.length
    curves = all_curves(balance, _starts(scene, scales, bound), partial(_inside, scene, scales, bound))
    guesses = [curve.balanced() for curve in curves]
    position = np.concatenate([np.zeros((0, 3)), *(p for p, _ in guesses)])
    moment = np.concatenate([np.zeros((0, 3)), *(m for _, m in guesses)])
    found = [
        _equilibrium(scene, table, scales, balance, r, m)
        for r, m in _polished(balance, position, moment)
        if _inside(scene, scales, bound, r)
    ]
    found.sort(key=lambda equilibrium: equilibrium.distance)
    return Survey(tuple(found), tuple(_force_curve(scene, scales, curve) for curve in curves))


def _check(scene: Scene) -> None:
    if not scene.frequency:
        raise EquilibriumError(
            "At 0 Hz nothing levitates: a magnet has no stable equilibrium in a static field and gravity "
            "(S. Earnshaw, 1842), and no synchronous one without a turning rotor. Give the rotor a frequency."
        )
    if np.any(scene.gravity[:2]):
        raise EquilibriumError(
            f"Gravity {scene.gravity.tolist()} m/s² is not along the rotor's axis, so that the floater's motion is "
            "periodic in the rotor's frame and no fixed point exists. Put gravity along z, or simulate the motion."
        )


def _inside(scene: Scene, scales: Scales, bound: float, position: Array) -> bool:
    """Whether a scaled position (3,) belongs to the range of the search."""
    if position[2] > 0 or position[2] < -bound or np.hypot(position[0], position[1]) > bound:
        return False
    return all(magnet.box.distance(position * scales.length) > scales.length for magnet in scene.rotor)


def _starts(scene: Scene, scales: Scales, bound: float) -> tuple[Array, Array]:
    """Positions and moments (n, 3) below the rotor and beside it, in fourteen directions each."""
    corners = [magnet.box.corners / scales.length for magnet in scene.rotor]
    nearest = 1.0 + max((-c[:, 2].min() for c in corners), default=0.0)
    beside = 1.0 + np.array([1.0, 1.1, 1.3, 2.0]) * max((np.abs(c[:, :2]).max() for c in corners), default=0.0)
    below = -np.geomspace(nearest, max(bound, nearest), 16)
    position = [_rings(below, np.array([0.0, 0.15, 0.7]), 4), _rings(np.array([-0.01, -0.1, -0.4, -0.9]), beside, 8)]
    moment = np.array([v for v in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, v)) in (1.0, 3.0)])
    moment /= np.linalg.norm(moment, axis=1, keepdims=True)
    places = np.concatenate(position)
    return np.repeat(places, len(moment), axis=0), np.tile(moment, (len(places), 1))


def _rings(heights: Array, radii: Array, number: int) -> Array:
    """Points (n, 3) on rings about the axis, `number` on each."""
    angle = np.arange(number) * (2 * np.pi / number)
    return np.array([(r * np.cos(a), r * np.sin(a), z) for z in heights for r in radii for a in angle[: number if r else 1]])


def _polished(balance: Balance, position: Array, moment: Array) -> list[tuple[Array, Array]]:
    """Distinct zeros of all five balances near the guesses (n, 3), to round-off."""
    if not len(position):
        return []
    position, moment, step = solve(balance, position, moment, EVERY)
    points: list[tuple[Array, Array]] = []
    for r, m, size in zip(position, moment, step, strict=True):
        if size < 1e-8 and not any(np.linalg.norm(r - q) + np.linalg.norm(m - n) < 1e-6 for q, n in points):
            points.append((r, m))
    return points


def _equilibrium(
    scene: Scene, table: FieldTable, scales: Scales, balance: Balance, position: Array, moment: Array
) -> Equilibrium:
    state = balance.states(position[None], moment[None])
    value, slope = balance(position[None], moment[None])
    motion = modes(state[0], balance.rates(state, balance.values)[1][0])
    gravity = abs(balance.values[Parameter.GRAVITY_Z])
    fields = table.evaluate(position * scales.length)
    relative = table.relative_error(position * scales.length)
    torque = balance.values[Parameter.TORQUE]
    force = torque * balance.values[Parameter.INERTIA] * scales.length
    doubt_of_force = force * float(np.linalg.norm(fields[1]) * relative[1][0])
    doubt_of_torque = torque * float(np.linalg.norm(fields[0]) * relative[0][0])
    doubt = np.abs(value[0]) + np.array([doubt_of_force] * 3 + [doubt_of_torque] * 2)
    error = float(np.linalg.norm((np.abs(np.linalg.inv(slope[0])) @ doubt)[:3]))
    return Equilibrium(
        state=scales.unpack(state[0]),
        spin=balance.spin,
        residual=float(np.abs(value).max() / (gravity or 1.0)),
        position_error=error * scales.length,
        stable=motion.stable,
        growth_per_s=motion.growth / scales.time,
        growth_error_per_s=float(motion.errors.max()) / scales.time,
        frequencies_hz=motion.angular_frequencies / (2 * np.pi * scales.time),
    )


def _force_curve(scene: Scene, scales: Scales, curve: Curve) -> ForceCurve:
    weight = scene.floater.mass * float(scene.gravity[2])
    unit = scene.floater.mass * scales.length / scales.time**2
    return ForceCurve(curve.position * scales.length, curve.moment, curve.force * unit - weight, weight)
