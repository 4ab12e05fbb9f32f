"""Effects on the floater beyond the rigid dipole: included or neglected, and what each changes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..dynamics.equilibria.equilibrium import LOCKED, MARGINAL, Equilibrium
from ..dynamics.equilibria.perturbed import growth_by_floater, growth_by_rotor, shift_by_mutual
from ..dynamics.motion.body_shape import MISSED, MISSED_BY_PLATE, response_error
from ..dynamics.motion.coils import COILS
from ..dynamics.motion.effects import NOTHING_PERMEABLE
from ..dynamics.motion.floater_effects import (
    FLOATER_CURRENTS,
    FLOATER_SHAPE,
    REAL_AIR,
    SLOW_ENOUGH,
    reynolds,
    scene_effects,
    slow_error,
    swinging,
)
from ..dynamics.motion.rotor_effects import MUTUAL, ROTOR_CURRENTS
from ..fem.floater_metal import DIPOLE, current_shape
from ..fem.rotor_metal import ball_losses, pieces_of, slow_error as metal_error
from ..geometry.common import MAGNET_CONDUCTIVITY, ComputationError
from ..geometry.scene.contents import Scene
from ..geometry.scene.floater import Floater
from .levitation import Levitation
from .words import spoken_time

PLATE_NEGLECTED = "The plate's eddy currents are neglected: the plate is only an obstacle."
CLEARLY_SLOW = 0.02  # relative error of what an effect adds to the growth of modes that goes without saying


@dataclass(frozen=True)
class ListedEffect:
    """One effect."""

    name: str
    included: bool  # whether it is in the motion
    shift_mm: float | None  # how far it moves the first equilibrium, about; None where that is not known
    # What it adds there to the growth of the mode that grows fastest with it, about; None where that is not known
    growth_per_s: float | None
    why: str  # it is included or not
    # Relative error of what it adds, or would, to the growth of modes: motions are taken as slow against it; torque and
    # lift are exact in a steady turn
    motion_error: float = 0.0

    def __str__(self) -> str:
        text = f"{self.name}: {'included' if self.included else 'neglected'} ({self.why})"
        if self.shift_mm:
            verb = "shifts" if self.included else "would shift"
            text += f"; {verb} the equilibrium by {self.shift_mm:.2g} mm"
        if self.growth_per_s is not None:
            doubt = f" ± {self.motion_error:.0%}" if self.motion_error > CLEARLY_SLOW else ""
            verb = "changes" if self.included else "would change"
            text += f"; {verb} the growth rate by {self.growth_per_s:+.2g} s⁻¹{doubt}"
        return text


def listed_effects(levitation: Levitation, equilibria: Sequence[Equilibrium]) -> list[ListedEffect]:
    """All effects that are known, with what they do to the first of the equilibria."""
    first = next(iter(equilibria), None)
    found = [part(levitation, first) for part in (_mutual, _rotor_currents, _floater_currents, _air)]
    if not levitation.scene.floater.is_sphere:
        found.append(_shape(levitation))
    others = {effect.name for effect in scene_effects(levitation.scene)} - {effect.name for effect in found}
    return [*found, *(ListedEffect(name, True, None, None, "given in the scene") for name in sorted(others))]


def would_end(first: Equilibrium | None, effects: Sequence[ListedEffect]) -> list[str]:
    """A sentence where eddy currents that are neglected would make a stable equilibrium unstable."""
    added = [e.growth_per_s for e in effects if not e.included and e.growth_per_s and e.growth_per_s > 0]
    if first is None or first.stability == "unstable" or first.growth_per_s + sum(added) <= MARGINAL:
        return []
    time = spoken_time(1 / (first.growth_per_s + sum(added)))
    return [f"With the neglected eddy currents it would be unstable, with an e-folding time of about {time}."]


def effects_summary(levitation: Levitation, effects: Sequence[ListedEffect]) -> dict[str, Any]:
    """For JSON: the interaction, the effects, and in sentences what is in the scene but neglected."""
    missing = [PLATE_NEGLECTED] if levitation.scene.plate and levitation.plate is None else []
    return {
        "interaction": levitation.interaction_model,
        "effects": [vars(effect) for effect in effects],
        "not_modelled": missing + [f"{e}." for e in effects if not e.included and e.why != NOTHING_PERMEABLE],
    }


def _mutual(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    (answers, why), shift = levitation.answers, None
    if first is not None and why != NOTHING_PERMEABLE:
        shift = 1e3 * shift_by_mutual(_scene(levitation, first), levitation.table, first, answers)
        if not shift < 1e3 * levitation.scene.floater.radius:  # farther than to first order it can
            shift, why = None, f"{why}; what it does to the equilibrium is not known"
    return ListedEffect(MUTUAL, answers is not None, shift, None, why)


def _scene(levitation: Levitation, first: Equilibrium | None) -> Scene:
    """That of the body an equilibrium is of: the mean of its turns, or itself."""
    return levitation.scene if first and first.kind == LOCKED else levitation.mean.scene


def _floater_currents(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    scene, growth = _scene(levitation, first), None
    floater = scene.floater
    there = replace(scene, floater=replace(floater, conductivity=floater.conductivity or MAGNET_CONDUCTIVITY))
    try:
        doubt = slow_error(there)
        missed = 0.0 if floater.is_sphere else _missed(floater, doubt)
    except ComputationError as error:  # it cannot be meshed
        return ListedEffect(FLOATER_CURRENTS, False, None, None, f"no floater.conductivity_S_m; not known: {error}")
    if first and scene.frequency and doubt <= SLOW_ENOUGH:
        growth = growth_by_floater(there, levitation.table, first, bool(floater.conductivity))
    why = _why("floater.conductivity_S_m", bool(floater.conductivity), growth, doubt)
    return ListedEffect(FLOATER_CURRENTS, bool(floater.conductivity), 0.0, growth, why, doubt + missed)


def _missed(floater: Floater, doubt: float) -> float:
    """Relative error of the currents' effect by a shape's tensors and delays, where they are slow to `slow_error`.

    That is the square of 2ωμ0σR² over 105; by the slowest delay, (2/21) μ0σR², an effect of delays is 2ω of it.
    """
    shape = current_shape(floater)
    return shape.error + min(1.0, DIPOLE * float(np.sqrt(105 * doubt))) * shape.delay_error


def _rotor_currents(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    scene, growth, included = _scene(levitation, first), None, levitation.losses is not None
    pieces = pieces_of([replace(magnet, conductivity=MAGNET_CONDUCTIVITY) for magnet in scene.rotor], ())
    losses = levitation.losses or (ball_losses(pieces) if pieces else None)
    doubt = 0.0 if included else metal_error(pieces, scene.fastest)
    # Within the sphere about a magnet, as in the hole of a ring, no ball is like that magnet.
    place = None if first is None or included else (first.without or first).position
    near = place is not None and any(np.linalg.norm(place - m.body.center) < m.body.circumradius for m in scene.rotor)
    if first and losses and scene.frequency and doubt <= SLOW_ENOUGH and not near:
        growth = growth_by_rotor(scene, first, losses, included)
    why = _why("rotor.conductivity_S_m", included, growth, doubt)
    why += "; the floater is so near to the magnets that their size is not known" if near else ""
    return ListedEffect(ROTOR_CURRENTS, included, 0.0, growth, why)


def _shape(levitation: Levitation) -> ListedEffect:
    floater = levitation.scene.floater
    missed = MISSED_BY_PLATE if levitation.scene.plate else MISSED
    coils = f", {COILS}," if levitation.scene.other_coils else ""
    why = (
        f"its multipoles and its polarizability in the rotor's field; plate, the magnets' response{coils} and the "
        f"rotor's currents have its dipole and a sphere of its volume, whose error is up to "
        f"{response_error(floater, missed):.0%} of their force, and of that times its radius for their torque"
    )
    return ListedEffect(FLOATER_SHAPE, True, None, None, why)


def _why(key: str, included: bool, growth: float | None, doubt: float) -> str:
    if included:
        return "a conductivity is given"
    assumed = f"{MAGNET_CONDUCTIVITY:.2g} S/m, as of sintered magnets"
    if doubt > SLOW_ENOUGH:
        return f"no {key}; with {assumed}, it would be too slow to tell what it adds"
    return f"no {key}" if growth is None else f"no {key}; estimated with {assumed}"


def _air(levitation: Levitation, first: Equilibrium | None) -> ListedEffect:
    scene = levitation.scene
    if scene.floater.is_sphere and scene.drag.air:
        return ListedEffect(REAL_AIR, True, 0.0, None, 'drag.model is "air"')
    if not scene.floater.is_sphere:
        floater = scene.floater
        ends = np.array([floater.held_radius, floater.radius]) / floater.equal_radius
        # A body has no less drag than one that it holds, and no more than one that holds it: R. Hill and G. Power,
        # Q. J. Mech. Appl. Math. 9 (1956) 313; of forces, and for torques alike. Beyond Stokes nobody has shown it.
        (low, high), (less, more) = ends.tolist(), (ends**3).tolist()
        if scene.drag.air:
            swings = swinging(reynolds(floater.radius, scene.angular_velocity) * np.array([low / high, 1.0]) ** 2)
            swings /= swinging(reynolds(floater.equal_radius, scene.angular_velocity))
            less, more = less * swings[0], more * swings[1]
            why = 'drag.model is "air": drag by its sphericity in the mean over attitudes; torques on a sphere of its '
            why += f"volume, known to {less:.2g} to {more:.2g} times, as a sphere in it and one about it would meet"
            return ListedEffect(REAL_AIR, True, 0.0, None, why)
        why = 'drag.model is not "air"; the drag is Stokes\' on a sphere of its volume: a slow motion of its own shape '
        why += f"meets {low:.2f} to {high:.2f} times that force and {less:.2f} to {more:.2f} times that torque"
        return ListedEffect(REAL_AIR, False, None, None, why)
    h = float(swinging(reynolds(scene.floater.radius, scene.angular_velocity)))
    why = f'drag.model is not "air"; the torque on an oscillating floater would be {h:.2g} times that of Stokes'
    return ListedEffect(REAL_AIR, False, 0.0, None, why)
