"""What an effect changes of an equilibrium, to first order: its place, and how fast small motions grow."""

import numpy as np

from ...fem.mutual import MutualTable
from ...fem.rotor_losses import RotorLosses
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..effects import Mutual, brake_slope, rough_force
from ..motion import Parameter, Rates, Scales, parameters
from ..steady import Balance, Equilibrium, modes, tangent_basis


def shift_by_answers(
    scene: Scene, rates: Rates, table: FieldTable, equilibrium: Equilibrium, answers: MutualTable | None
) -> float:
    """How far mutual magnetisation moves an equilibrium, m; without its table to a factor of two."""
    fixed = equilibrium.without or equilibrium
    place, moment = fixed.position[None], fixed.state.moment[None]
    if answers is None:
        force, torque = rough_force(scene.rotor, scene.floater, table, place[0], moment[0]), np.zeros(3)
    else:
        effect = Mutual(answers, scene.floater.moment)
        force, torque = (part[0] for part in effect.wrench(place, moment, *table.evaluate(place)))
    return _shift(scene, rates, fixed, force, torque)


def _shift(scene: Scene, rates: Rates, fixed: Equilibrium, force: Array, torque: Array) -> float:
    """How far a force (3,) N and a torque (3,) N m move an equilibrium, m."""
    scales = Scales.of(scene)
    balance = Balance(rates, parameters(scene, scales, frozen_spin=True), fixed.spin)
    position, moment = fixed.position[None] / scales.length, fixed.state.moment[None]
    slope = balance(position, moment)[1][0]
    units = scales.time**2 / np.array([scene.floater.mass * scales.length, scene.floater.inertia])
    pushed = np.concatenate([force * units[0], tangent_basis(moment)[0] @ torque * units[1]])
    return float(np.linalg.norm(np.linalg.solve(slope, pushed)[:3]) * scales.length)


def growth_by_floater(scene: Scene, rates: Rates, equilibrium: Equilibrium) -> float:
    """What the floater's own currents add to the growth of what grows fastest, 1/s; `rates` know of them."""
    scales, fixed = Scales.of(scene), equilibrium.without or equilibrium
    values, state = parameters(scene, scales, frozen_spin=True), scales.pack(fixed.state)
    still = values.copy()
    still[Parameter.TILT_EDDY] = 0.0
    both = [modes(state, rates(state[None], each)[1][0]).growth for each in (values, still)]
    return (both[0] - both[1]) / scales.time


def growth_by_rotor(scene: Scene, rates: Rates, equilibrium: Equilibrium, losses: RotorLosses, included: bool) -> float:
    """What losses in the rotor add to the growth of what grows fastest, 1/s; whether `rates` include them."""
    scales, fixed = Scales.of(scene), equilibrium.without or equilibrium
    state = scales.pack(fixed.state)
    slope = rates(state[None], parameters(scene, scales, frozen_spin=True))[1][0]
    brake = brake_slope(losses, scene, fixed.state)
    without = slope - brake if included else slope
    return (modes(state, without + brake).growth - modes(state, without).growth) / scales.time
