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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ...geometry.basics import Array
from ..closed_forms import ComplexArray

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
