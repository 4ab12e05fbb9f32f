"""Currents of one parity class, from solutions at one real shift that follow what is still missing.

Without its gradients a source A_s drives the field e with (1 + iωT) e = A_s, where T takes a current to its potential
and is symmetric and positive in the product ∫ σ e·e' dV.  For a real shift s and any row r, e = (1 + sT)⁻¹ r is one
real solve, X = (curl curl/μ0 + sσ)⁻¹ σ r, with

    e = r - s X    and    T e = X,

so that the potential of every field in the basis is known.  A Galerkin solution in the span of such fields thus has
a residual ρ = A_s - (1 + iωT) e that is known as a row, at every frequency, and its error is bounded by it: (1 + iωT)⁻¹
shrinks every row, so |e - e_n| ≤ |ρ|, and a coupling misses at most ω |ρ| |ρ'|.  The largest residuals over sources and
frequencies are what the next solves start from (a rational Krylov method with a real pole: A. Ruhe, Linear Algebra
Appl. 58 (1984) 391; L. Knizhnerman, V. Druskin, M. Zaslavsky, SIAM J. Numer. Anal. 47 (2009) 953).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ..closed_forms import ComplexArray

Solve = Callable[[Array], tuple[Array, Array]]
"""Fields e and their potentials T e for rows r."""
MODE_SHARE, NEXT_SHARE = 0.2, 0.3
"""Shares of what residuals may be: for sources left out of the modes, and for residuals that no solve starts from."""
DEPENDENT = 1e-9
"""Squared part of a field that the others must leave for it to be taken."""
MOST_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class ClassBasis:
    """Fields e (n, width), orthonormal rows, their potentials T e, and the matrix ∫ σ e·T e'."""

    fields: Array
    potentials: Array
    inductance: Array

    @classmethod
    def empty(cls, width: int) -> ClassBasis:
        """No fields."""
        return cls(np.zeros((0, width)), np.zeros((0, width)), np.zeros((0, 0)))

    def extended(self, fields: Array, potentials: Array) -> ClassBasis:
        """The basis and what is new in more fields."""
        for _ in range(2):
            known = fields @ self.fields.T
            fields, potentials = fields - known @ self.fields, potentials - known @ self.potentials
            energies, vectors = np.linalg.eigh(fields @ fields.T)
            kept = energies > DEPENDENT * energies.max(initial=0.0)
            turn = (vectors[:, kept] / np.sqrt(energies[kept])).T
            fields, potentials = turn @ fields, turn @ potentials
        fields, potentials = np.concatenate([self.fields, fields]), np.concatenate([self.potentials, potentials])
        inductance = potentials @ fields.T
        return ClassBasis(fields, potentials, (inductance + inductance.T) / 2)

    def response(self, couplings: Array, angular_frequency: float) -> ComplexArray:
        """Amplitudes (sources, n) of the fields that sources with `couplings` (sources, n) drive."""
        matrix = np.eye(len(self.fields)) + 1j * angular_frequency * self.inductance
        return np.asarray(np.linalg.solve(matrix, couplings.T.astype(complex)).T)


@dataclass(frozen=True, eq=False)
class Residuals:
    """What a basis leaves of sources (m, width), by products of all rows involved.

    Parameters
    ----------
    rows : the sources' above the fields' above the potentials'
    products : of all of them with each other
    couplings : (m, n) of the sources
    basis : the fields
    """

    rows: Array
    products: Array
    couplings: Array
    basis: ClassBasis

    @classmethod
    def of(cls, sources: Array, basis: ClassBasis) -> Residuals:
        """The residuals of gradient-free sources (m, width)."""
        rows = np.concatenate([sources, basis.fields, basis.potentials])
        products = rows @ rows.T
        m, n = len(sources), len(basis.fields)
        return cls(rows, products, products[:m, m : m + n], basis)

    def combinations(self, angular_frequency: float) -> ComplexArray:
        """(m, rows) factors that make the residuals out of the rows."""
        amplitudes = self.basis.response(self.couplings, angular_frequency)
        return np.concatenate([np.eye(len(amplitudes)), -amplitudes, -1j * angular_frequency * amplitudes], axis=1)

    def gram(self, angular_frequency: float) -> ComplexArray:
        """(m, m) products of the residuals."""
        factors = self.combinations(angular_frequency)
        return np.asarray(factors @ self.products @ factors.conj().T)

    def driven(self, angular_frequency: float) -> Array:
        """Re ∫ σ A_s·e dV of every source: what its coupling with itself is made of."""
        return np.asarray(np.sum(self.couplings * self.basis.response(self.couplings, angular_frequency).real, axis=1))

    def largest(self, angular_frequencies: Iterable[float], scales: Array, allowed: float) -> Array:
        """Rows (k, width): principal components of all residuals times `scales` (frequencies, m), but for a tail."""
        parts = [s[:, None] * self.combinations(w) for w, s in zip(angular_frequencies, scales, strict=True)]
        factors = np.concatenate([half for part in parts for half in (part.real, part.imag)])
        energies, vectors = np.linalg.eigh(factors @ self.products @ factors.T)
        kept = (np.cumsum(np.maximum(energies, 0.0)) > allowed) & (energies > DEPENDENT**1.5 * energies[-1])
        return np.asarray((vectors[:, kept] / np.sqrt(energies[kept])).T @ factors @ self.rows)


def class_basis(sources: Array, solve: Solve, angular_frequencies: Array, allowed: float) -> ClassBasis:
    """A basis in which no source's residual is larger than `allowed`, relative to what the source drives.

    Parameters
    ----------
    sources : (m, width) without gradients, of about unit power each
    solve : at the shift
    """
    energies, vectors = np.linalg.eigh(sources @ sources.T)
    kept = np.cumsum(np.maximum(energies, 0.0)) > MODE_SHARE * allowed
    modes = (vectors[:, kept] / np.sqrt(energies[kept])).T @ sources
    strengths, mixture = np.sqrt(energies[kept]), sources @ modes.T
    basis = ClassBasis.empty(sources.shape[1])
    starts = modes
    for _ in range(MOST_ROUNDS):
        if not len(starts):
            break
        basis = basis.extended(*solve(starts))
        left = Residuals.of(modes, basis)
        shares = np.array([left.driven(w) @ strengths**2 for w in angular_frequencies]) / np.sum(strengths**2)
        grams = [left.gram(w).real / share for w, share in zip(angular_frequencies, shares, strict=True)]
        if max(float(np.max(np.sum(mixture @ gram * mixture, axis=1))) for gram in grams) <= allowed:
            break
        starts = left.largest(angular_frequencies, strengths / np.sqrt(shares)[:, None], NEXT_SHARE * allowed)
    return basis
