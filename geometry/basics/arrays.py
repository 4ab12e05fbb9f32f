"""Arrays that frozen objects hold."""

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def frozen_array(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Copy `values` into a read-only float array of the given shape."""
    array = np.array(values, dtype=float).reshape(shape)
    array.flags.writeable = False
    return array


def spread_points(lower: ArrayLike, upper: ArrayLike, number: int) -> Array:
    """Points (number, 3) spread evenly through a box, always the same ones (J. H. Halton, 1960)."""
    return np.asarray(scipy.stats.qmc.scale(scipy.stats.qmc.Halton(3, seed=1).random(number), lower, upper))
