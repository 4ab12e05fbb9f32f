"""Scenes that differ in the rotor's frequency and in one measure of the rotor: what a map or a curve runs over."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...fem.closed_forms import carrier
from ...fem.rotor_losses import check_slow_enough, pieces_of
from ...fem.rotor_tables import RotorTable, cached_rotor_table, rotor_table
from ...geometry.basics import Array, moved
from ...geometry.bodies import Magnet
from ...geometry.scenes import Scene
from ..branches import Problem
from ..effects import check_floater_metal, with_effects
from ..motion import Effect, Interaction, Parameter, Rates, Scales, parameters
from .blend import blend_tables, chebyshev_points
from .family_effects import family_effects
from .movable import MovableField, Move, Rotation, Translation

MOVES: dict[str, tuple[Move | None, ...]] = {
    "horizontal": (Translation((1.0, 0.0, 0.0)),),
    "vertical": (None, Translation((0.0, 0.0, 1.0))),
    "tilt": (Rotation(),),
}
"""How each magnet of the article's rotors moves with displacement (m) or tilt (rad)."""
NODES = 7
"""Tables between which changing moments are interpolated."""


@dataclass(frozen=True, eq=False)
class RotorFamily:
    """A scene with frequency and one measure of its rotor left open.

    Parameters
    ----------
    scene : all else; its plate is left out
    rotor : magnets as they are at measure zero
    moves : how each of them moves, None for one that stands still
    field : of the rotor, with `Parameter.MEASURE`
    effects : mutual magnetisation and currents in the rotor's magnets, with `Parameter.MEASURE`
    """

    scene: Scene
    rotor: tuple[Magnet, ...]
    moves: tuple[Move | None, ...]
    field: MovableField
    effects: tuple[Effect, ...] = ()

    def at(self, frequency: float, measure: float) -> Scene:
        """The scene at one frequency (Hz) and measure (m or rad)."""
        pairs = zip(self.rotor, self.moves, strict=True)
        rotor = tuple(move.moved(magnet, measure) if move else magnet for magnet, move in pairs)
        return replace(self.scene, frequency=float(frequency), rotor=rotor)

    def values(self, frequency: ArrayLike, measure: ArrayLike) -> Array:
        """Runtime parameters (n, p), with the drag along the moment left out, at frequencies and measures (n,)."""
        frequency, measure = np.broadcast_arrays(np.atleast_1d(frequency), np.atleast_1d(measure))
        different, which = np.unique(frequency, return_inverse=True)
        check_slow_enough(pieces_of(self.rotor, ()), float(different[-1]))
        check_floater_metal(replace(self.scene, frequency=float(different[-1])))
        scenes = [replace(self.scene, frequency=float(f)) for f in different]
        each = [parameters(scene, Scales.of(scene), frozen_spin=True) for scene in scenes]
        values = np.reshape(each, (-1, len(Parameter)))[which]
        values[:, Parameter.MEASURE] = measure
        return values

    def frequencies(self, measure: float, spin: float = 0.0) -> Problem:
        """The problem whose parameter is the frequency, Hz, at one measure."""
        return lambda frequency: (self.values(frequency, measure)[0], spin)

    def measures(self, frequency: float, spin: float = 0.0) -> Problem:
        """The problem whose parameter is the measure, m or rad, at one frequency."""
        return lambda measure: (self.values(frequency, measure)[0], spin)

    @property
    def _bare(self) -> Scene:
        """The scene without metal in its rotor, whose currents are among the effects."""
        magnets = tuple(replace(magnet, conductivity=None) for magnet in self.scene.rotor)
        return replace(self.scene, rotor=magnets)

    @cached_property
    def rates(self) -> Rates:
        """Compiled once for all frequencies and measures."""
        return Rates(with_effects(self._bare, Interaction(self.field, self.effects)), optimised=True)


