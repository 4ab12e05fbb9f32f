"""Reduction of a box-shaped plate to a passive network, to a wanted accuracy in a region and a range of frequencies.

The finite elements give a space of many currents (`plate_solution`), in which dipoles on a grid of the region and other
sources drive snapshots at a low, a middle and the highest frequency.  The network takes as many of their principal
components as the reaction tensors of dipoles off the grid need, at frequencies between as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ...geometry.meshes import MeshRule
from ...geometry.scenes import Plate
from ..eddy_currents import Source
from ..plate_currents import STRICT, CurrentSpace, OtherSources, PlateSolution, Region, grid_counts, solve_currents
from .network_error import ENOUGH, fewest_fields, refuse
from .training import Group, prepare_training

NETWORK_SHARE, STRICT_SHARE = 0.9, 0.8
"""Share of the tolerance for the finite elements and the states left out together; the rest is the field functions',
and that is more of a strict tolerance."""


@dataclass(frozen=True, eq=False)
class PlateNetwork:
    """Currents in a plate as states: dp_i/dt = -λ_i (p_i - s_i), with y_i = p_i - s_i the current of field e_i.

    Parameters
    ----------
    plate : the conductor; fields and region are in its own frame
    region : where the floater may be
    frequencies : lowest and highest, Hz
    space : of the currents, with the fields e_i (of unit inductance) and the inductances of each parity class's part
    groups : parity groups
    rates : (states,) λ_i, 1/s, for each group
    mesh_error, state_error : estimated relative errors of reaction tensors
    seconds : time spent on the finite elements
    """

    plate: Plate
    region: Region
    frequencies: tuple[float, float]
    space: CurrentSpace
    groups: tuple[Group, ...]
    rates: tuple[Array, ...]
    mesh_error: float
    state_error: float
    seconds: float

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """s_i = ∫ σ e_i·A_s dV, √J, of sources in the plate's frame: (sources, states) for each group."""
        return self._by_group(self.space.couplings(sources))

    def dipole_couplings(self, places: ArrayLike) -> list[Array]:
        """The same of unit moments along x, y and z at `places` (n, 3), m."""
        return self._by_group(self.space.dipole_couplings(places))

    def _by_group(self, parts: Sequence[Array]) -> list[Array]:
        return [np.sum([parts[number] for number in group.classes], axis=0) for group in self.groups]


def reduce_plate(
    plate: Plate,
    region: Region,
    frequencies: tuple[float, float] = (0.5, 250.0),
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
    others: OtherSources | None = None,
) -> PlateNetwork:
    """The network of a plate for dipoles in `region` and all frequencies between the two (Hz).

    Parameters
    ----------
    rtol : relative accuracy of reaction tensors (Frobenius norm); the network's share of it is used here
    rule : mesh (default by `rtol`)
    others : more sources whose currents the network shall hold: the rotor's

    Raises
    ------
    ValueError : region in the plate, frequencies not 0 < lowest < highest, or rtol not between 0 and 1
    AccuracyError : the mesh is too coarse for `rtol`, or the frequencies do not suffice
    """
    checked_ranges(frequencies, rtol)
    others = others or OtherSources()
    solution = solve_currents(plate, [region], frequencies, rtol, rule, others)
    return reduce_currents(plate, solution, region, frequencies, rtol, others, solution.space_error)


def reduce_currents(
    plate: Plate,
    solution: PlateSolution,
    region: Region,
    frequencies: tuple[float, float],
    rtol: float,
    others: OtherSources,
    space_error: float,
    functions_error: float = 0.0,
) -> PlateNetwork:
    """The network for a region within the boxes and frequencies within those of a `solution`.

    Parameters
    ----------
    space_error : what the solution's states miss of reaction tensors and of the others' fields, relative
    functions_error : what field functions will miss, where that is more than the share left to them

    Raises
    ------
    AccuracyError : all of the solution's states do not suffice
    """
    share = NETWORK_SHARE if rtol >= STRICT else STRICT_SHARE
    allowed = min(share * rtol, rtol - functions_error) - solution.mesh_error - space_error
    counts = grid_counts(region, plate.box.half_edges)
    training = prepare_training(solution.space, region, counts, frequencies, others)
    chosen, state_error = fewest_fields(training.worst, training.basis(), allowed)
    if state_error > allowed:
        missed = state_error + functions_error + solution.mesh_error + space_error
        refuse(rtol, ENOUGH * max(missed, rtol), "this plate and this place of the floater")
    rates, fields = zip(*[part.diagonalised() for part in chosen], strict=True)
    return PlateNetwork(
        plate, region, frequencies, part_of_space(solution.space, training.groups, fields), tuple(training.groups),
        rates, solution.mesh_error, state_error + space_error, solution.seconds,
    )  # fmt: skip


def part_of_space(space: CurrentSpace, groups: Sequence[Group], fields: Sequence[Array]) -> CurrentSpace:
    """The space that holds, in each class, the part there of `fields` (states, coordinates) of each group."""
    rows, inductances = list(space.fields), list(space.inductances)
    for group, states in zip(groups, fields, strict=True):
        ends = np.cumsum([len(space.inductances[number]) for number in group.classes])
        for number, part in zip(group.classes, np.split(states, ends[:-1], axis=1), strict=True):
            rows[number] = part @ space.fields[number]
            inductances[number] = part @ space.inductances[number] @ part.T
    return replace(space, fields=tuple(rows), inductances=tuple(inductances))


def checked_ranges(frequencies: tuple[float, float], rtol: float) -> tuple[float, float]:
    """The frequencies (Hz), once they and the tolerance are found good.

    Raises
    ------
    ValueError : they are not
    """
    low, high = frequencies
    if not 0 < low < high < np.inf:
        raise ValueError(f"Input frequencies_hz must be positive and increasing; instead received {frequencies}.")
    if not 0 < rtol < 1:
        raise ValueError(f"Input rtol must be between 0 and 1; instead received {rtol}.")
    return low, high
