"""What a floater feels of the currents that it makes in a plate: reaction tensors and their gradients in a ball."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...fem.closed_forms import ComplexArray
from ...geometry.basics import Array
from .functions import LocalHarmonics

EVERY = 3
"""Of the points of `sphere_fit` so many are left out but one."""


@dataclass(frozen=True, eq=False)
class Reactions:
    """Those of some currents, and how far those of others are from them.

    Parameters
    ----------
    known : the harmonics of the fields
    weights : (states, count) of the fields in the ball
    rates : (states,) at which the currents decay, 1/s
    omegas : (n,) angular frequencies at which they are compared, rad/s
    """

    known: LocalHarmonics
    weights: Array
    rates: Array
    omegas: Array

    def deviation(self, weights: Array, rates: Array) -> float:
        """Largest difference of the tensors or their gradients, over the largest of all at its frequency."""
        parts = zip(self._tensors(weights, rates), self._own, strict=True)
        return max(float((np.abs(a - b).max(axis=1) / np.abs(b).max(axis=1)).max()) for a, b in parts)

    def currents(self) -> Array:
        """(states, …) by each harmonic at its largest, in and out of phase, at all frequencies, weighted alike."""
        driven = self._response(self.rates)[:, :, None] * (self.weights * self._largest(np.eye(self.known.count)))
        driven /= np.sqrt(self._scales)[:, None, None]
        return np.concatenate([*driven.real, *driven.imag], axis=1)

    def _largest(self, weights: Array) -> Array:
        """(n,) largest norms of the fields of some weights."""
        return np.asarray(np.linalg.norm(self.known.values(weights)[0], axis=2).max(axis=1))

    def _response(self, rates: Array) -> ComplexArray:
        """(omegas, n) iω/(λ + iω)."""
        turning = 1j * self.omegas[:, None]
        return np.asarray(turning / (rates + turning))

    @cached_property
    def _own(self) -> tuple[ComplexArray, ComplexArray]:
        return self._tensors(self.weights, self.rates)

    @cached_property
    def _scales(self) -> Array:
        """(omegas,) largest entries of the tensors."""
        return np.asarray(np.abs(self._own[0]).max(axis=1))

    def _tensors(self, weights: Array, rates: Array) -> tuple[ComplexArray, ComplexArray]:
        """Σ iω/(λ + iω) b b' and Σ iω/(λ + iω) ∇b b' (omegas, …) at points on the surface, where they are largest."""
        near, bent = (part[:, ::EVERY] for part in self.known.values(weights))
        response = self._response(rates)
        pairs = [np.einsum("inc,inb->incb", part, near).reshape(len(rates), -1) for part in (near, bent)]
        first, second = (response.real @ pair + 1j * (response.imag @ pair) for pair in pairs)
        return first, second
