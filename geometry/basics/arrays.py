"""Arrays that frozen objects hold."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def frozen_array(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Copy `values` into a read-only float array of the given shape."""
    array = np.array(values, dtype=float).reshape(shape)
    array.flags.writeable = False
    return array
