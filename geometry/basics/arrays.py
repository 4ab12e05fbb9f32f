"""Constants of nature and of the experiment's materials, and arrays that frozen objects hold."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
MU_0 = 4e-7 * math.pi
"""Vacuum permeability, T m/A (the value before 2019; the relative difference is 5e-10)."""
MAGNET_CONDUCTIVITY = 6.7e5
"""Electrical conductivity of sintered NdFeB, S/m; makers give 6.2e5 to 9e5."""


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


def even_directions(number: int) -> Array:
    """Unit vectors (number, 3) all around, evenly: a spiral of the golden angle."""
    steps = np.arange(number) + 0.5
    height, angle = 1 - 2 * steps / number, np.pi * (1 + 5**0.5) * steps
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)
