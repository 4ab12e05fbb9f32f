"""Equilibria of a map with the stability of each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fem.rotor.table import FieldTable
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ..equilibria.balance import Indices
from ..equilibria.curves import SearchRange
from ..equilibria.equilibrium import EquilibriumError, Survey
from ..equilibria.modes import is_stable, spectra
from ..equilibria.search import FixedPoints, check_turning, field_doubts, survey_of
from ..motion.equations import parameters
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales
from .grid import SPACING, Grid, filled
from .rotor_family import RotorFamily


@dataclass(frozen=True, eq=False)
class EquilibriumMap:
    """Equilibria (k,) of a map, point by point; rotor's frame."""

    # frequencies, measures: axes of the map, Hz and m or rad
    frequencies: Array
    measures: Array
    # row, column: (k,) place of each equilibrium on them
    row: Indices
    column: Indices
    # position, moment: (k, 3) m and direction
    position: Array
    moment: Array
    eigenvalues: NDArray[np.complex128]  # (k, 10) of the small motions, 1/s
    errors: Array  # (k,) what round-off may do to them, 1/s
    stable: NDArray[np.bool_]  # (k,) whether every small motion stays small
    searches: int  # points of the map at which all was searched for

    @property
    def growth_per_s(self) -> Array:
        """(k,) largest growth rate of a small motion."""
        return np.asarray(self.eigenvalues.real.max(axis=1))

    @property
    def number(self) -> tuple[Indices, Indices]:
        """Equilibria and stable equilibria at each point: two of (frequencies, measures)."""
        shape = len(self.frequencies), len(self.measures)
        place, size = self.row * shape[1] + self.column, shape[0] * shape[1]
        every, stable = np.bincount(place, minlength=size), np.bincount(place[self.stable], minlength=size)
        return every.reshape(shape), stable.reshape(shape)


def equilibrium_map(
    family: RotorFamily,
    frequencies: ArrayLike,
    measures: ArrayLike,
    spin: float = 0.0,
    spacing: int = SPACING,
) -> EquilibriumMap:
    """All synchronous equilibria with z < 0 over a grid, with their stability; gravity along the axis, no plate.

    Parameters
    ----------
    family : the scenes; nothing is compiled again within a family
    frequencies, measures : axes, Hz and m or rad
    spin : body spin s
    spacing : steps of the grid between two searches; a sheet between them is missed if it meets no other in a fold

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
    grid = family_grid(family, *axes, spin)
    nodes = grid.coarse(spacing)
    point, position, moment = filled(grid, nodes).within(grid)
    row, column = grid.places[point].T
    balance = grid.balance(point)
    time, length = balance.values[:, [Parameter.TIME]], balance.values[:, [Parameter.LENGTH]]
    values, errors = np.zeros((0, 10), complex), np.zeros((0, 10))
    if len(point):
        states = balance.states(position, moment)
        values, errors, _ = spectra(states, balance.rates(states, balance.values)[1])
    return EquilibriumMap(
        frequencies=axes[0],
        measures=axes[1],
        row=row,
        column=column,
        position=position * length,
        moment=moment,
        eigenvalues=np.asarray(values / time, complex),
        errors=errors.max(axis=1, initial=0.0) / time[:, 0],
        stable=is_stable(values, errors),
        searches=len(nodes),
    )


def family_grid(family: RotorFamily, frequencies: Array, measures: Array, spin: float) -> Grid:
    """The points of a map, numbered row by row: `frequencies` (Hz), `measures` of a `family`, body `spin`."""
    row, column = (part.ravel() for part in np.indices((len(frequencies), len(measures))))
    return Grid(
        rates=family.rates,
        values=family.values(frequencies[row], measures[column]),
        spin=np.full(len(row), spin),
        ranges=[SearchRange(family.at(frequencies[0], measure)) for measure in measures],
        region=column,
        places=np.column_stack([row, column]),
    )


def surveys(
    scenes: Sequence[Scene],
    tables: Sequence[FieldTable],
    spin: Array,
    places: Indices,
    rates: Rates,
    measures: ArrayLike = 0.0,
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

    Returns
    -------
    (n,) the surveys, and whether the scene's own point was searched. Raises EquilibriumError for a rotor at rest.
    """
    for scene in scenes:
        check_turning(scene)
    values = np.array([parameters(scene, Scales.of(scene), frozen_spin=True) for scene in scenes])
    values[:, Parameter.MEASURE] = measures
    ranges = [SearchRange(scene) for scene in scenes]
    grid = Grid(rates, values, spin, ranges, np.arange(len(scenes)), places)
    nodes = grid.coarse(SPACING if places.shape[1] > 1 else 2 * SPACING)
    point, position, moment = filled(grid, nodes).within(grid)
    poses, found = np.concatenate([position, moment], axis=1), []
    for k, (scene, table) in enumerate(zip(scenes, tables, strict=True)):
        here = poses[point == k]
        known, doubts = field_doubts(table, here[:, :3] * scene.floater.radius)
        fixed = FixedPoints.at(grid.alone(k), here[known], doubts)
        found.append((survey_of(scene, grid.alone(k), fixed), k in nodes))
    return found
