"""A rotor's field with one measure of the rotor as a runtime parameter, so that a map needs one compilation.

A part of the rotor that moves with the measure keeps its field and its effects: they are known in the part's own frame,
which is where it is at measure zero, and are evaluated with the floater's motion as seen from there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.harmonics.solid import turned_entries
from ...fem.mutual.making import cached_mutual_table
from ...fem.rotor.choice import PERMEABLE, cached_rotor_table, rotor_table
from ...fem.rotor.table import DerivedField, FieldFormula, RotorTable
from ...fem.rotor_metal import cached_rotor_losses, check_metal, pieces_of
from ...geometry.common import Array, InputError
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import Scene
from ...geometry.shapes import rotation_matrix
from ...geometry.solids import moved, with_frame
from ..motion.effect import Added, Effect, Interaction, Motion, Placeable, Poses
from ..motion.effects import mean_over_turns, mutual_choice, with_effects
from ..motion.equations import parameters
from ..motion.floater_effects import check_floater_metal
from ..motion.rates import Rates
from ..motion.rotor_effects import MUTUAL, ROTOR_CURRENTS, Mutual, RotorCurrents
from ..motion.state import Parameter, Scales

Numbers = Sequence[Any]  # A vector of heyoka expressions, or of arrays (n,)


@dataclass(frozen=True)
class Move:
    """Motion of a part of the rotor with the measure."""

    way: tuple[float, float, float] = (0.0, 0.0, 0.0)  # it moves by the measure (m) along this vector
    turning: bool = False  # it turns by the measure (rad) about the rotor's y, so that +x comes towards +z

    def moved(self, magnet: Magnet, measure: float) -> Magnet:
        """The magnet, from where it is at measure zero."""
        turn = rotation_matrix((0.0, -np.degrees(measure) if self.turning else 0.0, 0.0))
        return replace(magnet, body=with_frame(magnet.body, turn, measure * np.array(self.way)))

    def place(self, position: Numbers, measure: Any) -> list[Any]:
        """A position (3) m in the part's own frame."""
        return self.into([p - w * measure if w else p for p, w in zip(position, self.way, strict=True)], measure)

    def into(self, vector: Numbers, measure: Any, sign: int = 1) -> list[Any]:
        """A `vector` (3) along the axes of the part's own frame at a `measure`; with the `sign` -1 from these."""
        x, y, z = vector
        if not self.turning:
            return [x, y, z]
        functions = hy if isinstance(measure, hy.expression) else np
        cosine, sine = functions.cos(measure), sign * functions.sin(measure)
        return [cosine * x + sine * z, y, cosine * z - sine * x]

    def back(self, vector: Numbers, measure: Any) -> list[Any]:
        """A vector (3) of the part's own frame along the rotor's axes."""
        return self.into(vector, measure, -1)

    def tensor(self, rows: Sequence[Numbers], measure: Any, sign: int = 1) -> list[list[Any]]:
        """A tensor of `rows` (3, 3) along these axes at a `measure`; with the `sign` -1 from these."""
        half = zip(*(self.into(row, measure, sign) for row in rows), strict=True)
        columns = [self.into(column, measure, sign) for column in half]
        return [list(row) for row in zip(*columns, strict=True)]


# How each magnet of the article's rotors moves with displacement (m) or tilt (rad).
MOVES: dict[str, tuple[Move, ...]] = {
    "horizontal": (Move((1.0, 0.0, 0.0)),),
    "vertical": (Move(), Move((0.0, 0.0, 1.0))),
    "tilt": (Move(turning=True),),
}


@dataclass(frozen=True, eq=False)
class MovableField:
    """The sum of fields of which each moves in its own way."""

    parts: tuple[tuple[RotorTable, Move], ...]  # fields as they are at measure zero, and how each moves
    measures: Array = field(default_factory=lambda: np.zeros(1))  # (1,) or (n,), of points that are asked for

    def at(self, measures: Array) -> "MovableField":
        """The field for points (n, 3) of rotors with `measures` (n,)."""
        return replace(self, measures=measures)

    def derivatives(self, points: Array, order: int) -> Array:
        found = np.zeros((len(points), order * (order + 2)))
        for source, move in self.parts:
            places = np.transpose(move.place(list(points.T), self.measures))
            part = source.derivatives(places, order)
            if move.turning:
                units = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, len(points)))
                axes = np.array([move.back(list(unit), self.measures) for unit in units])
                part = turned_entries(part, axes.transpose(2, 1, 0))
            found += part
        return found


