"""The list of effects: which of them a scene has."""

from ...fem.rotor_tables import FieldFormula
from ...geometry.scenes import Scene
from ..motion import Interaction, interaction_of
from .floater_currents import FloaterCurrents


def with_effects(scene: Scene, table: FieldFormula) -> Interaction:
    """A table with the effects that a scene asks for and that need no table of their own; others stay as they are."""
    effects = [FloaterCurrents()] if scene.floater.conductivity else []
    return interaction_of(table).joined(*effects)
