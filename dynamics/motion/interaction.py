"""A rotor's field together with what else acts on the floater: what the dynamics takes wherever it takes a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fem.harmonics import FieldExpressions
from ...fem.rotor_tables import FieldFormula, FieldTable
from ...geometry.basics import Array
from .effect import Effect, Unsure


@dataclass(frozen=True, eq=False)
class Interaction:
    """A field table that also knows effects.

    Parameters
    ----------
    field : the rotor's field; a table where more than its expressions are asked for
    effects : what else acts on the floater
    """

    field: FieldFormula
    effects: tuple[Effect, ...] = ()

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m, rotor's frame)."""
        return self.field.expressions(position)

    @property
    def model(self) -> str:
        """Name of the field's model."""
        return self._table.model

    def evaluate(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m in the rotor's frame."""
        return self._table.evaluate(points)

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of B and its gradient, with what the effects' own errors are worth in them."""
        errors = self._table.relative_error(points)
        unsure = [effect for effect in self.effects if isinstance(effect, Unsure)]
        if not unsure:
            return errors
        field, gradient = self._table.evaluate(points)
        sizes = np.linalg.norm(field, axis=1), np.linalg.norm(gradient, axis=(1, 2))
        more = [effect.doubt(np.asarray(points, float).reshape(-1, 3), field) for effect in unsure]
        b, g = (e + np.sum(m, axis=0) / s for e, m, s in zip(errors, zip(*more, strict=True), sizes, strict=True))
        return b, g

    def in_range(self, points: ArrayLike) -> NDArray:  # type: ignore[type-arg]
        """Which of the points (n, 3) m lie where the table knows the field: (n,)."""
        return self._table.in_range(points)

    def joined(self, *effects: Effect) -> Interaction:
        """The same with further effects, those already known by their name left out."""
        known = {effect.name for effect in self.effects}
        return replace(self, effects=(*self.effects, *(e for e in effects if e.name not in known)))

    @property
    def _table(self) -> FieldTable:
        return cast(FieldTable, self.field)


def interaction_of(table: FieldFormula) -> Interaction:
    """A table as an interaction, itself if it is one."""
    return table if isinstance(table, Interaction) else Interaction(table)
