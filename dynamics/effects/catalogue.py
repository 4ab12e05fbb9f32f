"""The list of effects: which of them a scene has."""

from ...fem.rotor_losses import cached_rotor_losses, check_slow_enough, pieces_of
from ...fem.rotor_tables import FieldFormula
from ...geometry.scenes import Scene
from ..motion import Effect, Interaction, interaction_of
from .air import RealAir
from .floater_currents import FloaterCurrents
from .rotor_losses import ROTOR_CURRENTS, RotorCurrents


def with_effects(scene: Scene, table: FieldFormula) -> Interaction:
    """A table with the effects of a scene's conductivities and air, that of the rotor's from the cache; others stay.

    Raises
    ------
    InputError : the rotor turns too fast for its metal
    """
    whole = interaction_of(table)
    effects: list[Effect] = [FloaterCurrents()] if scene.floater.conductivity else []
    if scene.drag.air:
        effects.append(RealAir())
    pieces = pieces_of(scene.rotor, scene.conductors)
    check_slow_enough(pieces, scene.frequency)
    if pieces and ROTOR_CURRENTS not in {effect.name for effect in whole.effects}:
        effects.append(RotorCurrents(cached_rotor_losses(scene, lambda _: None)[0]))
    return whole.joined(*effects)
