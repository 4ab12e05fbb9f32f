"""A rotor's field with one measure of the rotor as a runtime parameter, so that a map needs one compilation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import heyoka as hy
import numpy as np

from ...fem.harmonics import FieldExpressions
from ...fem.rotor_tables import FieldFormula
from ...fem.storage import compiled
from ...geometry.basics import Array, moved, rotation_matrix
from ...geometry.bodies import Magnet
from ..motion import Parameter, Vector

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
