"""Spread of equally likely expansions: the error bar of a fitted field at any point."""

import numpy as np

from ...geometry.basics import Array
from ..harmonics import Coefficients, derivative, irregular_values

CHUNK = 4096
UPPER = [(i, j) for i in range(3) for j in range(i, 3)]


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
        twice = np.array([1.0 if i == j else 2.0 for i, j in UPPER])
        return np.sqrt(squares[:3].sum(axis=0)), np.sqrt(twice @ squares[3:])


def _weights(coefficients: Coefficients, radius: float) -> Array:
    """Rows (9 · members) that give B_i and ∂B_i/∂x_j of each member from the real and imaginary parts of all Θ_lm."""
    rows = []
    for member in coefficients:
        field = [-derivative(member, i) for i in range(3)]
        rows += [_row(np.pad(b, (0, 1))) for b in field]
        rows += [_row(derivative(field[i], j)) / radius for i, j in UPPER]
    return np.array(rows)


def _row(coefficients: Coefficients) -> Array:
    """Weights of Re Θ_lm and Im Θ_lm, m ≥ 0, in a real function: the terms ±m are complex conjugates."""
    kept = (coefficients * np.where(np.arange(len(coefficients)) == 0, 1.0, 2.0))[np.tril_indices(len(coefficients))]
    return np.concatenate([kept.real, -kept.imag])
