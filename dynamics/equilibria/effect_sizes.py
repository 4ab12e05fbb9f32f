"""What an effect changes of an equilibrium, to first order: its place, and how fast small motions grow."""

import numpy as np

from ...fem.harmonics import Ball, BallField
from ...fem.mutual import MutualTable
from ...fem.rotor_losses import RotorLosses
from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..effects import FloaterCurrents, Mutual, brake_slope, rough_force
from ..motion import Interaction, Parameter, Rates, Scales, State, parameters
from ..steady import Equilibrium, left_eigenvectors, tangent_basis, tangent_spaces

EXACT_SLOPES = 4
"""Degree of a potential that has all derivatives which the slopes of the floater's currents ask for."""
AROUND = 1 / 32
"""Radius of the ball of that expansion, in radii of the floater."""


def shift_by_answers(scene: Scene, table: FieldTable, equilibrium: Equilibrium, answers: MutualTable | None) -> float:
    """How far mutual magnetisation moves an equilibrium, m; without its table to a factor of two."""
    fixed = equilibrium.without or equilibrium
    place, moment = fixed.position[None], fixed.state.moment[None]
    if answers is None:
        force, torque = rough_force(scene.rotor, scene.floater, table, place[0], moment[0]), np.zeros(3)
    else:
        effect = Mutual(answers, scene.floater.moment)
        force, torque = (part[0] for part in effect.wrench(place, moment, *table.evaluate(place)))
    scales = Scales.of(scene)
    units = scales.time**2 / np.array([scene.floater.mass * scales.length, scene.floater.inertia])
    pushed = np.concatenate([force * units[0], tangent_basis(moment)[0] @ torque * units[1]])
    return float(np.linalg.norm(np.linalg.solve(fixed.slope, pushed)[:3]) * scales.length)


def growth_by_floater(scene: Scene, table: FieldTable, equilibrium: Equilibrium, included: bool) -> float:
    """What the floater's own currents add to the growth of the mode that grows fastest with them, 1/s.

    `included`: whether the motion of the equilibrium had them.
    """
    fixed = equilibrium.without or equilibrium
    return _growth(scene, fixed, floater_slope(scene, table, fixed.state), included)


def growth_by_rotor(scene: Scene, equilibrium: Equilibrium, losses: RotorLosses, included: bool) -> float:
    """What losses in the rotor add to the growth of the mode that grows fastest with them, 1/s; see above."""
    fixed = equilibrium.without or equilibrium
    return _growth(scene, fixed, brake_slope(losses, scene, fixed.state), included)


def _growth(scene: Scene, fixed: Equilibrium, brake: Array, included: bool) -> float:
    """What a part (12, 12) of the Jacobian, which it has or has not, adds to the growth, 1/s.

    To first order, of the mode that grows fastest with it: the fastest one without it may be another mode, and the
    difference of their growth rates is no effect.
    """
    scales = Scales.of(scene)
    tangents, projections = (found[0] for found in tangent_spaces(scales.pack(fixed.state)[None]))
    whole = fixed.jacobian if included else fixed.jacobian + brake
    values, right = np.linalg.eig(projections @ whole @ tangents)
    leading = int(np.argmax(values.real))
    added = left_eigenvectors(right)[leading] @ (projections @ brake @ tangents) @ right[:, leading]
    return float(added.real) / scales.time


def floater_slope(scene: Scene, table: FieldTable, state: State) -> Array:
    """(12, 12): what the floater's currents add to the derivatives of the scaled rates at a state.

    In the field's expansion about the place, whose derivatives there are the field's, code is compiled in a tenth
    of the time that the table's own expressions take.
    """
    formula = BallField(len(Parameter), EXACT_SLOPES)
    numbers, _ = formula.fit(table.evaluate, Ball(state.position, AROUND * scene.floater.radius))
    scales = Scales.of(scene)
    values = np.concatenate([parameters(scene, scales, frozen_spin=True), numbers])
    still = values.copy()
    still[Parameter.TILT_EDDY] = 0.0
    rates = Rates(Interaction(formula, (FloaterCurrents(),)))
    slopes = [rates(scales.pack(state)[None], each)[1][0] for each in (values, still)]
    return np.asarray(slopes[0] - slopes[1])
