"""The few states of a table, out of the many of a plate's current space: what they must hold, and their error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
from scipy.stats import qmc

from ..geometry.box import Array
from .current_space import CurrentSpace, space_couplings
from .current_training import unit_power
from .eddy_space import Source
from .network_error import coupling_error
from .parity import Parity
from .phasor import ComplexArray
from .plate_region import Region
from .pod import OrderedBasis, leading_fields

PROBES = 6
"""Dipoles at places off the grid, beside those at the region's corners."""
FREQUENCIES = 7
"""Errors are looked at at so many, in equal ratios."""
MOST_PLACES, FEWEST_PLACES, PER_GAP = 6, 3, 1.5
"""Places of the grid along an edge: at most, at least, and more for each distance to the plate that it is long."""


@dataclass(frozen=True, eq=False)
class OtherSources:
    """What drives the plate beside a dipole in the region: the rotor.

    Parameters
    ----------
    training : sources in the plate's frame whose currents the network shall hold
    probes : others of the kind; the field of their currents is asked for in the region
    places : (n, 3) m, where they are: the mesh must do for dipoles there
    """

    training: Sequence[Source] = ()
    probes: Sequence[Source] = ()
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True)
class Group:
    """Parity classes that the region mixes, by their numbers among the classes of the mesh."""

    classes: tuple[int, ...]


def parity_groups(parity: Parity, mirrors: Sequence[int]) -> list[Group]:
    """Classes of the mesh sorted by their parity about those of its planes that also mirror the region."""
    common = [k for k, axis in enumerate(parity.mirrors) if axis in mirrors]
    sorted_classes: dict[tuple[int, ...], list[int]] = {}
    for number, signs in enumerate(parity.classes):
        sorted_classes.setdefault(tuple(signs[k] for k in common), []).append(number)
    return [Group(tuple(numbers)) for numbers in sorted_classes.values()]


def joined(parts: Sequence[Array], groups: Sequence[Group]) -> list[Array]:
    """Couplings (sources, states) of the classes of each group side by side."""
    return [np.concatenate([parts[number] for number in group.classes], axis=1) for group in groups]


@dataclass(frozen=True, eq=False)
class Training:
    """Sources of one region in a current space.

    Parameters
    ----------
    groups : of parity classes
    inductances : of each group
    driving : couplings of the training sources by group
    scale : how much each counts
    testing : couplings of the probes by group: three dipoles at each place, then other sources
    places : of the probes
    frequencies : lowest and highest, Hz
    """

    groups: Sequence[Group]
    inductances: Sequence[Array]
    driving: Sequence[Array]
    scale: Array
    testing: Sequence[Array]
    places: int
    frequencies: tuple[float, float]

    def basis(self) -> list[OrderedBasis]:
        """Bases of all groups; snapshots count by the reaction at their frequency, to which errors are relative."""
        low, high = self.frequencies
        omegas = [2 * np.pi * f for f in (low, low**0.25 * high**0.75, high)]
        sizes = [np.linalg.norm(np.diagonal(self.truth(w))[: 3 * self.places]) / w for w in omegas]
        found = []
        for b, inductance in zip(self.driving, self.inductances, strict=True):
            answers = [
                self.scale[:, None]
                / np.sqrt(size)
                * np.linalg.solve(np.eye(len(inductance)) + 1j * omega * inductance, b.T).T
                for omega, size in zip(omegas, sizes, strict=True)
            ]
            snapshots = np.concatenate([part for answer in answers for part in (answer.real, answer.imag)])
            found.append(leading_fields(snapshots, inductance, float(np.sqrt(omegas[0] * omegas[-1]))))
        return found

    def truth(self, omega: float) -> ComplexArray:
        """(probes, probes) couplings of the whole space."""
        return space_couplings(self.testing, self.inductances, omega)

    def worst(self, basis: Sequence[OrderedBasis]) -> float:
        """Largest relative error of the dipoles' own tensors and, at their places, of the other sources' fields."""
        return max(self._error(basis, 2 * np.pi * f) for f in np.geomspace(*self.frequencies, FREQUENCIES))

    def _error(self, basis: Sequence[OrderedBasis], omega: float) -> float:
        parts = [part.couplings(b, omega) for part, b in zip(basis, self.testing, strict=True)]
        return coupling_error(np.asarray(sum(parts)), self.truth(omega), self.places)


def prepare_training(
    space: CurrentSpace,
    region: Region,
    counts: tuple[int, int, int],
    frequencies: tuple[float, float],
    others: OtherSources,
) -> Training:
    """Dipoles on a grid in `region` and `others`, with probes, in the coordinates of a current space."""
    groups = parity_groups(space.parity, region.mirrors)
    probes = probe_places(region, fold=True)
    driving, testing = (
        [np.concatenate(pair) for pair in zip(space.dipole_couplings(places), space.couplings(more), strict=True)]
        for places, more in ((region.grid(counts, fold=True), others.training), (probes, others.probes))
    )
    power = np.sum([np.sum(part**2, axis=1) for part in driving], axis=0)
    return Training(
        groups,
        [scipy.linalg.block_diag(*(space.inductances[number] for number in group.classes)) for group in groups],
        joined(driving, groups),
        unit_power(power, len(others.training)),
        joined(testing, groups),
        len(probes),
        frequencies,
    )


def grid_counts(region: Region, half_edges: Array) -> tuple[int, int, int]:
    """Places along each edge of a region: more where it is long against its distance from the plate."""
    of_region, of_plate = region.nearest(half_edges)
    gap = float(np.linalg.norm(of_region - of_plate))
    wanted = np.ceil(2 + PER_GAP * (region.upper - region.lower) / gap)
    x, y, z = np.clip(wanted, FEWEST_PLACES, MOST_PLACES).astype(int)
    return int(x), int(y), int(z)


def probe_places(region: Region, fold: bool = False) -> Array:
    """(n, 3) m: corners of the region, folded those not mirrored, and some places within."""
    inside = qmc.scale(qmc.Halton(3, seed=1).random(PROBES), region.lower, region.upper)
    return np.concatenate([region.surface((2, 2, 2), fold), inside])
