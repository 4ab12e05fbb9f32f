"""A field fitted to a map, with the spread of equally likely fields as its error bar."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.basics import Array, frozen_array, millimetres
from ..harmonics import Coefficients, FieldExpressions, derivative, irregular_values
from ..rotor_tables import RangeError, RotorTable, error_below
from .harmonic_fit import FLOOR

CHUNK = 4096
PAIRS = [(i, j) for i in range(3) for j in range(i, 3)]
"""Entries of a symmetric matrix."""
COVERAGE = 4.0
"""The error bar in standard deviations: with a spread of a dozen members, once in 500 the error is beyond it."""


class Ensemble:
    """Deviations of equally likely fields from the table's, all about the same centres.

    Parameters
    ----------
    centers, radii : (k, 3) and (k,) m
    coefficients : c_lm (T) of the deviations, complex (members, k, L+1, L+1)
    """

    def __init__(self, centers: Array, radii: Array, coefficients: Coefficients) -> None:
        self._centers, self._radii = centers, radii
        self.coefficients = coefficients
        self._weights = [_weights(coefficients[:, k], radius) for k, radius in enumerate(radii)]

    def spread(self, points: Array) -> tuple[Array, Array]:
        """Root mean square (n,) of the deviations of B (T) and of its gradient (T/m) at points (n, 3) m."""
        parts = np.array_split(points, max(len(points) // CHUNK, 1))
        found = [self._spread(part) for part in parts]
        return np.concatenate([b for b, _ in found]), np.concatenate([g for _, g in found])

    def _spread(self, points: Array) -> tuple[Array, Array]:
        degree, members = self.coefficients.shape[-1] + 1, len(self.coefficients)
        values = np.zeros((9 * members, len(points)))
        for center, radius, weights in zip(self._centers, self._radii, self._weights, strict=True):
            harmonics = irregular_values(degree, (points - center) / radius)
            rows = np.array([harmonics[l, m] for l in range(degree + 1) for m in range(l + 1)])
            values += weights @ np.concatenate([rows.real, rows.imag])
        squares = np.square(values).reshape(members, 9, -1).mean(axis=0)
        twice = np.array([1.0 if i == j else 2.0 for i, j in PAIRS])
        return np.sqrt(squares[:3].sum(axis=0)), np.sqrt(twice @ squares[3:])


def _weights(coefficients: Coefficients, radius: float) -> Array:
    """Rows (9 · members) that give B_i and ∂B_i/∂x_j of each member from the real and imaginary parts of all Θ_lm."""
    rows = []
    for member in coefficients:
        field = [-derivative(member, i) for i in range(3)]
        rows += [_row(np.pad(b, (0, 1))) for b in field]
        rows += [_row(derivative(field[i], j)) / radius for i, j in PAIRS]
    return np.array(rows)


def _row(coefficients: Coefficients) -> Array:
    """Weights of Re Θ_lm and Im Θ_lm, m ≥ 0, in a real function: the terms ±m are complex conjugates."""
    kept = (coefficients * np.where(np.arange(len(coefficients)) == 0, 1.0, 2.0))[np.tril_indices(len(coefficients))]
    return np.concatenate([kept.real, -kept.imag])


@dataclass(frozen=True, eq=False)
class GriddedTable:
    """Multipole expansions fitted to a map, with the error that the map leaves: a `FieldTable`.

    The field is that of sources inside the spheres of the expansions, so that it is free of divergence and curl by
    construction. Its error bar has two parts: `COVERAGE` times the spread of fields that fit the map equally well,
    and the expansions' own uncertainty, which is what degrees beyond the largest may hold.

    Parameters
    ----------
    expansions : table without closed forms; its provenance tells how the fit was made
    deviations : c_lm (T) of equally likely fields minus the table's, complex (members, expansions, L+1, L+1)
    region : (2, 3) m, opposite corners of the box where the map determines the field; may be infinite
    """

    expansions: RotorTable
    deviations: Coefficients
    region: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "region", frozen_array(self.region, (2, 3)))

    def __repr__(self) -> str:
        parts = [f"degree {part.degree} about {millimetres(part.center)}" for part in self.expansions.expansions]
        return "\n".join([f"GriddedTable {self.model!r}: {', '.join(parts)}", *error_below(self)])

    @property
    def model(self) -> str:
        """Name of the model."""
        return self.expansions.model

    @cached_property
    def _ensemble(self) -> Ensemble:
        parts = self.expansions.expansions
        return Ensemble(np.array([e.center for e in parts]), np.array([e.radius for e in parts]), self.deviations)

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m, rotor's frame)."""
        return self.expansions.expressions(position)

    def evaluate(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m in the rotor's frame.

        Raises
        ------
        RangeError : a point lies where the map does not determine the field
        """
        points = np.asarray(points, float).reshape(-1, 3)
        known = self.in_range(points)
        if not known.all():
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(known))])
            raise RangeError(f"Input points must lie {self._range()}; instead received a point at ({where}) mm.")
        return self.expansions.evaluate(points)

    def _range(self) -> str:
        parts = [f"{e.radius * 1e3:.4g} mm from {millimetres(e.center)}" for e in self.expansions.expansions]
        text = f"farther than {', '.join(parts)}"
        if np.isfinite(self.region).all():
            text += f" and in the map's box from {millimetres(self.region[0])} to {millimetres(self.region[1])}"
        return text

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of B and of its gradient (Frobenius norm), meant as upper bounds."""
        points = np.asarray(points, float).reshape(-1, 3)
        b, g = self.evaluate(points)
        neglected_b, neglected_g = self.expansions.relative_error(points)
        spread_b, spread_g = self._ensemble.spread(points)
        tiny = np.finfo(float).tiny
        return (
            FLOOR + neglected_b + COVERAGE * spread_b / (np.linalg.norm(b, axis=1) + tiny),
            FLOOR + neglected_g + COVERAGE * spread_g / (np.linalg.norm(g, axis=(1, 2)) + tiny),
        )

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points (n, 3) m lie outside the sources' spheres and where the map tells the field: (n,)."""
        points = np.asarray(points, float).reshape(-1, 3)
        known: NDArray[np.bool_] = np.all((self.region[0] <= points) & (points <= self.region[1]), axis=1)
        for expansion in self.expansions.expansions:
            known &= np.linalg.norm(points - expansion.center, axis=1) > expansion.radius
        return known
