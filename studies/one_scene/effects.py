"""What acts on the floater beyond the rigid dipole: in the motion or not, and what it changes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...dynamics.effects import FLOATER_CURRENTS, MUTUAL, Mutual, rough_force
from ...dynamics.motion import Parameter, Scales, parameters
from ...dynamics.steady import Balance, Equilibrium, modes, tangent_basis
from ...fem.closed_forms import rotating_torque
from ...geometry.basics import MAGNET_CONDUCTIVITY, Array
from .levitation import Levitation


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
    return [_mutual(levitation, first), _floater_currents(levitation, first)]


def _mutual(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    answers, why = levitation.answers
    shift = None
    if first is not None and why != "neither rotor nor floater is permeable":
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
    scene = levitation.scene
    if scene.floater.conductivity:
        growth = None
        if first is not None:
            fixed, values = first.without or first, parameters(scene, Scales.of(scene), frozen_spin=True)
            state = Scales.of(scene).pack(fixed.state)
            still = values.copy()
            still[Parameter.TILT_EDDY] = 0.0
            both = [modes(state, levitation.rates(state[None], v)[1][0]).growth for v in (values, still)]
            growth = (both[0] - both[1]) / Scales.of(scene).time
        return ListedEffect(FLOATER_CURRENTS, True, 0.0, growth, "floater.conductivity_S_m is given")
    why = "no floater.conductivity_S_m"
    if first is not None:
        across = float(np.linalg.norm(np.cross(levitation.table.evaluate(first.position)[0][0], first.state.moment)))
        relative = scene.frequency * (1 - first.spin)
        torque = float(rotating_torque(scene.floater.radius, MAGNET_CONDUCTIVITY, relative, across))
        drag = scene.drag.angular * scene.angular_velocity
        why += (
            f"; at {MAGNET_CONDUCTIVITY:.2g} S/m they would drive its spin with about {torque:.1e} N m "
            f"(drag at the rotor's rate: {drag:.1e} N m)"
        )
    return ListedEffect(FLOATER_CURRENTS, False, 0.0, None, why)


def effects_answer(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> dict[str, Any]:
    """The interaction and the list of effects, for JSON."""
    found = listed_effects(levitation, equilibria)
    return {"interaction": levitation.interaction_model, "effects": [vars(effect) for effect in found]}


def effects_lines(effects: Sequence[dict[str, Any]]) -> list[str]:
    """The same as a table for a person."""
    lines = [f"{'Effect':26} {'in the motion':14} {'shift (mm)':>10} {'growth (1/s)':>12}  why"]
    for effect in effects:
        shift, growth = ("-" if effect[key] is None else f"{effect[key]:.2g}" for key in ("shift_mm", "growth_per_s"))
        told = "yes" if effect["included"] else "no"
        lines.append(f"{effect['name']:26} {told:14} {shift:>10} {growth:>12}  {effect['why']}")
    return lines
