"""The surveys of many scenes at once, which differ in numbers but not in the rotor's field."""

from collections.abc import Sequence

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..equilibria import SearchRange, field_doubts, told, turning
from ..motion import Parameter, Rates, Scales, parameters
from ..steady import Indices, Survey
from .filling import SPACING, filled
from .grid import Grid


def surveys(
    scenes: Sequence[Scene],
    table: FieldTable,
    spin: Array,
    places: Indices,
    rates: Rates,
    farthest: float = 0.1,
    spacing: int | None = None,
) -> list[tuple[Survey, bool]]:
    """What `equilibria.survey` finds for each scene, without its curves; neighbours help each other as in a map.

    Parameters
    ----------
    scenes : n scenes with one rotor; their plates are left out
    table, rates : the rotor's field, and compiled for it
    spin : (n,) body spin s
    places : (n, axes) whole-numbered coordinates by which scenes are neighbours
    farthest : largest depth, and distance from the axis, m
    spacing : steps between two searches, None for 5, and 10 along a single axis; a sheet between them is missed if it
        meets no other in a fold

    Returns
    -------
    (n,) the surveys, and whether the scene's own point was searched. Raises EquilibriumError for a rotor at rest.
    """
    for scene in scenes:
        turning(scene)
    values = np.array([parameters(scene, Scales.of(scene), frozen_spin=True) for scene in scenes])
    ranges = [SearchRange(scene, farthest) for scene in scenes]
    grid = Grid(rates, values, spin, ranges, np.arange(len(scenes)), places)
    nodes = grid.coarse(spacing or (SPACING if places.shape[1] > 1 else 2 * SPACING))
    point, position, moment = filled(grid, nodes).within(grid)
    known, doubts = field_doubts(table, position * values[point, Parameter.LENGTH, None])
    point, points = point[known], np.concatenate([position, moment], axis=1)[known]
    return [
        (told(scene, grid.alone(k), points[point == k], doubts[point == k]), k in nodes)
        for k, scene in enumerate(scenes)
    ]
