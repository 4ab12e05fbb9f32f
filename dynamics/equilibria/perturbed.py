"""Equilibria under more than the field of their table: where they move to, growth rates, and a plate's mean action."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...fem.mutual.table import MutualTable
from ...fem.rotor.table import FieldTable
from ...fem.rotor_metal import RotorLosses
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..motion.coils import with_coils
from ..motion.effect import Interaction
from ..motion.equations import parameters
from ..motion.floater_effects import FloaterCurrents
from ..motion.plate import PlateForce, PlateMemory
from ..motion.rates import Rates
from ..motion.rotor_effects import Mutual, brake_slope, rough_force
from ..motion.state import Parameter, Scales, State
from .balance import CONVERGED_STEP, Balance, moved_pose, solve, tangent_basis
from .equilibrium import Equilibrium, free_directions, left_eigenvectors

TILTS = np.array([3, 4])  # of the unknowns of a `Balance`
MOST_STEPS = 20  # of the quasi-Newton method


def balanced_directions(scene: Scene, balance: Balance, places: Array, start: float, guess: Array) -> Array:
    """Moment directions (n, 3) whose torque is balanced at `places` (n, 3) m, a `scene`'s of which is the `balance`.

    Followed downwards and upwards from a distance `start` (m) below the rotor's origin: the first from a `guess` (3,),
    each other from its neighbour's, which stays where no balance is near.
    """
    result, depths = np.zeros_like(places), -places[:, 2]
    order = np.argsort(depths)
    for chain in (order[depths[order] >= start], order[::-1][depths[order[::-1]] < start]):
        direction = guess
        for k in chain:
            _, moment, step = solve(balance, places[None, k] / scene.floater.radius, direction[None], TILTS)
            direction = result[k] = moment[0] if step[0] < CONVERGED_STEP else direction
    return result


def shifted_equilibrium(
    scene: Scene,
    balance: Balance,
    position: Array,
    moment: Array,
    extra: Callable[[Array, Array], tuple[Array, Array]],
    tolerance: float = 1e-7,
) -> tuple[Array, Array]:
    """Follow an equilibrium to where additional forces put it.

    Quasi-Newton from the table's own Jacobian (C. G. Broyden, Math. Comp. 19 (1965) 577). Returns the shift (3,) m to
    first order, and the new position (3,) m; NaN if none was reached. `scene` and `balance` are without the additional
    forces; the equilibrium has `position` (3,) m and direction `moment`; `extra` gives the additional force (3,) N and
    torque (3,) N m, rotor's frame, of both; `tolerance` is that of the place, in radii of the floater.
    """
    scales, floater = Scales.of(scene), scene.floater

    def residual(position: Array, moment: Array) -> Array:
        value = balance(position[None], moment[None])[0][0]
        force, torque = extra(position * scales.length, moment)
        value[:3] += force * scales.time**2 / (floater.mass * scales.length)
        value[3:] += tangent_basis(moment[None])[0] @ torque * scales.time**2 / floater.inertia
        return np.asarray(value)

    position = position / scales.length
    inverse, left = np.linalg.inv(balance(position[None], moment[None])[1][0]), residual(position, moment)
    step = -inverse @ left
    linear = step[:3] * scales.length
    for _ in range(MOST_STEPS):
        (position,), (moment,) = moved_pose(position[None], moment[None], step[None])
        place = position * scales.length
        if np.linalg.norm(step) < tolerance:
            return linear, place
        if np.linalg.norm(step) > 1.0 or any(body.distance(place) <= floater.radius for body in scene.turning_bodies):
            break
        new = residual(position, moment)
        change = inverse @ (new - left)
        inverse = inverse + np.outer(step - change, step @ inverse) / (step @ change)
        left, step = new, -inverse @ new
    return linear, np.full(3, np.nan)


def plate_action(scene: Scene, memory: PlateMemory, equilibrium: Equilibrium) -> dict[str, Any]:
    """The plate's mean force (3,) N and torque (3,) N m, along the laboratory's axes, and the heat in it, W.

    Raises ValueError for an `equilibrium` of the `scene` that was found without the plate's currents (`memory`).
    """
    if equilibrium.turn is None or equilibrium.currents is None:
        raise ValueError("Input equilibrium must have been found with the plate's currents; instead received none.")
    scales, floater, count = Scales.of(scene), scene.floater, len(equilibrium.currents)
    times = 2 * np.pi * np.arange(count) / count
    states = replace(scales, pointing=None).pack(equilibrium.turn)  # the plate knows the moment alone
    coupling = PlateForce(memory, parameters(scene, scales, frozen_spin=True))(times, states)
    root_energy = np.sqrt(floater.mass) * scales.length / scales.time
    currents = equilibrium.currents / root_energy - coupling.signals
    push = np.einsum("aix,ai->ax", coupling.fields, currents) / scales.time**2
    force, torque = push[:, :3] * floater.mass * scales.length, push[:, 3:] * floater.inertia
    lab = State(force, force, torque, torque).to_lab(times)
    loss = np.einsum("ai,i,ai->a", currents, memory.table.rates, currents).mean() * root_energy**2
    return {"force": lab.position.mean(axis=0), "torque": lab.moment.mean(axis=0), "loss": loss}


def shift_by_mutual(scene: Scene, table: FieldTable, equilibrium: Equilibrium, answers: MutualTable | None) -> float:
    """Shift (m) of an `equilibrium` of `scene` in `table` by mutual magnetisation; no `answers`: to a factor of 2."""
    fixed = equilibrium.without or equilibrium
    place, moment, scales = fixed.position[None], fixed.state.moment[None], Scales.of(scene)
    if answers is None:
        force, torque = rough_force(scene.rotor, scene.floater, table, place[0], moment[0]), np.zeros(3)
    else:
        effect = Mutual(answers, scene.floater.moment)
        force, torque = (part[0] for part in effect.wrench(place, moment, *table.evaluate(place)))
    units = scales.time**2 / np.array([scene.floater.mass * scales.length, scene.floater.inertia])
    turn = tangent_basis(moment)[0] @ torque
    if fixed.state.axes is not None:  # along the body's
        turn = fixed.state.axes.T @ torque * (scene.floater.inertia / scene.floater.principal_inertia)
    pushed = np.concatenate([force * units[0], turn * units[1]])
    return float(np.linalg.norm(np.linalg.solve(fixed.slope, pushed)[:3]) * scales.length)


def growth_by_floater(scene: Scene, table: FieldTable, equilibrium: Equilibrium, included: bool) -> float:
    """Change (1/s) of an `equilibrium`'s fastest growth by own currents, in `table` of `scene` `included` or not."""
    fixed = equilibrium.without or equilibrium
    scales = Scales.of(scene)
    values = parameters(scene, scales, frozen_spin=True)
    still = values.copy()
    still[Parameter.TILT_EDDY] = 0.0
    effect, turning = FloaterCurrents.of(scene), not scene.floater.round
    assert effect is not None
    rates = Rates(Interaction(with_coils(scene, table).field, (effect,), turning))
    slopes = [rates(scales.pack(fixed.state)[None], each)[1][0] for each in (values, still)]
    return _growth(scene, fixed, slopes[0] - slopes[1], included)


def growth_by_rotor(scene: Scene, equilibrium: Equilibrium, losses: RotorLosses, included: bool) -> float:
    """Change (1/s) of an `equilibrium`'s fastest growth by `losses` in the rotor of `scene`, `included` or not."""
    fixed = equilibrium.without or equilibrium
    return _growth(scene, fixed, brake_slope(losses, scene, fixed.state), included)


def _growth(scene: Scene, fixed: Equilibrium, brake: Array, included: bool) -> float:
    # To first order, of the mode that grows fastest with it: the fastest one without it may be another mode, and the
    # difference of their growth rates is no effect.
    scales = Scales.of(scene)
    tangents, projections = free_directions(scales.pack(fixed.state))
    whole = fixed.jacobian if included else fixed.jacobian + brake
    values, right = np.linalg.eig(projections @ whole @ tangents)
    leading = int(np.argmax(values.real))
    added = left_eigenvectors(right)[leading] @ (projections @ brake @ tangents) @ right[:, leading]
    return float(added.real) / scales.time
