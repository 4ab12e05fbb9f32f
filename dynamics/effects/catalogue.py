"""The list of effects: which of them a scene has."""

from ...fem.floaters import floater_sources
from ...fem.rotor_losses import cached_rotor_losses, check_slow_enough, pieces_of
from ...fem.rotor_tables import FieldFormula
from ...geometry.scenes import Scene
from ..motion import FORCE_ALONE, Effect, Interaction, interaction_of
from .air import RealAir
from .floater_currents import FloaterCurrents, check_floater_metal
from .floater_shape import FLOATER_SHAPE, FloaterShape
from .rotor_losses import ROTOR_CURRENTS, RotorCurrents

BESIDE_METAL = "beside metal that turns with the rotor"
WITHOUT_METAL = "Leave conductivity_S_m of the rotor and rotor.conductors out."


def with_effects(scene: Scene, table: FieldFormula) -> Interaction:
    """A table with the effects of a scene's conductivities and air, that of the rotor's from the cache; others stay.

    Raises
    ------
    InputError : the rotor turns too fast for its metal or the floater's, or metal turns with it beside a floater that
        is no sphere, or the floater is a cuboid
    """
    whole = interaction_of(table)
    check_floater_metal(scene)
    effects: list[Effect] = [FloaterCurrents()] if scene.floater.conductivity else []
    if scene.floater.body is not None and FLOATER_SHAPE not in {effect.name for effect in whole.effects}:
        scene.floater.must_be("sphere", "cylinder", where="where it moves", instead=FORCE_ALONE)
        effects.append(FloaterShape.of(scene.floater, floater_sources(scene.floater), whole.field))
    if scene.drag.air:
        effects.append(RealAir())
    pieces = pieces_of(scene.rotor, scene.conductors)
    check_slow_enough(pieces, scene.frequency)
    if pieces:
        scene.floater.must_be("sphere", where=BESIDE_METAL, instead=WITHOUT_METAL)
    if pieces and ROTOR_CURRENTS not in {effect.name for effect in whole.effects}:
        effects.append(RotorCurrents(cached_rotor_losses(scene, lambda _: None)[0]))
    return whole.joined(*effects)
