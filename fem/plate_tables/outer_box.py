"""Boxes and frequencies on a coarse raster, so that what is nearly the same is solved for once."""

import numpy as np

from ...geometry.basics import Array
from ..plate_currents import Region

STEPS = 5.0
"""The raster is the largest power of two, in metres, of which so many fit between box and plate."""
FREQUENCY_STEP = 125.0
"""Highest frequencies are multiples of this, Hz."""
ROUND_OFF = 1e-6


def outer_box(box: Region, half_edges: Array) -> Region:
    """The box with its bounds moved outwards to the raster; at least 0.65 of its distance is left.

    Parameters
    ----------
    half_edges : (3,) m, of the plate
    """
    of_region, of_plate = box.nearest(half_edges)
    gap = float(np.linalg.norm(of_region - of_plate))
    if gap <= 0:
        return box
    step = 2.0 ** np.floor(np.log2(gap / STEPS))
    lower, upper = np.floor(box.lower / step + ROUND_OFF), np.ceil(box.upper / step - ROUND_OFF)
    return Region(lower * step, upper * step)


def outer_frequencies(frequencies: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest, Hz, with the highest rounded up."""
    low, high = frequencies
    return low, float(np.ceil(high / FREQUENCY_STEP - ROUND_OFF)) * FREQUENCY_STEP
