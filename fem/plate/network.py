"""A passive resistor-inductor network from snapshots of the currents: proper orthogonal decomposition, then Galerkin.

In the span of real fields e_i, whose currents σe_i have the potentials a_i, the eddy currents answer a source A_s by

    (R + iωL) c = -iω b,    R_ij = ∫ σ e_i·e_j,    L_ij = ∫ σ e_i·a_j,    b_i = ∫ σ e_i·A_s,

and their coupling to another source is b'·c.  R and L are Gram matrices of power and of energy, hence positive: the
network is passive whatever is left out.  A source whose own field lies in the span is answered exactly, and the error
of a coupling is the product of two projection errors.  The basis is reduced first and diagonalised afterwards:
R w = λ L w with wᵀ L w = 1 (eigenmodes of the plate itself converge far more slowly).
M. Clemens, T. Weiland, IEEE Trans. Magn. 35 (1999) 1163 (discrete eddy-current operators).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ...geometry.common import Array
from ...geometry.meshes.plate import MeshRule
from ...geometry.scene.contents import Plate
from ..closed_forms.eddy_sphere import ComplexArray
from ..elements.spaces import Parity
from ..rotor.models import AccuracyError
from .currents import CurrentSpace, OtherSources, grid_counts, probe_places, space_couplings, unit_power
from .eddy import Source
from .reaction import OPTION
from .region import Region
from .solution import STRICT, PlateSolution, solve_currents

NEGLIGIBLE = 1e-12
"""Snapshot energies below this share of the largest are round-off."""


@dataclass(frozen=True, eq=False)
class OrderedBasis:
    """Fields in the order of their importance, and their network.

    Parameters
    ----------
    energies : (n,) of the snapshots along each field, decreasing
    fields : (n, width) weighted rows e_i
    resistance, inductance : (n, n)
    """

    energies: Array
    fields: Array
    resistance: Array
    inductance: Array

    def leading(self, energy: float) -> OrderedBasis:
        """The part whose energies exceed a level."""
        n = int(np.sum(self.energies > energy))
        return OrderedBasis(self.energies[:n], self.fields[:n], self.resistance[:n, :n], self.inductance[:n, :n])

    def diagonalised(self) -> tuple[Array, Array]:
        """Rates (n,), 1/s, increasing, and the fields (n, width) that belong to them, of unit inductance."""
        if not len(self.energies):
            return self.energies, self.fields
        rates, vectors = scipy.linalg.eigh(self.resistance, self.inductance)
        return rates, vectors.T @ self.fields

    def couplings(self, rows: Array, angular_frequency: float) -> ComplexArray:
        """(sources, sources) -iω b (R + iωL)⁻¹ bᵀ of sources with weighted potentials `rows` (sources, width)."""
        b = rows @ self.fields.T
        impedance = self.resistance + 1j * angular_frequency * self.inductance
        return np.asarray(-1j * angular_frequency * b @ np.linalg.solve(impedance, b.T))


def ordered_basis(
    sources: Array, reactions: Sequence[ComplexArray], angular_frequencies: Sequence[float], scales: Sequence[Array]
) -> OrderedBasis:
    """Basis from the answers to `sources` (n, width) at several frequencies.

    Parameters
    ----------
    reactions : A (n, width) for each angular frequency (rad/s), weighted as the sources
    scales : (n,) for each frequency, how much a snapshot counts
    """
    fields, potentials = [], []
    for reaction, omega, scale in zip(reactions, angular_frequencies, scales, strict=True):
        weight = scale[:, None]
        fields += [weight * (sources + reaction.real), weight * reaction.imag]
        potentials += [-weight / omega * reaction.imag, weight / omega * reaction.real]
    e, a = np.concatenate(fields), np.concatenate(potentials)
    resistance, inductance = e @ e.T, a @ e.T
    inductance = (inductance + inductance.T) / 2
    reference = float(np.sqrt(max(angular_frequencies) * min(angular_frequencies)))
    energies, vectors = np.linalg.eigh(resistance + reference * inductance)
    kept = np.flatnonzero(energies > NEGLIGIBLE * energies.max(initial=0.0))[::-1]
    mixed = vectors[:, kept] / np.sqrt(energies[kept])
    return OrderedBasis(energies[kept], mixed.T @ e, mixed.T @ resistance @ mixed, mixed.T @ inductance @ mixed)


def leading_fields(snapshots: Array, inductance: Array, reference: float) -> OrderedBasis:
    """Basis from snapshots (m, n) in coordinates in which the resistance is 1.

    Parameters
    ----------
    inductance : (n, n) in these coordinates
    reference : angular frequency (rad/s) at which energy and power count alike
    """
    root = np.linalg.cholesky(np.eye(len(inductance)) + reference * inductance)
    energies, vectors = np.linalg.eigh(root.T @ (snapshots.T @ snapshots) @ root)
    kept = np.flatnonzero(energies > NEGLIGIBLE * energies.max(initial=0.0))[::-1]
    fields = scipy.linalg.solve_triangular(root, vectors[:, kept], lower=True, trans="T").T
    return OrderedBasis(energies[kept], fields, fields @ fields.T, fields @ inductance @ fields.T)


LARGEST = 0.1
"""Tolerance that may be asked at most."""
ENOUGH = 2.0
"""A tolerance that is met with certainty, in units of the errors of a table that was to meet a smaller one."""


def coupling_error(found: ComplexArray, truth: ComplexArray, places: int) -> float:
    """Largest relative error of own tensors and of other sources' fields, in couplings (sources, sources).

    Three dipoles at each of some places come first, then the others.
    """
    pairs = zip(_seen(found, places), _seen(truth, places), strict=True)
    return max(float(_relative(f, t).max(initial=0.0)) for f, t in pairs)


def _seen(couplings: ComplexArray, places: int) -> tuple[ComplexArray, ComplexArray]:
    """Own tensors (places, 9), and fields (other sources, components at all places)."""
    n = places
    blocks = couplings[: 3 * n, : 3 * n].reshape(n, 3, n, 3)
    return np.einsum("iaib->iab", blocks).reshape(n, 9), couplings[3 * n :, : 3 * n]


def _relative(found: ComplexArray, truth: ComplexArray) -> Array:
    return np.asarray(np.linalg.norm(found - truth, axis=1) / np.linalg.norm(truth, axis=1))


def fewest_fields(
    worst: Callable[[Sequence[OrderedBasis]], float], basis: Sequence[OrderedBasis], tolerance: float
) -> tuple[list[OrderedBasis], float]:
    """The fewest leading fields whose `worst` error meets the tolerance, and that error."""
    levels = np.sort(np.concatenate([part.energies for part in basis]))[::-1]
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        error = worst([part.leading(levels[middle]) for part in basis])
        low, high = (low, middle) if error <= tolerance else (middle + 1, high)
    chosen = [part.leading(levels[low]) for part in basis]
    return chosen, worst(chosen)


def refuse(rtol: float, enough: float, conductor: str) -> NoReturn:
    """Refuse a tolerance that a table of a conductor, in words, misses, where `enough` can be met.

    Raises
    ------
    AccuracyError : always
    """
    unit = 10.0 ** math.floor(math.log10(enough))
    enough = math.ceil(enough / unit - 1e-9) * unit
    if enough > LARGEST:
        raise AccuracyError(
            f"Input {OPTION} must be at least {enough:.2g} for {conductor}, more than the {LARGEST:g} that is allowed; "
            f"instead received {rtol:g}. Move the plate away from the floater, or choose another model of it."
        )
    raise AccuracyError(f"Input {OPTION} must be at least {enough:.2g} for {conductor}; instead received {rtol:g}.")


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
