"""What acts on the floater beyond the rigid dipole: in the motion or not, and what it changes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..dynamics.equilibria.equilibrium import Equilibrium
from ..dynamics.equilibria.perturbed import growth_by_floater, growth_by_rotor, shift_by_answers
from ..dynamics.motion.air_and_shape import REAL_AIR, reynolds, swinging
from ..dynamics.motion.effects import NOTHING_ANSWERS
from ..dynamics.motion.floater_currents import FLOATER_CURRENTS, SLOW_ENOUGH, slow_error
from ..dynamics.motion.mutual import MUTUAL
from ..dynamics.motion.rotor_losses import ROTOR_CURRENTS
from ..fem.rotor_metal import ball_losses, pieces_of, slow_error as metal_error
from ..geometry.common import MAGNET_CONDUCTIVITY
from .levitation import Levitation

PLATE_NOT_MODELLED = "The plate's eddy currents are left out: the plate is only an obstacle."

UNKNOWN_NEAR = "the floater is so near to the magnets that their size is not known"
OF_SPHERES = "known for spherical floaters alone"


@dataclass(frozen=True)
class ListedEffect:
    """One effect.

    Parameters
    ----------
    name : of the effect
    included : whether it is in the motion
    shift_mm : how far it moves the first equilibrium, about; None where that is not known
    growth_per_s : what it adds there to the growth of the mode that grows fastest with it, about; None where that is
        not known
    why : it is in the motion or not
    motion_error : relative error of what it adds, or would, to the growth of motions: they are taken as slow against it
    """

    name: str
    included: bool
    shift_mm: float | None
    growth_per_s: float | None
    why: str
    motion_error: float = 0.0


def effects_summary(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> dict[str, Any]:
    """For JSON: the interaction, all effects that are known with what they do to the first of the equilibria, and in
    sentences what is in the scene but not in the motion."""
    first = next(iter(equilibria), None)
    found = [part(levitation, first) for part in (_mutual, _rotor_currents, _floater_currents, _air)]
    missing = [PLATE_NOT_MODELLED] if levitation.scene.plate and levitation.plate is None else []
    missing += [f"Left out: {e.name} ({e.why})." for e in found if not e.included and e.why != NOTHING_ANSWERS]
    return {
        "interaction": levitation.interaction_model,
        "effects": [vars(effect) for effect in found],
        "not_modelled": missing,
    }


def _mutual(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    (answers, why), shift = levitation.answers, None
    if first is not None and why != NOTHING_ANSWERS and levitation.scene.floater.body is None:
        shift = 1e3 * shift_by_answers(levitation.scene, levitation.table, first, answers)
    return ListedEffect(MUTUAL, answers is not None, shift, None, why)


def _floater_currents(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    """Those of the scene, or what those of a sintered magnet would be."""
    scene, floater, growth = levitation.scene, levitation.scene.floater, None
    if floater.body is not None:
        return ListedEffect(FLOATER_CURRENTS, False, None, None, OF_SPHERES)
    there = replace(scene, floater=replace(floater, conductivity=floater.conductivity or MAGNET_CONDUCTIVITY))
    doubt = slow_error(there)
    if first and scene.frequency and doubt <= SLOW_ENOUGH:
        growth = growth_by_floater(there, levitation.table, first, bool(floater.conductivity))
    listed = _conducting(FLOATER_CURRENTS, "floater.conductivity_S_m", bool(floater.conductivity), growth, doubt)
    return replace(listed, motion_error=doubt)


def _rotor_currents(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    """Those of the scene, or what those of sintered magnets, taken as balls, would be."""
    scene, growth, included = levitation.scene, None, levitation.losses is not None
    if scene.floater.body is not None:
        return ListedEffect(ROTOR_CURRENTS, False, None, None, OF_SPHERES)
    pieces = pieces_of([replace(magnet, conductivity=MAGNET_CONDUCTIVITY) for magnet in scene.rotor], ())
    losses = levitation.losses or (ball_losses(pieces) if pieces else None)
    doubt = 0.0 if included else metal_error(pieces, scene.frequency)
    near = False
    if first is not None and not included:
        # Within the sphere about a magnet, as in the hole of a ring, no ball is like that magnet.
        place = (first.without or first).position
        near = any(np.linalg.norm(place - m.body.center) < m.body.circumradius for m in scene.rotor)
    if first and losses and scene.frequency and doubt <= SLOW_ENOUGH and not near:
        growth = growth_by_rotor(scene, first, losses, included)
    listed = _conducting(ROTOR_CURRENTS, "rotor.conductivity_S_m", included, growth, doubt)
    return replace(listed, why=f"{listed.why}; {UNKNOWN_NEAR}") if near else listed


def _conducting(name: str, key: str, included: bool, growth: float | None, doubt: float) -> ListedEffect:
    why = "a conductivity is given" if included else f"no {key}"
    if not included and doubt > SLOW_ENOUGH:
        why += f"; at {MAGNET_CONDUCTIVITY:.2g} S/m, as of sintered magnets, it would be too slow to tell what it adds"
    elif not included and growth is not None:
        why += f"; at {MAGNET_CONDUCTIVITY:.2g} S/m, as of sintered magnets, it would add {growth:.2g} /s to the growth"
    return ListedEffect(name, included, 0.0, growth, why)


def _air(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    scene = levitation.scene
    if scene.drag.air:
        return ListedEffect(REAL_AIR, True, 0.0, None, 'drag.model is "air"')
    if scene.floater.body is not None:
        return ListedEffect(REAL_AIR, False, None, None, f"{OF_SPHERES}; the drag is Stokes' on a sphere of its volume")
    h = float(swinging(reynolds(scene.floater.radius, scene.angular_velocity)))
    why = f'drag.model is not "air"; it would make the torque on a swing {h:.2g} times Stokes\''
    return ListedEffect(REAL_AIR, False, 0.0, None, why)
