"""The surveys of many scenes at once, which have one rotor's field or differ in one measure of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...fem.rotor_tables import FieldTable
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..equilibria import Found, SearchRange, field_doubts, told, turning
from ..motion import Parameter, Rates, Scales, parameters
from ..steady import Indices, Survey
from .filling import SPACING, filled
from .grid import Grid


def surveys(
    scenes: Sequence[Scene],
    tables: Sequence[FieldTable],
    spin: Array,
    places: Indices,
    rates: Rates,
    measures: ArrayLike = 0.0,
    farthest: float = 0.1,
    spacing: int | None = None,
) -> list[tuple[Survey, bool]]:
    """What `equilibria.survey` finds for each scene, without its curves; neighbours help each other as in a map.

    Parameters
    ----------
    scenes : n scenes with one rotor, or of one family of rotors; their plates are left out
    tables : (n,) the rotors' fields, for their errors
    rates : compiled for the rotor or the family
    spin : (n,) body spin s
    places : (n, axes) whole-numbered coordinates by which scenes are neighbours
    measures : (n,) of the rotors in their family, see `RotorFamily`
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
    values[:, Parameter.MEASURE] = measures
    ranges = [SearchRange(scene, farthest) for scene in scenes]
    grid = Grid(rates, values, spin, ranges, np.arange(len(scenes)), places)
    nodes = grid.coarse(spacing or (SPACING if places.shape[1] > 1 else 2 * SPACING))
    point, position, moment = filled(grid, nodes).within(grid)
    points = np.concatenate([position, moment], axis=1)
    known, parts = np.zeros(len(points), bool), list[tuple[Indices, Array]]()
    for table in {id(table): table for table in tables}.values():
        (mine,) = np.nonzero(np.isin(point, [k for k, other in enumerate(tables) if other is table]))
        there, unsure = field_doubts(table, points[mine, :3] * values[point[mine], Parameter.LENGTH, None])
        known[mine] = there
        parts.append((mine[there], unsure))
    doubts = np.zeros((len(points), max(part.shape[1] for _, part in parts)))
    for which, part in parts:
        doubts[which, : part.shape[1]] = part
    point, points, doubts = point[known], points[known], doubts[known]
    found = [Found.at(grid.alone(k), points[point == k], doubts[point == k]) for k in range(len(scenes))]
    return [(told(scene, grid.alone(k), found[k]), k in nodes) for k, scene in enumerate(scenes)]
