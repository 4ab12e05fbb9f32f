"""Where a synchronous equilibrium moves to when more acts on the floater than the field of its table."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...fem.harmonics.interior import Ball
from ...fem.harmonics.local import BallField
from ...fem.mutual.table import MutualTable
from ...fem.rotor.table import FieldTable
from ...fem.rotor_metal import RotorLosses
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..motion.effect import Interaction
from ..motion.equations import parameters
from ..motion.floater_currents import FloaterCurrents
from ..motion.mutual import Mutual, rough_force
from ..motion.plate import PlateForce, PlateMemory
from ..motion.rates import Rates
from ..motion.rotor_losses import brake_slope
from ..motion.state import Parameter, Scales, State
from .balance import CONVERGED_STEP, Balance, moved_pose, solve, tangent_basis
from .equilibrium import Equilibrium
from .modes import left_eigenvectors, tangent_spaces

# Position (3,) m and moment direction (3,) -> additional force (3,) N and torque (3,) N m, rotor's frame.
Extra = Callable[[Array, Array], tuple[Array, Array]]
TILTS = np.array([3, 4])
MOST = 20  # Steps of the quasi-Newton method


@dataclass(frozen=True, eq=False)
class Shift:
    """How an equilibrium moves."""

    linear: Array  # (3,) m, by the additional force and torque at the old place and the rigidity of the old balance
    # position, moment: (3,) m and (3,) the new equilibrium; NaN if none was reached
    position: Array
    moment: Array


def balanced_directions(scene: Scene, balance: Balance, places: Array, start: float, guess: Array) -> Array:
    """Moment directions (n, 3) whose torque is balanced, followed downwards and upwards from `start` (m) below.

    Parameters
    ----------
    scene, balance : a scene's
    places : (n, 3) m
    start : distance below the rotor's origin, m
    guess : (3,) for the first ones; each other begins at its neighbour's, which stays where no balance is near
    """
    result, depths = np.zeros_like(places), -places[:, 2]
    downwards = [k for k in np.argsort(depths) if depths[k] >= start]
    upwards = [k for k in np.argsort(-depths) if depths[k] < start]
    for chain in (downwards, upwards):
        direction = guess
        for k in chain:
            _, moment, step = solve(balance, places[None, k] / scene.floater.radius, direction[None], TILTS)
            direction = result[k] = moment[0] if step[0] < CONVERGED_STEP else direction
    return result


def shifted_equilibrium(
    scene: Scene, balance: Balance, position: Array, moment: Array, extra: Extra, tolerance: float = 1e-7
) -> Shift:
    """Follow an equilibrium to where additional forces put it.

    Quasi-Newton from the table's own Jacobian (C. G. Broyden, Math. Comp. 19 (1965) 577).

    Parameters
    ----------
    scene, balance : a scene's, without the additional forces
    position, moment : (3,) m and direction of the equilibrium
    extra : the additional forces
    tolerance : of the place, in radii of the floater
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
    for _ in range(MOST):
        (position,), (moment,) = moved_pose(position[None], moment[None], step[None])
        place = position * scales.length
        if np.linalg.norm(step) < tolerance:
            return Shift(linear, place, moment)
        if np.linalg.norm(step) > 1.0 or any(body.distance(place) <= floater.radius for body in scene.turning_bodies):
            break
        new = residual(position, moment)
        change = inverse @ (new - left)
        inverse = inverse + np.outer(step - change, step @ inverse) / (step @ change)
        left, step = new, -inverse @ new
    return Shift(linear, np.full(3, np.nan), np.full(3, np.nan))


@dataclass(frozen=True, eq=False)
class PlateAction:
    """Means over a turn, along the laboratory's axes."""

    force: Array  # (3,) N
    torque: Array  # (3,) N m
    loss: float  # heat in the plate, W


def plate_action(scene: Scene, memory: PlateMemory, equilibrium: Equilibrium) -> PlateAction:
    """The plate's mean force, torque and loss in a synchronous equilibrium that feels it.

    Raises
    ------
    ValueError : the equilibrium was found without the plate's currents
    """
    if equilibrium.turn is None or equilibrium.currents is None:
        raise ValueError("Input equilibrium must have been found with the plate's currents; instead received none.")
    scales, floater = Scales.of(scene), scene.floater
    force = PlateForce(memory, parameters(scene, scales, frozen_spin=True))
    count = len(equilibrium.currents)
    times = 2 * np.pi * np.arange(count) / count
    heard = force(times, scales.pack(equilibrium.turn))
    root_energy = np.sqrt(floater.mass) * scales.length / scales.time
    currents = equilibrium.currents / root_energy - heard.signals
    push = np.einsum("aix,ai->ax", heard.fields, currents)
    units = floater.mass * scales.length / scales.time**2, floater.inertia / scales.time**2
    lab = State(push[:, :3] * units[0], push[:, :3], push[:, 3:] * units[1], push[:, 3:]).to_lab(times)
    loss = np.einsum("ai,i,ai->a", currents, memory.table.rates, currents).mean() * root_energy**2
    return PlateAction(lab.position.mean(axis=0), lab.moment.mean(axis=0), float(loss))


EXACT_SLOPES = 4  # Degree of a potential that has all derivatives which the slopes of the floater's currents ask for
AROUND = 1 / 32  # Radius of the ball of that expansion, in radii of the floater


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
