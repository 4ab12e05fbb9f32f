"""Mutual magnetisation and currents in the rotor's magnets for a whole family of rotors, from one table a magnet."""

from collections.abc import Sequence
from dataclasses import replace

from ...fem.mutual import cached_mutual_table
from ...fem.rotor_losses import cached_rotor_losses, check_slow_enough, pieces_of
from ...fem.rotor_tables import RotorTable
from ...geometry.basics import InputError
from ...geometry.bodies import Magnet
from ...geometry.scenes import Scene
from ..effects import MUTUAL, ROTOR_CURRENTS, Mutual, RotorCurrents, mutual_choice
from ..motion import Effect, Placeable
from .movable import Move, Translation
from .moved_effect import MovedEffect

Part = tuple[Magnet, Move | None, RotorTable]
"""A magnet as it is at measure zero, how it moves, and its field there if it is alone."""


STILL = Translation((0.0, 0.0, 0.0))


def family_effects(scene: Scene, parts: Sequence[Part], interaction: str, rtol: float) -> tuple[Effect, ...]:
    """The effects of a rotor's parts, which follow them.

    A magnet that moves as a whole keeps its answer to the floater; how magnets that move against each other answer
    changes with their distance, and is left out.  No current flows from magnet to magnet, each of which keeps its own.

    Raises
    ------
    InputError : mutual magnetisation is asked for where magnets move against each other, or conductors do not move
    """
    return (*_answers(scene, parts, interaction, rtol), *_currents(scene, parts))


def _answers(scene: Scene, parts: Sequence[Part], interaction: str, rtol: float) -> list[Effect]:
    if len(parts) > 1:
        if interaction == "mutual":
            raise InputError(
                "Input interaction must be rigid or auto for a family of rotors whose magnets move against each other, "
                "because their answers to the floater change with their distance; instead received mutual. Take one "
                "scene a distance (spinlev.sweep over rotor.displacement_mm), which makes a table for each."
            )
        return []
    magnet, move, alone = parts[0]
    if not mutual_choice(replace(scene, rotor=(magnet,)), alone, interaction, rtol)[0]:
        return []
    table, _ = cached_mutual_table((magnet,), scene.floater, lambda _: None)
    return [_moving(Mutual(table, scene.floater.moment), move, alone, MUTUAL)]


def _currents(scene: Scene, parts: Sequence[Part]) -> list[Effect]:
    if scene.conductors:
        raise InputError(
            "Input rotor.conductors must be left out of a family of rotors, whose magnets move and whose conductors "
            f"would not; instead received {len(scene.conductors)}. Take one scene a rotor (spinlev.sweep)."
        )
    found = []
    for k, (magnet, move, alone) in enumerate(parts, 1):
        if magnet.conductivity:
            check_slow_enough(pieces_of((magnet,), ()), scene.frequency)
            table, _ = cached_rotor_losses(replace(scene, rotor=(magnet,)), lambda _: None)
            name = ROTOR_CURRENTS if len(parts) == 1 else f"{ROTOR_CURRENTS}, magnet {k}"
            found.append(_moving(RotorCurrents(table), move, alone, name))
    return found


def _moving(effect: Placeable, move: Move | None, alone: RotorTable, name: str) -> Effect:
    return MovedEffect(effect, move or STILL, alone, name)
