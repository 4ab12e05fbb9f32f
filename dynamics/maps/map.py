"""Equilibria of a map with the stability of each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from ..motion import Parameter
from ..steady import Indices, is_stable, spectra
from .grid import Atlas, Grid


@dataclass(frozen=True, eq=False)
class EquilibriumMap:
    """Equilibria (k,) of a map, point by point; rotor's frame.

    Parameters
    ----------
    frequencies, measures : axes of the map, Hz and m or rad
    row, column : (k,) place of each equilibrium on them
    position, moment : (k, 3) m and direction
    eigenvalues : (k, 10) of the small motions, 1/s
    errors : (k,) what round-off may do to them, 1/s
    stable : (k,) whether every small motion stays small
    searches : points of the map at which all was searched for
    """

    frequencies: Array
    measures: Array
    row: Indices
    column: Indices
    position: Array
    moment: Array
    eigenvalues: NDArray[np.complex128]
    errors: Array
    stable: NDArray[np.bool_]
    searches: int

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


def judged(grid: Grid, atlas: Atlas, axes: tuple[Array, Array], searches: int) -> EquilibriumMap:
    """What an atlas knows within the range, all spectra in one call."""
    point, position, moment = atlas.within(grid)
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
        searches=searches,
    )
