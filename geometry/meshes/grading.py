"""One-dimensional graded partitions: where the grid lines of a structured mesh lie."""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from ..basics import Array

SizeFunction = Callable[[Array], Array]
SAMPLES = 4000


def graded_partition(breakpoints: Sequence[float], size: SizeFunction) -> Array:
    """Increasing grid lines that hold all `breakpoints` and whose spacing follows `size`.

    Between neighbouring breakpoints the lines share ∫ dx/size equally, so that no cell is larger than asked for.

    Raises
    ------
    ValueError : breakpoints do not increase
    """
    if np.any(np.diff(breakpoints) <= 0):
        raise ValueError(f"Input breakpoints must increase; instead received {list(breakpoints)}.")
    lines = [float(breakpoints[0])]
    for start, end in itertools.pairwise(breakpoints):
        fine = np.linspace(start, end, SAMPLES)
        density = 1 / size(fine)
        count = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(fine))])
        cells = max(1, int(np.ceil(count[-1] - 1e-9)))
        lines.extend(np.interp(np.arange(1, cells) * count[-1] / cells, count, fine))
        lines.append(float(end))
    return np.array(lines)
