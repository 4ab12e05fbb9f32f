"""Expansion coefficients along other axes: Wigner's matrices, as exponentials of the angular momentum."""

from functools import cache

import numpy as np

from ...geometry.basics import Array
from .solid import Coefficients, factorials


def rotated_harmonics(coefficients: Coefficients, axes: Array) -> Coefficients:
    """Coefficients of f(axesᵀ x) of f = Σ c_lm Θ_lm: from a frame with the columns of `axes` as axes to the outer one.

    Exact but for round-off: 1e-14 of the largest term at degree 50, in milliseconds.
    """
    if np.array_equal(axes, np.eye(3)):
        return coefficients
    last = np.arctan2(axes[1, 2], axes[0, 2])  # first about z, then about y, then about z again
    across = np.array([np.cos(last), np.sin(last), 0.0])
    middle = np.arctan2(across @ axes[:, 2], axes[2, 2])
    first = np.arctan2(*(np.array([-across[1], across[0], 0.0]) @ axes[:, :2]))
    degrees = np.arange(len(coefficients))
    l, m = np.meshgrid(degrees, degrees, indexing="ij")
    size = np.sqrt(factorials(len(coefficients) - 1))
    amplitudes = coefficients * np.where(m <= l, size, 0.0)
    for degree in degrees[1:]:
        orders, known = degrees[: degree + 1], amplitudes[degree, : degree + 1]
        below = (-1.0) ** orders[:0:-1] * np.conj(known[:0:-1])
        speeds, modes = _swings(int(degree))
        turned = np.concatenate([below, known]) * np.exp(-1j * first * np.arange(-degree, degree + 1))
        turned = modes @ (np.exp(-1j * middle * speeds) * (modes.conj().T @ turned))
        amplitudes[degree, : degree + 1] = turned[degree:] * np.exp(-1j * last * orders)
    return np.asarray(amplitudes / size)


@cache
def _swings(degree: int) -> tuple[Array, Coefficients]:
    """Eigenvalues (n,) and vectors (n, n) of the angular momentum about y among orders -degree to degree."""
    m = np.arange(-degree, degree)
    rising = np.diag(np.sqrt((degree - m) * (degree + m + 1.0)) / 2, -1)
    values, vectors = np.linalg.eigh((rising - rising.T) / 1j)
    return values, vectors
