"""A map of B: values at points, from a probe or from another program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array, InputError, frozen_array


class FieldMapError(InputError):
    """A map that cannot be used; the message says which entry, and why."""


@dataclass(frozen=True, eq=False)
class FieldMap:
    """Observed field components at points in any order.

    Parameters
    ----------
    points : (n, 3) m, rotor's frame
    field : (n, 3) T; NaN where a component was not observed
    errors : (n, 3) standard errors of `field`, T, or what broadcasts to it; None if they are not known
    read_as : units of length and of B that the file was taken to have

    Raises
    ------
    FieldMapError : wrong shapes, a point or field that is infinite, a point that is NaN, an error that is not positive
    """

    points: Array
    field: Array
    errors: Array | None = None
    read_as: tuple[str, str] = ("m", "T")

    def __post_init__(self) -> None:
        points, field = np.asarray(self.points, float), np.asarray(self.field, float)
        for name, values in (("points", points), ("field", field)):
            if values.ndim != 2 or values.shape[1] != 3 or len(values) != len(points):
                raise FieldMapError(
                    f"Input {name} must have shape ({len(points)}, 3); instead received {values.shape}."
                )
        _require(np.isfinite(points), points, "points", "finite")
        _require(~np.isinf(field), field, "field", "finite, or NaN where it was not observed")
        object.__setattr__(self, "points", frozen_array(points, points.shape))
        object.__setattr__(self, "field", frozen_array(field, field.shape))
        if self.errors is not None:
            errors = np.broadcast_to(np.asarray(self.errors, float), field.shape)
            positive = (errors > 0) & np.isfinite(errors)
            _require(positive | np.isnan(field), errors, "errors", "positive where the field is observed")
            object.__setattr__(self, "errors", frozen_array(errors, field.shape))

    @property
    def observations(self) -> int:
        """How many field components were observed."""
        return int(np.isfinite(self.field).sum())

    def require_observations(self, needed: int) -> None:
        """Raise FieldMapError if fewer than `needed` components were observed."""
        if self.observations < needed:
            raise FieldMapError(
                f"Input field must hold at least {needed} observed components; instead received {self.observations}."
            )

    def where(self, chosen: ArrayLike) -> FieldMap:
        """The part of the map at `chosen` points: (n,) booleans or indices."""
        chosen = np.asarray(chosen)
        errors = None if self.errors is None else self.errors[chosen]
        return FieldMap(self.points[chosen], self.field[chosen], errors, self.read_as)

    def outside(self, center: ArrayLike, radius: float) -> FieldMap:
        """The part of the map farther than `radius` (m) from `center` (3,) m: to leave out what lies in a magnet."""
        return self.where(np.linalg.norm(self.points - np.asarray(center, float), axis=1) > radius)


def _require(good: np.ndarray, values: Array, name: str, rule: str) -> None:
    if not good.all():
        row = int(np.argmin(good.all(axis=1)))
        raise FieldMapError(f"Input {name} must be {rule}; instead received {values[row].tolist()} at point {row}.")
