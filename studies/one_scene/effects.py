"""What acts on the floater beyond the rigid dipole: in the motion or not, and what it changes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...dynamics.effects import (
    FLOATER_CURRENTS,
    MUTUAL,
    REAL_AIR,
    ROTOR_CURRENTS,
    Mutual,
    brake_slope,
    reynolds,
    rough_force,
    swinging,
)
from ...dynamics.motion import Parameter, Scales, parameters
from ...dynamics.steady import Balance, Equilibrium, modes, tangent_basis
from ...fem.rotor_losses import RotorLosses, ball_losses, pieces_of
from ...geometry.basics import MAGNET_CONDUCTIVITY, Array
from .levitation import Levitation
from .mutual_choice import NOTHING_ANSWERS

PLATE_NOT_MODELLED = "The plate's eddy currents are left out: the plate is only an obstacle."


@dataclass(frozen=True)
class ListedEffect:
    """One effect.

    Parameters
    ----------
    name : of the effect
    included : whether it is in the motion
    shift_mm : how far it moves the first equilibrium, about; None where that is not known
    growth_per_s : what it adds to the fastest growth there, about; None where that is not known
    why : it is in the motion or not
    """

    name: str
    included: bool
    shift_mm: float | None
    growth_per_s: float | None
    why: str


def listed_effects(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> list[ListedEffect]:
    """All effects that are known, with what they do to the first of the equilibria."""
    first = next(iter(equilibria), None)
    return [part(levitation, first) for part in (_mutual, _rotor_currents, _floater_currents, _air)]


def _mutual(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    answers, why = levitation.answers
    shift = None
    if first is not None and why != NOTHING_ANSWERS:
        place, direction = first.position[None], first.state.moment[None]
        field, gradient = levitation.table.evaluate(place)
        if answers is not None:
            effect = Mutual(answers, levitation.scene.floater.moment)
            force, torque = (part[0] for part in effect.wrench(place, direction, field, gradient))
        else:
            scene = levitation.scene
            force, torque = (
                rough_force(scene.rotor, scene.floater, levitation.table, place[0], direction[0]),
                np.zeros(3),
            )
        shift = _shift(levitation, first, force, torque) * 1e3
    return ListedEffect(MUTUAL, answers is not None, shift, None, why)


def _shift(levitation: Levitation, first: Equilibrium, force: Array, torque: Array) -> float:
    """How far a force (3,) N and a torque (3,) N m move an equilibrium, m, to first order."""
    scene, scales = levitation.scene, Scales.of(levitation.scene)
    balance = Balance(levitation.rates, parameters(scene, scales, frozen_spin=True), first.spin)
    fixed = first.without or first
    position, moment = fixed.position[None] / scales.length, fixed.state.moment[None]
    slope = balance(position, moment)[1][0]
    units = scales.time**2 / np.array([scene.floater.mass * scales.length, scene.floater.inertia])
    pushed = np.concatenate([force * units[0], tangent_basis(moment)[0] @ torque * units[1]])
    return float(np.linalg.norm(np.linalg.solve(slope, pushed)[:3]) * scales.length)


def _floater_currents(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    """Those of the scene, or what those of a sintered magnet would be."""
    floater = levitation.scene.floater
    why, conducting = "floater.conductivity_S_m is given", levitation
    if not floater.conductivity:
        why = f"no floater.conductivity_S_m; about this at {MAGNET_CONDUCTIVITY:.2g} S/m"
        conducting = levitation.elsewhere(floater=replace(floater, conductivity=MAGNET_CONDUCTIVITY))
    growth = None
    if first is not None and levitation.scene.frequency:
        scene, fixed = conducting.scene, first.without or first
        values, state = parameters(scene, Scales.of(scene), frozen_spin=True), Scales.of(scene).pack(fixed.state)
        still = values.copy()
        still[Parameter.TILT_EDDY] = 0.0
        both = [modes(state, conducting.rates(state[None], v)[1][0]).growth for v in (values, still)]
        growth = (both[0] - both[1]) / Scales.of(scene).time
    return ListedEffect(FLOATER_CURRENTS, bool(floater.conductivity), 0.0, growth, why)


def _rotor_currents(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    """Those of the scene, or what those of sintered magnets, taken as balls, would be."""
    scene, name, growth = levitation.scene, ROTOR_CURRENTS, None
    magnets = [replace(magnet, conductivity=MAGNET_CONDUCTIVITY) for magnet in scene.rotor]
    losses = levitation.losses or (ball_losses(pieces_of(magnets, ())) if magnets else None)
    if first is not None and losses is not None and scene.frequency:
        growth = _growth_by(levitation, first, losses)
    if levitation.losses is not None:
        return ListedEffect(name, True, 0.0, growth, "conductivity_S_m of the rotor's metal is given")
    why = f"no rotor.conductivity_S_m; about this at {MAGNET_CONDUCTIVITY:.2g} S/m"
    return ListedEffect(name, False, 0.0, growth, why)


def _growth_by(levitation: Levitation, first: Equilibrium, losses: RotorLosses) -> float:
    """What losses in the rotor add to the growth of what grows fastest, 1/s: eigenvalues with them and without."""
    scene, scales, fixed = levitation.scene, Scales.of(levitation.scene), first.without or first
    state, values = scales.pack(fixed.state), parameters(scene, Scales.of(scene), frozen_spin=True)
    slope = levitation.rates(state[None], values)[1][0]
    brake = brake_slope(losses, scene, fixed.state)
    included = levitation.losses is not None
    both = [modes(state, slope - brake).growth, modes(state, slope).growth] if included else [
        modes(state, slope).growth, modes(state, slope + brake).growth]  # fmt: skip
    return (both[1] - both[0]) / scales.time


def _air(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    if levitation.scene.drag.air:
        return ListedEffect(REAL_AIR, True, 0.0, None, 'drag.model is "air"')
    scene = levitation.scene
    h = float(swinging(reynolds(scene.floater.radius, scene.angular_velocity)))
    why = f'drag.model is not "air"; it would make the torque on a swing {h:.2g} times Stokes\''
    return ListedEffect(REAL_AIR, False, 0.0, None, why)


def effects_answer(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> dict[str, Any]:
    """The interaction, the list of effects, and in sentences what is in the scene but not in the motion, for JSON."""
    found = listed_effects(levitation, equilibria)
    missing = [PLATE_NOT_MODELLED] if levitation.scene.plate and levitation.plate is None else []
    missing += [f"Left out: {e.name} ({e.why})." for e in found if not e.included and e.why != NOTHING_ANSWERS]
    return {
        "interaction": levitation.interaction_model,
        "effects": [vars(effect) for effect in found],
        "not_modelled": missing,
    }
