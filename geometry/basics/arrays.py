"""Arrays that frozen objects hold."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def frozen_array(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Copy `values` into a read-only float array of the given shape."""
    array = np.array(values, dtype=float).reshape(shape)
    array.flags.writeable = False
    return array


def spread_points(lower: ArrayLike, upper: ArrayLike, number: int) -> Array:
    """Points (number, 3) spread evenly through a box: multiples of irrational numbers, modulo 1 (H. Weyl, 1916)."""
    parts = np.arange(1, number + 1)[:, None] * np.sqrt([2.0, 3.0, 5.0]) % 1.0
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    return np.asarray(low + parts * (high - low))
