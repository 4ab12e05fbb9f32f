"""Passive networks of few states from snapshots of the currents: proper orthogonal decomposition, then Galerkin.

In the span of real fields e_i, whose currents σe_i have the potentials a_i, the eddy currents of a source A_s are

    (R + iωL) c = -iω b,    R_ij = ∫ σ e_i·e_j,    L_ij = ∫ σ e_i·a_j,    b_i = ∫ σ e_i·A_s,

and their coupling to another source is b'·c, with the product of two projection errors.  R and L are positive: the
network is passive whatever is left out.  The basis is reduced first and diagonalised afterwards, R w = λ L w with
wᵀ L w = 1 (eigenmodes of the plate itself converge far more slowly).
M. Clemens, T. Weiland, IEEE Trans. Magn. 35 (1999) 1163 (discrete eddy-current operators).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from itertools import product

import numpy as np
import scipy

from ...geometry.common import Array, Watch
from ...geometry.scene.contents import Plate
from ...geometry.solids import Solids
from ..closed_forms.eddy_bodies import ComplexArray
from ..harmonics.solid import members
from .currents import STRICT, OtherSources, PlateSolution, grid_counts, probe_places, space_couplings, unit_power
from .eddy import Source
from .multipoles import Multipoles, fit_multipoles
from .table import ENOUGH, Region, refuse

NEGLIGIBLE = 1e-12  # Snapshot energies below this share of the largest are round-off
FREQUENCIES = 7  # Errors are looked at at so many, in equal ratios
# Share of the tolerance for finite elements and states left out; the rest, more of a strict one, is the functions'.
NETWORK_SHARE, STRICT_SHARE = 0.9, 0.8
FUNCTION_SHARE = 0.1  # Share of the tolerance for the field functions; what the other errors leave of it comes on top
CONDUCTOR = "this plate and this place of the floater"  # In words, of which tolerances are refused
# Highest degree of the multipoles, and for strict tolerances: in a region half as wide as it is far from the plate,
# degree 4 ends near 8e-5 of the field of the plate's currents, degree 5 near 2e-5.
DEGREE, STRICT_DEGREE = 4, 7
# Depths of their centres behind the surface, by the distance between region and plate: near and far ones.
DEPTHS = (0.0, 0.3, 0.6, 1.0, 1.6, 2.5, 4.0, 6.0, 10.0, 18.0)
SPACING = 2.5  # Lateral distance of the lines of centres, in the same unit


@dataclass(frozen=True, eq=False)
class PassiveNetwork:
    """Currents in a plate as states: dp_i/dt = -λ_i (p_i - s_i), with y_i = p_i - s_i the current of field e_i."""

    plate: Plate  # the conductor; fields and region are in its own frame
    region: Region  # where the floater may be
    frequencies: tuple[float, float]  # lowest and highest, Hz
    rates: Array  # (states,) λ_i, 1/s
    # s_i = ∫ σ e_i·A_s dV (sources, states), √J, of sources in the plate's frame
    couplings: Callable[[Sequence[Source]], Array]
    # for a tolerance the multipoles, their weights (states, k), 1/√J, and the error that they leave, perhaps more
    field_functions: "Callable[[PassiveNetwork, float, Watch], tuple[Multipoles, Array, float]]"
    mesh_error: float  # estimated relative errors of reaction tensors
    state_error: float
    provenance: Mapping[str, str | float]  # how it was made; texts and numbers
    seconds: float  # time spent on that


# The network of fewest states that meets a tolerance, by what its field functions are expected to miss.
Reduction = Callable[[float], PassiveNetwork]


@dataclass(frozen=True, eq=False)
class OrderedBasis:
    """Fields in the order of their importance, and their network."""

    energies: Array  # (n,) of the snapshots along each field, decreasing
    fields: Array  # (n, width) rows e_i
    resistance: Array  # (n, n)
    inductance: Array

    def leading(self, energy: float) -> "OrderedBasis":
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
        """(sources, sources) -iω b (R + iωL)⁻¹ bᵀ of sources with potentials `rows` (sources, width)."""
        b = rows @ self.fields.T
        impedance = self.resistance + 1j * angular_frequency * self.inductance
        return np.asarray(-1j * angular_frequency * b @ np.linalg.solve(impedance, b.T))


def ordered_basis(fields: Array, potentials: Array, reference: float) -> OrderedBasis:
    """Basis from snapshots of fields and potentials (n, width); energy and power count alike at `reference`, rad/s."""
    resistance, inductance = fields @ fields.T, potentials @ fields.T
    inductance = (inductance + inductance.T) / 2
    energies, vectors = np.linalg.eigh(resistance + reference * inductance)
    kept = np.flatnonzero(energies > NEGLIGIBLE * energies.max(initial=0.0))[::-1]
    mixed = vectors[:, kept] / np.sqrt(energies[kept])
    return OrderedBasis(energies[kept], mixed.T @ fields, mixed.T @ resistance @ mixed, mixed.T @ inductance @ mixed)


def fewest_states(
    basis: Sequence[OrderedBasis],
    probes: Sequence[tuple[int, Array]],
    truth: Mapping[float, ComplexArray],
    places: int,
    tolerance: float,
) -> tuple[list[OrderedBasis], float]:
    """The fewest leading fields of every `basis` whose worst error meets the tolerance, and that error.

    `probes`: numbers of bases with potentials (sources, width) of all probes in them, whose couplings add up; `truth`:
    (sources, sources) couplings of the probes by angular frequency, rad/s; `places`: of the probes: three dipoles at
    each come first, then other sources.
    """

    def worst(chosen: Sequence[OrderedBasis]) -> float:
        errors = []
        for omega, exact in truth.items():
            found = sum(chosen[number].couplings(rows, omega) for number, rows in probes)
            errors.append(coupling_error(np.asarray(found), exact, places))
        return max(errors)

    levels = np.sort(np.concatenate([part.energies for part in basis]))[::-1]
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        met = worst([part.leading(levels[middle]) for part in basis]) <= tolerance
        low, high = (low, middle) if met else (middle + 1, high)
    chosen = [part.leading(levels[low]) for part in basis]
    return chosen, worst(chosen)


def coupling_error(found: ComplexArray, truth: ComplexArray, places: int) -> float:
    """Largest relative error of couplings `found`, by `truth`: dipoles' own tensors and others' fields at `places`."""
    n, errors = places, [0.0]
    own, exact = (np.einsum("iaib->iab", c[: 3 * n, : 3 * n].reshape(n, 3, n, 3)) for c in (found, truth))
    fields = (c[3 * n :, : 3 * n] for c in (found - truth, truth))
    for missed, whole in (((own - exact).reshape(n, 9), exact.reshape(n, 9)), tuple(fields)):
        errors += (np.linalg.norm(missed, axis=1) / np.linalg.norm(whole, axis=1)).tolist()
    return max(errors)


def tensor_error(values: Array, error: Array, rates: Array, omega: float) -> float:
    """Error of tensors at `omega`, rad/s, by an `error` of `values` (states, n, 3) and the `rates`, 1/s."""
    weight = 1 / (rates + 1j * omega)
    exact, found = (np.einsum("ina,i,inb->nab", b, weight, b, optimize=True) for b in (values, values - error))
    return float(np.max(np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))))


def checked_ranges(frequencies: tuple[float, float], rtol: float) -> tuple[float, float]:
    """The frequencies (Hz), once they and the tolerance are found good. Raises ValueError: they are not."""
    low, high = frequencies
    if not 0 < low < high < np.inf:
        raise ValueError(f"Input frequencies_hz must be positive and increasing; instead received {frequencies}.")
    if not 0 < rtol < 1:
        raise ValueError(f"Input rtol must be between 0 and 1; instead received {rtol}.")
    return low, high


def from_elements(
    plate: Plate,
    solution: PlateSolution,
    region: Region,
    frequencies: tuple[float, float],
    rtol: float,
    others: OtherSources,
    space_error: float,
) -> Reduction:
    """Networks of `plate` for a `region` and `frequencies` (Hz) within those of a `solution`, and `others`: the rotor.

    `rtol`: of tensors (Frobenius norm) and the others' fields, of which `space_error` is what the states miss. Raises
    AccuracyError: (the reduction) all of the states do not suffice.
    """
    space, (low, high) = solution.space, frequencies
    # Classes of the plate's mirrors that do not mirror the region are mixed by every source: they share their states.
    common = [k for k, axis in enumerate(space.parity.mirrors) if axis in region.mirrors]
    by_signs: dict[tuple[int, ...], list[int]] = {}
    for number, signs in enumerate(space.parity.classes):
        by_signs.setdefault(tuple(signs[k] for k in common), []).append(number)
    groups = list(by_signs.values())

    def joined(parts: Sequence[Array]) -> list[Array]:
        return [np.concatenate([parts[number] for number in group], axis=1) for group in groups]

    probes = probe_places(region, plate.body.mirrors)
    grid = region.grid(grid_counts(region, plate.body), plate.body.mirrors)

    def both(places: Array, more: Sequence[Source]) -> list[Array]:
        pairs = zip(space.dipole_couplings(places), space.couplings(more), strict=True)
        return [np.concatenate(pair) for pair in pairs]

    driving, testing = both(grid, others.training), both(probes, others.probes)
    scale = unit_power(np.sum([np.sum(part**2, axis=1) for part in driving], axis=0), len(others.training))
    truth = partial(space_couplings, testing, space.inductances)
    omegas = [2 * np.pi * f for f in (low, low**0.25 * high**0.75, high)]
    # Snapshots count by the reaction at their frequency, to which errors are relative.
    sizes = [np.linalg.norm(np.diagonal(truth(1j * w))[: 3 * len(probes)]) / w for w in omegas]
    basis = []
    for group, b in zip(groups, joined(driving), strict=True):
        inductance = scipy.linalg.block_diag(*(space.inductances[number] for number in group))
        snapshots = []
        for omega, size in zip(omegas, sizes, strict=True):
            amplitudes = np.linalg.solve(np.eye(len(inductance)) + 1j * omega * inductance, b.T).T
            amplitudes = scale[:, None] / np.sqrt(size) * amplitudes
            snapshots += [amplitudes.real, amplitudes.imag]
        # The many snapshots have the Gram matrix of their triangle, which is small.
        fields = np.asarray(np.linalg.qr(np.concatenate(snapshots), mode="r"))
        basis.append(ordered_basis(fields, fields @ inductance, float(np.sqrt(omegas[0] * omegas[-1]))))
    truths = {w: truth(1j * w) for w in (2 * np.pi * np.geomspace(low, high, FREQUENCIES)).tolist()}

    def reduced(functions_error: float) -> PassiveNetwork:
        share = NETWORK_SHARE if rtol >= STRICT else STRICT_SHARE
        known = solution.mesh_error + space_error
        allowed = min(share * rtol, rtol - functions_error) - known
        chosen, state_error = fewest_states(basis, list(enumerate(joined(testing))), truths, len(probes), allowed)
        if state_error > allowed:
            refuse(rtol, ENOUGH * max(state_error + functions_error + known, rtol), CONDUCTOR)
        rates, fields = zip(*[part.diagonalised() for part in chosen], strict=True)

        def of_states(parts: Sequence[Array]) -> Array:
            shares = zip(joined(parts), fields, strict=True)
            return np.concatenate([part @ states.T for part, states in shares], axis=1)

        functions = partial(_functions, lambda places: of_states(space.dipole_couplings(places)))
        return PassiveNetwork(
            plate, region, frequencies, np.concatenate(rates), lambda sources: of_states(space.couplings(sources)),
            functions, solution.mesh_error, state_error + space_error,
            {"ngsolve": version("ngsolve"), "order": float(space.order), "cells": float(space.cells)}, solution.seconds,
        )  # fmt: skip

    return reduced


def _functions(
    signals: Callable[[Array], Array], network: PassiveNetwork, rtol: float, watch: Watch
) -> tuple[Multipoles, Array, float]:
    """`PassiveNetwork.field_functions` from fields on the region's surface, by the `signals` of unit dipoles."""
    region, rates = network.region, network.rates
    extent = region.upper - region.lower
    x, y, z = np.clip(np.ceil(13 * np.sqrt(extent / extent.max())), 6, 13).astype(int)  # more along the longer edges
    points = region.surface((int(x), int(y), int(z)))
    values = signals(points).T.reshape(len(rates), -1, 3)
    low, high = (2 * np.pi * f for f in network.frequencies)
    middle = np.sqrt(low * high)
    state_scale = 1 / np.sqrt(rates + middle)
    point_scale = 1 / np.sqrt(np.sum((values * state_scale[:, None, None]) ** 2, axis=(0, 2)))

    def worst(error: Array) -> float:
        return max(tensor_error(values, error, rates, omega) for omega in (low, middle, high))

    choice = candidates(region, network.plate.body, DEGREE if rtol >= STRICT else STRICT_DEGREE)
    enough = lambda error: worst(error) <= FUNCTION_SHARE * rtol  # noqa: E731
    fit = fit_multipoles(choice, points, values, state_scale, point_scale, rtol, enough, watch=watch)
    return fit.multipoles, fit.weights, worst(fit.error)


def candidates(region: Region, body: Solids, degree: int = DEGREE) -> Multipoles:
    """Multipoles up to a `degree` behind each surface of `body` for a `region`. Raises ValueError: it touches."""
    centers = []
    for center, half in body.blocks:
        of_region, of_plate = region.moved(-center).nearest(half)
        gap = float(np.linalg.norm(of_plate - of_region))
        if gap < 1e-9:
            raise ValueError(
                f"Input region must be apart from the plate; instead received {region.lower.tolist()} to "
                f"{region.upper.tolist()} m for half edges {half.tolist()} m."
            )
        away, lines = (of_plate - of_region) / gap, []
        axis = int(np.argmax(np.abs(away)))
        for a in range(3):
            reach = max((region.upper - region.lower)[a] / 2 - gap, 0.0)
            count = 2 * int(np.ceil(reach / (SPACING * gap))) + 1
            middle = (region.center - center)[a]
            lines.append(of_plate[[a]] if a == axis else middle + reach * np.linspace(-1, 1, count) * (count > 1))
        starts = np.array(list(product(*lines))) + center
        centers += [starts + depth * gap * away for depth in DEPTHS]
    return Multipoles.at(np.concatenate(centers), members(degree), region.gap(body))
