"""Equilibria at the points of a map or a sweep, each with its stability: searched at some, continued to all others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ...fem.rotor.table import FieldFormula, FieldTable
from ...fem.rotor_metal import check_metal, pieces_of
from ...geometry.common import Array, InputError
from ...geometry.scene.contents import Scene
from ..equilibria.balance import DUPLICATE_DISTANCE, EVERY, Balance, Indices
from ..equilibria.curves import SearchRange, newton_search
from ..equilibria.equilibrium import MARGINAL, EquilibriumError, Modes, Survey, is_stable, spectra
from ..equilibria.path import continued
from ..equilibria.search import FixedPoints, check_turning, field_doubts, survey_of
from ..motion.effects import mean_over_turns, with_effects
from ..motion.equations import parameters
from ..motion.floater_effects import check_floater_metal
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales

FAR_APART = 1.5  # Equilibria are followed up to so many times the farthest distance of the ranges
SPACING = 5  # Points of the map between two searches
# One of so many searches has all starts, the others an eighth of them, which misses less than one in a hundred of a
# point's equilibria: a sheet is lost only if every search that meets it does.
WHOLE, PART = 64, 8
# Longest steps of the searches, rad of the moment and radii of the position, and beyond that distance (radii) as a part
# of it, as the field changes: with 0.3 rad and radii they are more than twice as many, and an eighth of the starts
# misses several times as much.
REACH, FAR = 0.8, 1.0
TOGETHER = 8  # Searches that are made as one batch: enough that NumPy's calls cost less than what they compute
MARGIN = 0.3  # Sheets are followed so far beyond the range (radii): what its border cuts into pieces is whole there


@dataclass(frozen=True, eq=False)
class Grid:
    """Problems at points with whole-numbered coordinates, whose equations have the same code."""

    rates: Rates  # of the points' tables
    values: Array  # (n, p) runtime parameters of the points
    spin: Array  # (n,) body spin s, as of a `Balance`
    ranges: Sequence[SearchRange]  # in which equilibria are looked for
    region: Indices  # (n,) which of them is the point's
    places: Indices  # (n, axes) coordinates; not every place of the grid need have a point

    def __len__(self) -> int:
        return len(self.values)

    def balance(self, point: Indices) -> Balance:
        return Balance(self.rates, self.values[point], self.spin[point])

    def alone(self, point: int) -> Balance:
        """The balance of one point, for any number of positions."""
        return Balance(self.rates, self.values[point], float(self.spin[point]))

    def range(self, point: int) -> SearchRange:
        return self.ranges[int(self.region[point])]

    def holds(self, point: Indices, position: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Which of the scaled positions (n, 3) lie in the range of their points (n,), or at most a margin outside."""
        inside = np.zeros(len(point), bool)
        for k in np.unique(self.region[point]):
            chosen = self.region[point] == k
            inside[chosen] = self.ranges[k].holds(position[chosen], margin)
        return inside

    def neighbours(self, point: Indices) -> tuple[Indices, Indices]:
        """Pairs of a place in `point` and one of the points beside it, up to two along each axis."""
        which, beside = [np.zeros(0, int)], [np.zeros(0, int)]
        for axis in range(self.places.shape[1]):
            for step in (1, -1):
                places = self.places[point] + step * np.eye(self.places.shape[1], dtype=int)[axis]
                inside = ((places >= 0) & (places < self._shape)).all(axis=1)
                found = np.full(len(places), -1)
                found[inside] = self._numbers[tuple(places[inside].T)]
                which.append(np.flatnonzero(found >= 0))
                beside.append(found[found >= 0])
        return np.concatenate(which), np.concatenate(beside)

    def coarse(self, spacing: int) -> Indices:
        """Points of a coarse grid with at most `spacing` steps between along each axis, the borders included."""
        chosen = np.ones(len(self), bool)
        for column in self.places.T:
            last = int(column.max())
            chosen &= np.isin(column, np.linspace(0, last, -(-last // spacing) + 1).round().astype(int))
        if len(self) < np.prod(self._shape):  # where its points are missing, others stand in for them
            for point in range(len(self)):
                apart = np.abs(self.places[chosen] - self.places[point]).max(axis=1, initial=0)
                chosen[point] |= not len(apart) or apart.min() > spacing
        return np.flatnonzero(chosen)

    @cached_property
    def _shape(self) -> tuple[int, ...]:
        return tuple(self.places.max(axis=0) + 1)

    @cached_property
    def _numbers(self) -> Indices:
        numbers = np.full(self._shape, -1)
        numbers[tuple(self.places.T)] = np.arange(len(self))
        return numbers


def filled(grid: Grid, nodes: Indices) -> tuple[Indices, Array, Array]:
    """Points (k,) in order, positions and moments (k, 3) of all equilibria of a grid, by searches at `nodes`."""
    random, seeds = np.random.default_rng(0), []
    for first in range(0, len(nodes), TOGETHER):
        some = range(first, min(first + TOGETHER, len(nodes)))
        starts = [grid.range(int(nodes[k])).starts() for k in some]
        starts = [one if k % WHOLE == 0 else one[random.choice(len(one), len(one) // PART, replace=False)]
                  for k, one in zip(some, starts, strict=True)]  # fmt: skip
        problem, points = np.repeat(nodes[some], [len(one) for one in starts]), np.concatenate(starts)
        seeds.append(newton_search(grid.balance, grid.holds, problem, points, EVERY, MARGIN, REACH, FAR))
    point, places = (np.concatenate(part) for part in zip(*seeds, strict=True))
    bound, known = FAR_APART * max(where.bound for where in grid.ranges), np.zeros((0, 7))
    while len(point):  # until nothing new is found
        # Of what is found anew at a point, all but the first within `DUPLICATE_DISTANCE` goes; points are 1 apart.
        every = np.concatenate([known, np.column_stack([point, places])])
        again = cKDTree(every).query_pairs(DUPLICATE_DISTANCE, output_type="ndarray")[:, 1]
        new = np.setdiff1d(np.arange(len(known), len(every)), again)
        point, places, known = every[new, 0].astype(int), every[new, 1:], np.delete(every, again, axis=0)
        source, target = grid.neighbours(point)
        if not len(source):
            break
        before, after = grid.balance(point[source]), grid.balance(target)
        which, arrived, position, moment = continued(before, after, places[source, :3], places[source, 3:], bound)
        point = np.where(arrived, target[which], point[source[which]])
        places = np.concatenate([position, moment], axis=1)
        inside = grid.holds(point, position, MARGIN)
        point, places = point[inside], places[inside]
    known = known[np.argsort(known[:, 0], kind="stable")]
    known = known[grid.holds(known[:, 0].astype(int), known[:, 1:4])]
    return known[:, 0].astype(int), known[:, 1:4], known[:, 4:]


@dataclass(frozen=True, eq=False)
class EquilibriumMap:
    """Equilibria (k,) of a map, point by point; rotor's frame."""

    grid: Grid  #: its points, row by row
    frequencies: Array  #: of the rows, Hz; a column is a scene
    #: row, column: (k,) place of each equilibrium
    row: Indices
    column: Indices
    #: position, moment: (k, 3) m and direction
    position: Array
    moment: Array
    eigenvalues: NDArray[np.complex128]  #: (k, 10) of the modes, 1/s
    errors: Array  #: (k,) what round-off may do to them, 1/s
    stable: NDArray[np.bool_]  #: (k,) whether no mode grows
    searches: int  #: points of the map at which all was searched for

    @property
    def growth_per_s(self) -> Array:
        return np.asarray(self.eigenvalues.real.max(axis=1))

    @property
    def lasting(self) -> NDArray[np.bool_]:
        return np.asarray(self.growth_per_s <= np.maximum(MARGINAL, self.errors))

    @property
    def number(self) -> tuple[Indices, Indices]:
        """Equilibria, and those that are `lasting`: two of (frequencies, scenes)."""
        shape = len(self.frequencies), len(self.grid) // len(self.frequencies)
        place, size = self.row * shape[1] + self.column, shape[0] * shape[1]
        every, stable = np.bincount(place, minlength=size), np.bincount(place[self.lasting], minlength=size)
        return every.reshape(shape), stable.reshape(shape)


def equilibrium_map(
    scenes: Sequence[Scene],
    tables: Sequence[FieldFormula],
    frequencies: ArrayLike,
    spin: float = 0.0,
    spacing: int = SPACING,
) -> EquilibriumMap:
    """All synchronous equilibria with z < 0 over a grid, with their stability; gravity along the axis, no plate.

    Raises EquilibriumError: a frequency is zero, or gravity has a part across the axis; InputError: at a frequency the
    rotor turns too fast for its metal or the floater's, the floater's moment is along none of its principal axes, or
    the tables' effects differ. The columns are `scenes`, from neighbour to neighbour, as of a rotor that is moved, in
    fields `tables` (n,), which have the same effects if they are `Interaction`s; the rows are `frequencies`, Hz. A
    floater that is not round about its moment is its mean over turns about that, by its multipoles; body `spin` is s.
    Between two searches there are `spacing` steps: a sheet between them is missed if it meets no other in a fold.
    """
    frequencies = np.atleast_1d(np.asarray(frequencies, float))
    if not frequencies.all() or any(np.any(scene.gravity[:2]) for scene in scenes):
        raise EquilibriumError(
            "Equilibria are fixed points only where the rotor turns and gravity is along its axis. Elsewhere use "
            "find_equilibria."
        )
    grid = map_grid(scenes, tables, frequencies, spin)
    nodes = grid.coarse(spacing)
    point, position, moment = filled(grid, nodes)
    row, column = grid.places[point].T
    balance = grid.balance(point)
    time, length = balance.values[:, [Parameter.TIME]], balance.values[:, [Parameter.LENGTH]]
    found = Modes(np.zeros((0, 10), complex), np.zeros((0, 10)), np.zeros((0, 12, 10)))
    if len(point):
        states = balance.states(position, moment)
        found = spectra(states, balance.rates(states, balance.values)[1])
    return EquilibriumMap(
        grid=grid,
        frequencies=frequencies,
        row=row,
        column=column,
        position=position * length,
        moment=moment,
        eigenvalues=np.asarray(found.eigenvalues / time, complex),
        errors=found.errors.max(axis=1, initial=0.0) / time[:, 0],
        stable=is_stable(found.eigenvalues, found.errors),
        searches=len(nodes),
    )


def map_grid(scenes: Sequence[Scene], tables: Sequence[FieldFormula], frequencies: Array, spin: float) -> Grid:
    """The points of a map, numbered row by row; all as of `equilibrium_map`."""
    fastest, rates, columns = float(np.abs(frequencies).max()), list[Rates](), list[Scene]()
    for scene, table in zip(scenes, tables, strict=True):
        floater = scene.floater
        if not (floater.round or floater.turns_freely):
            raise InputError(
                "Input floater must have its moment along a principal axis of inertia for a map, as the equilibria of "
                "another body are of no one kind; instead it has not. Take one scene a point (spinlev.sweep)."
            )
        columns.append(replace(scene, floater=floater if floater.round else floater.averaged))
        check_metal(pieces_of(scene.rotor, scene.conductors), fastest, floater.radius)
        check_floater_metal(replace(scene, frequency=fastest))
        mean = columns[-1].floater.mean
        whole = mean_over_turns(columns[-1], table)[2] if mean else with_effects(columns[-1], table)
        rates.append(rates[0].elsewhere(whole) if rates else Rates(whole, optimised=True))
    row, column = (part.ravel() for part in np.indices((len(frequencies), len(columns))))
    points = [replace(scene, frequency=float(f)) for f in frequencies for scene in columns]
    values, together = _together(points, [rates[k] for k in column])
    return Grid(
        rates=together,
        values=values,
        spin=spin * np.array([columns[k].floater.spin_ratio for k in column]),
        ranges=[SearchRange(scene, ball=scene.floater.mean) for scene in points[: len(columns)]],
        region=column,
        places=np.column_stack([row, column]),
    )


def _together(scenes: Sequence[Scene], rates: Sequence[Rates]) -> tuple[Array, Rates]:
    """Runtime parameters (n, p) of scenes, with the drag along the moment left out, and the rates of all of them."""
    values = np.array([parameters(scene, Scales.of(scene), frozen_spin=True) for scene in scenes])
    different = list(dict.fromkeys(rates))
    if any(one.code != different[0].code for one in different):
        raise InputError("Input tables must all have the same effects, as mutual magnetisation; instead they differ.")
    values[:, Parameter.TABLE] = [different.index(one) for one in rates]
    return values, different[0].among(different) if len(different) > 1 else different[0]


def surveys(
    scenes: Sequence[Scene],
    tables: Sequence[FieldTable],
    spin: Array,
    places: Indices,
    rates: Sequence[Rates],
) -> list[tuple[Survey, bool]]:
    """Survey of each scene as by `equilibria.survey`, without curves; neighbours help each other as in a map.

    Returns (n,) the surveys, and whether the scene's own point was searched. Raises EquilibriumError for a rotor at
    rest. The n `scenes`, whose plates are left out, have rotors' fields `tables`, for their errors, body `spin` (n,),
    whole-numbered coordinates `places` (n, axes) by which they are neighbours, and `rates` (n,) of one code, which
    scenes with one table share.
    """
    for scene in scenes:
        check_turning(scene)
    values, together = _together(scenes, rates)
    spin = spin * np.array([scene.floater.spin_ratio for scene in scenes])
    grid = Grid(together, values, spin, [SearchRange(scene) for scene in scenes], np.arange(len(scenes)), places)
    nodes = grid.coarse(SPACING if places.shape[1] > 1 else 2 * SPACING)
    point, position, moment = filled(grid, nodes)
    poses, found = np.concatenate([position, moment], axis=1), []
    for k, (scene, table) in enumerate(zip(scenes, tables, strict=True)):
        here = poses[point == k]
        known, doubts = field_doubts(table, here[:, :3] * scene.floater.radius)
        fixed = FixedPoints.at(grid.alone(k), here[known], doubts)
        found.append((survey_of(scene, grid.alone(k), fixed), k in nodes))
    return found
