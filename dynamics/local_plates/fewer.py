"""Fewer states for a plate's currents: those that a floater in a ball tells apart.

There the fields of all currents are sums of few harmonics, b_i = Σ_k W_ik ∇̃Υ_k, so that many currents are felt as one.
By Galerkin's method, with currents y = V z, VᵀV = 1,

    dy/dt + Λ y = -W dh/dt    becomes    dz/dt + VᵀΛV z = -VᵀW dh/dt,

which is a plate's equation again once VᵀΛV is made diagonal: passive, with an energy of its own, and silent towards a
floater at rest.  V are the largest principal directions of the currents iω/(λ + iω) W at frequencies of the table,
taken within each symmetry, as many as reaction tensors and their gradients in the ball ask for at these frequencies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from .functions import LocalHarmonics
from .reactions import Reactions

FREQUENCIES = 5
"""At which reactions are compared, in equal ratios."""


@dataclass(frozen=True, eq=False)
class FewerStates:
    """States for a ball, those of a symmetry together.

    Parameters
    ----------
    directions : (all, n) V
    rates : (n,) 1/s
    weights : (n, count) of their fields
    pattern : (n, count) where these are not zero by symmetry
    """

    directions: Array
    rates: Array
    weights: Array
    pattern: NDArray[np.bool_]


def fewer_states(
    known: LocalHarmonics,
    weights: Array,
    present: NDArray[np.bool_],
    rates: Array,
    frequencies: tuple[float, float],
    allowed: float,
) -> FewerStates:
    """The fewest states that err by no more than `allowed`, relative.

    Parameters
    ----------
    known : the harmonics
    weights : (all, count) of the states' fields in the ball
    present : (all, count) which of them are not zero by symmetry
    rates : (all,) 1/s
    frequencies : lowest and highest, Hz
    """
    weights = np.where(present, weights, 0.0)
    exact = Reactions(known, weights, rates, 2 * np.pi * np.geomspace(*frequencies, FREQUENCIES))
    classes = [_Class.of(exact, np.flatnonzero((present == row).all(axis=1))) for row in np.unique(present, axis=0)]
    sizes = np.sort(np.concatenate([each.sizes for each in classes]))

    def reduced(left_out: int) -> tuple[Array, Array]:
        parts = [each.largest(sizes[left_out]) for each in classes]
        return np.concatenate([v for v, _ in parts], axis=1), np.concatenate([rate for _, rate in parts])

    def misses(left_out: int) -> float:
        directions, found = reduced(left_out)
        return exact.deviation(directions.T @ weights, found)

    directions, found = reduced(_most(len(sizes) - 1, lambda left_out: misses(left_out) <= allowed))
    pattern = np.array([present[np.argmax(np.abs(direction))] for direction in directions.T])
    return FewerStates(directions, found, np.where(pattern, directions.T @ weights, 0.0), pattern)


@dataclass(frozen=True, eq=False)
class _Class:
    """States of one symmetry (rows of all), and the principal directions of their currents, the largest first."""

    rows: NDArray[np.intp]
    rates: Array
    sizes: Array
    principal: Array

    @classmethod
    def of(cls, exact: Reactions, rows: NDArray[np.intp]) -> _Class:
        principal, sizes, _ = np.linalg.svd(exact.currents()[rows], full_matrices=False)
        return cls(rows, exact.rates, sizes, principal)

    def largest(self, least: float) -> tuple[Array, Array]:
        """Directions (all, n) and rates (n,) of those not smaller than `least`."""
        kept = self.principal[:, : int(np.sum(self.sizes >= least))]
        found, turn = np.linalg.eigh(kept.T @ (self.rates[self.rows, None] * kept))
        directions = np.zeros((len(self.rates), len(found)))
        directions[self.rows] = kept @ turn
        return directions, found


def _most(highest: int, good: Callable[[int], bool]) -> int:
    """The largest number up to `highest` that is good, if none is good above one that is not; 0 is."""
    low, high = 0, highest + 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return low
