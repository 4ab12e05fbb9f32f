"""The slab's reaction at one place to a dipole at another, by Hankel transforms; symbols as in `reaction`."""

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ...geometry.basics import MU_0, Array
from ..closed_forms import ComplexArray
from .reaction import Slab, checked, wave_numbers


def mutual_tensor(slab: Slab, points: ArrayLike, source: ArrayLike, frequency: ArrayLike) -> ComplexArray:
    """G (..., 3, 3), T/(A m²): reaction B = G m at `points` (..., 3) to a dipole m at `source` (..., 3), m.

    The face is z = 0.  Shapes broadcast, with `frequency` (Hz) against the leading ones.  Relative error below
    1e-11 up to a lateral distance of about 20 (z+z'); farther off, the oscillation takes more and more nodes.
    """
    points, source = np.broadcast_arrays(np.asarray(points, float), np.asarray(source, float))
    offset = points - source
    h, f = checked(np.minimum(points[..., 2], source[..., 2]), frequency)
    h, distance = np.broadcast_arrays((points[..., 2] + source[..., 2]) / 2, np.hypot(offset[..., 0], offset[..., 1]))
    aperture = min(np.pi / 4, 0.8 * float(np.min(np.arctan2(2 * h, distance))))
    h, distance, f = np.broadcast_arrays(h, distance, f)
    k, weight = wave_numbers(h, aperture)
    spectrum = weight * k * k * np.exp(-2 * k * h[..., None]) * slab.reflection(k, f[..., None])
    even, first, second = (np.sum(spectrum * scipy.special.jv(n, k * distance[..., None]), axis=-1) for n in (0, 1, 2))
    return -MU_0 / (4 * np.pi) * _angular(even, first, second, offset)


def _angular(even: ComplexArray, first: ComplexArray, second: ComplexArray, offset: Array) -> ComplexArray:
    """∂_i ∂'_j of the potential, from its Hankel moments of orders 0, 1 and 2 and the lateral `offset`."""
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    result = np.zeros((*even.shape, 3, 3), complex)
    result[..., 0, 0] = (even - second * np.cos(2 * angle)) / 2
    result[..., 1, 1] = (even + second * np.cos(2 * angle)) / 2
    result[..., 0, 1] = result[..., 1, 0] = -second * np.sin(2 * angle) / 2
    result[..., 2, 2] = even
    for axis, projection in ((0, np.cos(angle)), (1, np.sin(angle))):
        result[..., axis, 2] = first * projection
        result[..., 2, axis] = -first * projection
    return result