def rotor_family(
    scene: Scene,
    configuration: str,
    model: str,
    rtol: float = 3e-6,
    nearest: float | None = None,
    measures: tuple[float, float] | None = None,
    tables: int = NODES,
    interaction: str = "auto",
) -> RotorFamily:
    """The family of one of the article's rotors, with the magnets of `scene`.

    Parameters
    ----------
    configuration : "horizontal" (measure: displacement of the cube along +x, m), "vertical" (of the second cube along
        +z, m) or "tilt" (of the cube, rad)
    model, rtol, nearest : of the field, see `fem.rotor_table`
    measures : between which "vertical" with "fem" shall hold: how the cubes magnetise each other changes with their
        distance and is interpolated
    tables : between which it is, about two seconds each
    interaction : "rigid", "mutual" or "auto", see `effects.mutual_choice`; "vertical" is rigid

    A rotor that moves as a whole keeps its tables, whatever the model: the family is as good as its scenes' tables.

    Raises
    ------
    InputError : mutual magnetisation or conductors for which no table holds at every measure, see `family_effects`
    ValueError : unknown configuration or one of other magnets, or no `measures` where they are needed
    """
    if configuration not in MOVES or len(MOVES[configuration]) != len(scene.rotor):
        raise ValueError(
            f"Input configuration must be one of {', '.join(MOVES)} and have the scene's number of magnets, "
            f"{len(scene.rotor)}; instead received {configuration!r}."
        )
    moves = MOVES[configuration]
    rotor = tuple(_unmoved(magnet, move) for magnet, move in zip(scene.rotor, moves, strict=True))
    alone = [_alone(magnet, model, rtol, nearest) for magnet in rotor]
    effects = family_effects(scene, list(zip(rotor, moves, alone, strict=True)), interaction, rtol)
    if len(rotor) > 1 and model == "fem":
        field = _magnetised(rotor, moves, rtol, nearest, measures, tables)
    else:
        field = MovableField(tuple(zip(alone, moves, strict=True)))
    return RotorFamily(scene, rotor, moves, field, effects)


def _alone(magnet: Magnet, model: str, rtol: float, nearest: float | None) -> RotorTable:
    """Elements take a second, and are kept."""
    if model == "fem":
        return cached_rotor_table((magnet,), model, rtol, lambda _: None, nearest)[0]
    return rotor_table((magnet,), model, rtol, nearest)


def article_measure(rotor: Mapping[str, Any]) -> tuple[str, float] | None:
    """Configuration and displacement (m) or tilt (rad) in the keys of a scene file's rotor; None if it has none."""
    configuration = rotor.get("configuration")
    if configuration is None:
        return None
    if configuration == "tilt":
        return configuration, float(np.radians(rotor["angle_deg"]))
    return configuration, 1e-3 * rotor["displacement_mm"]


def _magnetised(
    rotor: tuple[Magnet, ...],
    moves: tuple[Move | None, ...],
    rtol: float,
    nearest: float | None,
    measures: tuple[float, float] | None,
    number: int,
) -> MovableField:
    """Closed forms that move, and expansions that also change."""
    if measures is None:
        raise ValueError(
            "Input measures must be given for magnets that magnetise each other and move against each other, such as "
            "(0.010, 0.020) m; instead received None."
        )
    places = chebyshev_points(*measures, number)
    shifts = [move if isinstance(move, Translation) else None for move in moves]
    pairs = list(zip(rotor, shifts, strict=True))
    tables = [
        rotor_table(tuple(s.moved(m, float(d)) if s else m for m, s in pairs), "fem", rtol, nearest).expansions
        for d in places
    ]
    carriers = [carrier(magnet) for magnet in rotor]
    closed = [(RotorTable("cuboid", (c,), (c,)), s) for c, s in zip(carriers, shifts, strict=True)]
    return MovableField((*closed, *blend_tables(tables, places, [(m.box.center, s) for m, s in pairs])))


def _unmoved(magnet: Magnet, move: Move | None) -> Magnet:
    """The magnet where its measure is zero: on the axis' origin, its axes along the rotor's."""
    if move is None:
        return magnet
    return replace(magnet, body=moved(magnet.body, np.zeros(3), np.eye(3)))
