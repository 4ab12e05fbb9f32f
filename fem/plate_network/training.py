"""The few states of a table, out of the many of a plate's current space: what they must hold, and their error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ...geometry.basics import Array
from ..closed_forms import ComplexArray
from ..elements import Parity
from ..plate_currents import CurrentSpace, OtherSources, Region, probe_places, space_couplings, unit_power
from .energy_basis import OrderedBasis, leading_fields
from .network_error import coupling_error

FREQUENCIES = 7
"""Errors are looked at at so many, in equal ratios."""


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
        return space_couplings(self.testing, self.inductances, 1j * omega)

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
