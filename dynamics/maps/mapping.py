"""All equilibria and their stability over frequencies and measures of the rotor."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ..equilibria import SearchRange
from ..steady import EquilibriumError
from .families import RotorFamily
from .filling import SPACING, filled
from .grid import Grid
from .map_stability import EquilibriumMap, judged


def equilibrium_map(
    family: RotorFamily,
    frequencies: ArrayLike,
    measures: ArrayLike,
    spin: float = 0.0,
    farthest: float = 0.1,
    spacing: int = SPACING,
    progress: Callable[[float], None] | None = None,
) -> EquilibriumMap:
    """All synchronous equilibria with z < 0 over a grid, with their stability; gravity along the axis, no plate.

    Parameters
    ----------
    family : the scenes; nothing is compiled again within a family
    frequencies, measures : axes, Hz and m or rad
    spin : body spin s
    farthest : largest depth, and distance from the axis, m
    spacing : steps of the grid between two searches; a sheet between them is missed if it meets no other in a fold
    progress : called with the finished part, 0 to 1

    Raises
    ------
    EquilibriumError : a frequency is zero, or gravity has a part across the axis
    """
    axes = np.atleast_1d(np.asarray(frequencies, float)), np.atleast_1d(np.asarray(measures, float))
    if not axes[0].all() or np.any(family.scene.gravity[:2]):
        raise EquilibriumError(
            "Equilibria are fixed points only where the rotor turns and gravity is along its axis. Elsewhere use "
            "find_equilibria."
        )
    grid = family_grid(family, *axes, spin, farthest)
    nodes = grid.coarse(spacing)
    return judged(grid, filled(grid, nodes, progress), axes, len(nodes))


def family_grid(family: RotorFamily, frequencies: Array, measures: Array, spin: float, farthest: float) -> Grid:
    """The points of a map, numbered row by row."""
    row, column = (part.ravel() for part in np.indices((len(frequencies), len(measures))))
    return Grid(
        rates=family.rates,
        values=family.values(frequencies[row], measures[column]),
        spin=np.full(len(row), spin),
        ranges=[SearchRange(family.at(frequencies[0], measure), farthest) for measure in measures],
        region=column,
        places=np.column_stack([row, column]),
    )