@dataclass(frozen=True, eq=False)
class MovedEffect:
    """An effect of a part of the rotor that moves with the measure."""

    effect: Placeable  # of the part where it is at measure zero
    move: Move  # how the part moves
    name: str  # in results

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin."""
        measure, length, move = hy.par[Parameter.MEASURE], hy.par[Parameter.LENGTH], self.move
        place = move.place([length * x for x in motion.position], measure)
        names = ("velocity", "moment", "spin", "drift", "lag", "field")
        seen: dict[str, Any] = {name: move.into(getattr(motion, name), measure) for name in names}
        gradient = move.tensor(motion.gradient, measure)
        position = [x / length for x in place]
        found = self.effect.added(Motion(position=position, gradient=gradient, turn=motion.turn, **seen))
        vectors = ("force", "torque", "pulled", "turning")
        back: dict[str, Any] = {name: move.back(getattr(found, name), measure) for name in vectors}
        return replace(found, **back)

    def placed(self, first: int) -> "MovedEffect":
        return replace(self, effect=self.effect.placed(first))

    @property
    def count(self) -> int:
        return self.effect.count

    def numbers(self, field: DerivedField, poses: Poses) -> Array:
        """See `Placeable`; for poses as seen from the part."""
        measure, length = poses.values[:, Parameter.MEASURE], poses.values[:, [Parameter.LENGTH]]
        place = np.transpose(self.move.place(list(poses.places.T), measure)) / length
        flux, moment = (np.transpose(self.move.into(list(v.T), measure)) for v in (poses.flux, poses.moment))
        return self.effect.numbers(field, replace(poses, position=place, moment=moment, flux=flux, quaternion=None))


@dataclass(frozen=True, eq=False)
class RotorFamily:
    """A scene with frequency and one measure of its rotor left open."""

    scene: Scene  #: all else; its plate is left out
    rotor: tuple[Magnet, ...]  #: magnets as they are at measure zero
    moves: tuple[Move, ...]  #: how each of them moves
    field: MovableField  #: of the rotor, with `Parameter.MEASURE`
    #: mutual magnetisation and currents in the rotor's magnets, with `Parameter.MEASURE`
    effects: tuple[Effect, ...] = ()

    def at(self, frequency: float, measure: float) -> Scene:
        """The scene at one frequency (Hz) and measure (m or rad)."""
        rotor = tuple(move.moved(magnet, measure) for magnet, move in zip(self.rotor, self.moves, strict=True))
        return replace(self.scene, frequency=float(frequency), rotor=rotor)

    def values(self, frequency: ArrayLike, measure: ArrayLike) -> Array:
        """Runtime parameters (n, p), with the drag along the moment left out, at frequencies and measures (n,)."""
        frequency, measure = np.broadcast_arrays(np.atleast_1d(frequency), np.atleast_1d(measure))
        different, which = np.unique(frequency, return_inverse=True)
        scenes = [replace(self.scene, frequency=float(f)) for f in different]
        check_metal(pieces_of(self.rotor, ()), scenes[-1].frequency, self.scene.floater.radius)
        check_floater_metal(scenes[-1])
        values = np.array([parameters(scene, Scales.of(scene), frozen_spin=True) for scene in scenes])[which]
        values[:, Parameter.MEASURE] = measure
        return values

    @cached_property
    def rates(self) -> Rates:
        """Compiled once for all frequencies and measures."""
        # Currents in the rotor's magnets are among the effects already.
        bare = tuple(replace(magnet, conductivity=None) for magnet in self.scene.rotor)
        scene, whole = replace(self.scene, rotor=bare), Interaction(cast(FieldFormula, self.field), self.effects)
        acting = mean_over_turns(scene, whole)[2] if scene.floater.mean else with_effects(scene, whole)
        return Rates(acting, optimised=True)


def rotor_family(
    scene: Scene,
    configuration: str,
    model: str,
    rtol: float = 3e-6,
    nearest: float | None = None,
    interaction: str = "auto",
) -> RotorFamily:
    """The family of one of the article's rotors, with the magnets of `scene`.

    Raises InputError: mutual magnetisation, or finite elements, are asked for where magnets move against each other, or
    conductors do not move; ValueError: unknown configuration or one of other magnets.

    Parameters
    ----------
    scene : its magnets' sizes and materials, and all else but the frequency
    configuration : "horizontal" (measure: displacement of the cube along +x, m), "vertical" (of the second cube along
        +z, m) or "tilt" (of the cube, rad)
    model, rtol, nearest : of the field, see `fem.rotor_table`
    interaction : "rigid", "mutual" or "auto", see `effects.mutual_choice`; "vertical" is rigid

    A rotor that moves as a whole keeps its tables, whatever the model: the family is as good as its scenes' tables.
    A floater that is not round about its moment is its mean over turns about that, by its multipoles.
    """
    moves = MOVES.get(configuration, ())
    if not moves or len(moves) != len(scene.rotor):
        raise ValueError(
            f"Input configuration must be one of {', '.join(MOVES)} and have the scene's number of magnets, "
            f"{len(scene.rotor)}; instead received {configuration!r}."
        )
    if len(moves) > 1 and model in PERMEABLE:
        raise InputError(
            "Input model must be dipole or cuboid for a family of rotors whose magnets move against each other, as how "
            f"they magnetise each other changes with their distance; instead received {model}. Take one scene a "
            "distance (spinlev.sweep over rotor.displacement_mm), which makes a table for each."
        )
    if not scene.floater.round:
        if not scene.floater.turns_freely:
            raise InputError(
                "Input floater must have its moment along a principal axis of inertia for a family of rotors, as the "
                "equilibria of another body are of no one kind; instead it has not. Take one scene a rotor "
                "(spinlev.sweep)."
            )
        scene = replace(scene, floater=scene.floater.averaged)
    rotor = tuple(
        magnet if move == Move() else replace(magnet, body=moved(magnet.body, np.zeros(3), np.eye(3)))
        for magnet, move in zip(scene.rotor, moves, strict=True)
    )
    if model in PERMEABLE:  # elements take a second, and are kept
        alone = [cached_rotor_table((magnet,), model, rtol, lambda _: None, nearest)[0] for magnet in rotor]
    else:
        alone = [rotor_table((magnet,), model, rtol, nearest) for magnet in rotor]
    parts = list(zip(rotor, moves, alone, strict=True))
    effects = (*_mutual_magnetisation(scene, parts, interaction, rtol), *_currents(scene, parts))
    return RotorFamily(scene, rotor, moves, MovableField(tuple((table, move) for _, move, table in parts)), effects)


Part = tuple[Magnet, Move, RotorTable]


def _mutual_magnetisation(scene: Scene, parts: Sequence[Part], interaction: str, rtol: float) -> list[Effect]:
    """A magnet that moves as a whole keeps its response; that of magnets that move against each other is left out."""
    if len(parts) > 1:
        if interaction == "mutual":
            raise InputError(
                "Input interaction must be rigid or auto for a family of rotors whose magnets move against each other, "
                "because their mutual magnetisation changes with their distance; instead received mutual. Take one "
                "scene a distance (spinlev.sweep over rotor.displacement_mm), which makes a table for each."
            )
        return []
    ((magnet, move, alone),) = parts
    if not mutual_choice(replace(scene, rotor=(magnet,)), alone, interaction, rtol)[0]:
        return []
    table, _ = cached_mutual_table((magnet,), scene.floater, lambda _: None)
    return [MovedEffect(Mutual(table, scene.floater.moment), move, MUTUAL)]


def _currents(scene: Scene, parts: Sequence[Part]) -> list[Effect]:
    """No current flows from magnet to magnet, each of which keeps its own."""
    if scene.conductors:
        raise InputError(
            "Input rotor.conductors must be left out of a family of rotors, whose magnets move and whose conductors "
            f"would not; instead received {len(scene.conductors)}. Take one scene a rotor (spinlev.sweep)."
        )
    found: list[Effect] = []
    for k, (magnet, move, _) in enumerate(parts, 1):
        if magnet.conductivity:
            check_metal(pieces_of((magnet,), ()), scene.frequency, scene.floater.radius)
            table, _ = cached_rotor_losses(replace(scene, rotor=(magnet,)), lambda _: None)
            name = ROTOR_CURRENTS if len(parts) == 1 else f"{ROTOR_CURRENTS}, magnet {k}"
            found.append(MovedEffect(RotorCurrents(table), move, name))
    return found
