"""Spherical harmonics: orthonormal on the unit sphere, and what mirrors do to expansion coefficients."""

import numpy as np

from ...geometry.basics import Array
from .solid import Coefficients, factorials, regular_values

FOUR_PI = 4 * np.pi
Keys = list[tuple[int, int, bool]]
"""Degree l, order m, and whether it is the imaginary part."""


def norm(l: int, m: int) -> float:
    """Factor that makes Re Υ_lm, and Im Υ_lm if m > 0, orthonormal on the unit sphere."""
    square = (2 * l + 1) / FOUR_PI * factorials(l)[l, m]
    return float(np.sqrt(square if m == 0 else 2 * square))


def orthonormal_keys(degree: int) -> Keys:
    """The real harmonics up to a degree, in the order of the columns of `orthonormal`."""
    return [
        (l, m, imaginary)
        for l in range(degree + 1)
        for m in range(l + 1)
        for imaginary in ((False,) if m == 0 else (False, True))
    ]


def orthonormal(keys: Keys, points: Array) -> Array:
    """Real orthonormal harmonics (n, columns) in the directions of `points` (n, 3)."""
    degree = max(l for l, _, _ in keys)
    harmonics = regular_values(degree, *(points / np.linalg.norm(points, axis=1)[:, None]).T)
    parts = [harmonics[l, m].imag if imaginary else harmonics[l, m].real for l, m, imaginary in keys]
    return np.stack([norm(l, m) * part for (l, m, _), part in zip(keys, parts, strict=True)], axis=1)


def harmonic_parity(key: tuple[int, int, bool], axis: int) -> int:
    """Whether a real harmonic is even (+1) or odd (-1) at the plane across a coordinate axis."""
    l, m, imaginary = key
    odd = ((m + imaginary) % 2, int(imaginary), (l + m) % 2)[axis]
    return -1 if odd else 1


def mirrored_harmonics(coefficients: Coefficients, axis: int) -> Coefficients:
    """Coefficients of f(S x), with S the mirror at the plane across a coordinate axis, of f = Σ c_lm Θ_lm."""
    l, m = np.indices(coefficients.shape)
    if axis == 2:
        return np.asarray((-1.0) ** (l + m) * coefficients)
    return np.asarray((-1.0) ** (m if axis == 0 else 0 * m) * np.conj(coefficients))


def outer_coefficients(amplitudes: Array, keys: Keys, degree: int) -> Coefficients:
    """c_lm of Σ c_lm Θ_lm that is Σ a_k Y_k on the unit sphere, `amplitudes` a_k of the orthonormal harmonics Y_k."""
    result = np.zeros((degree + 1, degree + 1), complex)
    for value, (l, m, imaginary) in zip(amplitudes, keys, strict=True):
        result[l, m] += (2 * l + 1) / FOUR_PI / norm(l, m) * (-1j * value if imaginary else value)
    return result
