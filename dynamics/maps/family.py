"""A rotor's field with one measure of the rotor as a runtime parameter, so that a map needs one compilation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.closed_forms.moments import carrier
from ...fem.compiled_code import compiled
from ...fem.harmonics.expansion import UPPER, MultipoleExpansion
from ...fem.harmonics.expressions import FieldExpressions, harmonic_sums
from ...fem.mutual.making import cached_mutual_table
from ...fem.rotor.choice import cached_rotor_table, rotor_table
from ...fem.rotor.table import FieldFormula, FieldTable, RotorTable
from ...fem.rotor_metal import cached_rotor_losses, check_slow_enough, pieces_of
from ...geometry.common import Array, InputError
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import Scene
from ...geometry.shapes import rotation_matrix
from ...geometry.solids import moved
from ..motion.effect import Added, Effect, Interaction, Motion, Placeable, Placed
from ..motion.effects import mutual_choice, with_effects
from ..motion.equations import parameters
from ..motion.floater_currents import check_floater_metal
from ..motion.mutual import MUTUAL, Mutual
from ..motion.rates import Rates
from ..motion.rotor_losses import ROTOR_CURRENTS, RotorCurrents
from ..motion.state import Parameter, Scales, Vector

Scalar = Any
"""A heyoka expression, or an array (n,)."""


class Move(Protocol):
    """How a part of the rotor moves with the measure; its own frame is where it is at measure zero."""

    def moved(self, magnet: Magnet, measure: float) -> Magnet:
        """The magnet, from where it is at measure zero."""

    def place(self, position: Sequence[Scalar], measure: Scalar) -> list[Scalar]:
        """A position (3) m in the part's own frame."""

    def into(self, vector: Sequence[Scalar], measure: Scalar) -> list[Scalar]:
        """A vector (3) along the axes of the part's own frame."""

    def back(self, vector: Sequence[Scalar], measure: Scalar) -> list[Scalar]:
        """A vector (3) of the part's own frame along the rotor's axes."""


@dataclass(frozen=True)
class Translation:
    """By the measure (m) along a unit vector."""

    way: tuple[float, float, float]

    def way_of(self, measure: float) -> Array:
        """How far it moves, (3,) m."""
        return measure * np.array(self.way)

    def moved(self, magnet: Magnet, measure: float) -> Magnet:
        """The magnet, from where it is at measure zero."""
        center = magnet.box.center + self.way_of(measure)
        return replace(magnet, body=moved(magnet.body, center))

    def place(self, position: Sequence[Scalar], measure: Scalar) -> list[Scalar]:
        """A position (3) m in the part's own frame."""
        return [p - w * measure if w else p for p, w in zip(position, self.way, strict=True)]

    def into(self, vector: Sequence[Scalar], measure: Scalar) -> list[Scalar]:
        """The vector itself."""
        return list(vector)

    back = into


@dataclass(frozen=True)
class Rotation:
    """By the measure (rad) about y, so that +x comes towards +z."""

    def moved(self, magnet: Magnet, measure: float) -> Magnet:
        """The magnet, from where it is at measure zero."""
        turn, box = rotation_matrix((0.0, -np.degrees(measure), 0.0)), magnet.box
        return replace(magnet, body=moved(magnet.body, turn @ box.center, turn @ box.rotation))

    def into(self, vector: Sequence[Scalar], measure: Scalar) -> list[Scalar]:
        """A vector (3) along the axes of the part's own frame."""
        cosine, sine = _cosine_sine(measure)
        return [cosine * vector[0] + sine * vector[2], vector[1], cosine * vector[2] - sine * vector[0]]

    place = into

    def back(self, vector: Sequence[Scalar], measure: Scalar) -> list[Scalar]:
        """A vector (3) of the part's own frame along the rotor's axes."""
        cosine, sine = _cosine_sine(measure)
        return [cosine * vector[0] - sine * vector[2], vector[1], sine * vector[0] + cosine * vector[2]]


def _cosine_sine(angle: Scalar) -> tuple[Scalar, Scalar]:
    return (hy.cos(angle), hy.sin(angle)) if isinstance(angle, hy.expression) else (np.cos(angle), np.sin(angle))


def moved_field(source: FieldFormula, move: Move, position: Vector, measure: hy.expression) -> FieldExpressions:
    """Field at a position (m) of a source that has moved, and its gradient."""
    field, slope = source.expressions(move.place(position, measure))
    return move.back(field, measure), turned(slope, lambda vector: move.back(vector, measure))


def turned(tensor: Sequence[Vector], turn: Callable[[Vector], Vector]) -> list[list[Scalar]]:
    """A tensor (3, 3) along other axes, by what turns a vector."""
    rows = [turn(row) for row in tensor]
    columns = [turn(column) for column in zip(*rows, strict=True)]
    return [list(row) for row in zip(*columns, strict=True)]


@dataclass(frozen=True, eq=False)
class MovableField:
    """The sum of fields of which each moves in its own way.

    Parameters
    ----------
    parts : fields as they are at measure zero, and how each moves; None for one that stands still
    """

    parts: tuple[tuple[FieldFormula, Move | None], ...]

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as expressions of a position (m, rotor's frame) and of `Parameter.MEASURE`."""
        measure = hy.par[Parameter.MEASURE]
        found = [
            moved_field(source, move, position, measure) if move else source.expressions(position)
            for source, move in self.parts
        ]
        return (
            [hy.sum([b[i] for b, _ in found]) for i in range(3)],
            [[hy.sum([g[i][j] for _, g in found]) for j in range(3)] for i in range(3)],
        )

    @cached_property
    def _function(self) -> Any:
        variables = hy.make_vars("x", "y", "z")
        field, gradient = self.expressions(variables)
        return compiled(hy.cfunc, [*field, *(g for row in gradient for g in row)], variables)

    def evaluate(self, points: Array, measure: float) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m, compiled once for all measures.

        Nobody asks whether the points lie inside a magnet.
        """
        values = np.zeros((len(Parameter), len(points)))
        values[Parameter.MEASURE] = measure
        rows = self._function(np.ascontiguousarray(points.T), pars=values[: self._function.nparams])
        return rows[:3].T, np.moveaxis(rows[3:].reshape(3, 3, -1), -1, 0)


def chebyshev_points(lowest: float, highest: float, count: int) -> Array:
    """Chebyshev points of an interval, in ascending order."""
    return (lowest + highest) / 2 - (highest - lowest) / 2 * np.cos(np.pi * (np.arange(count) + 0.5) / count)


@dataclass(frozen=True, eq=False)
class Blend:
    """Expansions about one magnet as a polynomial of the measure.

    Parameters
    ----------
    measures : (k,) at which the expansions are known
    expansions : (k,) of them, of one radius, about the magnet where it is at measure zero
    """

    measures: Array
    expansions: tuple[MultipoleExpansion, ...]

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as expressions of a position (m) and of `Parameter.MEASURE`."""
        first = self.expansions[0]
        scaled = [(position[i] - float(first.center[i])) * (1.0 / first.radius) for i in range(3)]
        parts = [_terms(expansion) for expansion in self.expansions]
        shares = _shares(self.measures)
        sums = []
        for same in zip(*parts, strict=True):
            merged: dict[Any, Any] = {}
            for key in sorted({key for terms in same for key in terms}):
                merged[key] = hy.sum([share * t[key] for share, t in zip(shares, same, strict=True) if key in t])
            sums.append(merged)
        found = harmonic_sums(scaled, sums)
        upper = dict(zip(UPPER, found[3:], strict=True))
        upper[2, 2] = -upper[0, 0] - upper[1, 1]
        return found[:3], [[upper[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]


def _terms(expansion: MultipoleExpansion) -> list[dict[Any, float]]:
    fields, gradients = expansion.components
    slopes = [{key: w / expansion.radius for key, w in gradients[i][j].items()} for i, j in UPPER]
    return [*fields, *slopes]


def _shares(measures: Array) -> list[hy.expression]:
    """Lagrange's polynomials of the measure."""
    measure, found = hy.par[Parameter.MEASURE], []
    for k, own in enumerate(measures):
        others = np.delete(measures, k)
        share = hy.expression(1.0)
        for other in others:
            share = share * ((measure - float(other)) / float(own - other))
        found.append(share)
    return found


def blend_tables(
    tables: Sequence[tuple[MultipoleExpansion, ...]],
    measures: Array,
    magnets: Sequence[tuple[Array, Translation | None]],
) -> list[tuple[Blend, Translation | None]]:
    """The expansions of several tables (k,), known at `measures` (k,), as blends, one for each magnet.

    Parameters
    ----------
    magnets : centre (3,) m at measure zero of each, and how it moves

    Raises
    ------
    ValueError : a table has expansions about other places than its magnets' centres
    """
    found = []
    for center, move in magnets:
        series = []
        for measure, table in zip(measures, tables, strict=True):
            place = center if move is None else center + move.way_of(float(measure))
            here = [e for e in table if np.linalg.norm(e.center - place) < 1e-9]
            if len(here) != 1 or len(table) != len(magnets):
                raise ValueError(
                    f"Input rotor must have one expansion about each magnet's centre; instead it has {len(table)} for "
                    f"{len(magnets)} magnets, which were cut into pieces. Make them cubes."
                )
            series.append(MultipoleExpansion(center, here[0].radius, here[0].coefficients))
        found.append((Blend(measures, tuple(series)), move))
    return found


@dataclass(frozen=True, eq=False)
class MovedEffect:
    """An effect that `Rates` has as a `Placed` one.

    Parameters
    ----------
    effect : of the part where it is at measure zero
    move : how the part moves
    alone : field of the part at measure zero
    name : in results
    """

    effect: Placeable
    move: Move
    alone: FieldTable
    name: str

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin."""
        return _moved(self.effect, self.move, motion)

    def placed(self, first: int) -> "MovedAtPlace":
        """The same about one pose."""
        return MovedAtPlace(self.effect.placed(first), self.move, self.alone, self.name)


@dataclass(frozen=True, eq=False)
class MovedAtPlace:
    """The same about one pose; members as above."""

    effect: Placed
    move: Move
    alone: FieldTable
    name: str

    @property
    def count(self) -> int:
        """Of the runtime parameters."""
        return self.effect.count

    def added(self, motion: Motion) -> Added:
        """Its accelerations of place and spin."""
        return _moved(self.effect, self.move, motion)

    def numbers(self, field: FieldTable, position: Array, moment: Array, values: Array) -> Array:
        """(n, count) for scaled positions and moments (n, 3), and runtime parameters (n, p)."""
        measure, length = values[:, Parameter.MEASURE], values[:, [Parameter.LENGTH]]
        place = np.transpose(self.move.place(list((position * length).T), measure)) / length
        return self.effect.numbers(self.alone, place, np.transpose(self.move.into(list(moment.T), measure)), values)


def _moved(effect: Effect, move: Move, motion: Motion) -> Added:
    measure, length = hy.par[Parameter.MEASURE], hy.par[Parameter.LENGTH]

    def into(vector: Vector) -> list[hy.expression]:
        return move.into(vector, measure)

    place = move.place([length * x for x in motion.position], measure)
    found = effect.added(
        Motion(
            position=[x / length for x in place],
            velocity=into(motion.velocity),
            moment=into(motion.moment),
            spin=into(motion.spin),
            drift=into(motion.drift),
            lag=into(motion.lag),
            field=into(motion.field),
            gradient=turned(motion.gradient, into),
        )
    )
    force, torque, pulled, turning = (
        move.back(vector, measure) for vector in (found.force, found.torque, found.pulled, found.turning)
    )
    return replace(found, force=force, torque=torque, pulled=pulled, turning=turning)


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
