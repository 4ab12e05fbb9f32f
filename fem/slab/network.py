"""The currents of an infinite slab as few states: its exact modes, on waves of a cylinder, reduced.

Every wave number k and order m has the horizontal shapes J_m(kρ) cos mφ and J_m(kρ) sin mφ.  As

    ∫ J_m(kρ) J_m(k'ρ) ρ dρ = δ(k - k')/k,

a quadrature ∫ dk → Σ w_k makes each a state with the signal γ √(k w_k / a_m) times what a source gives to the wave;
a_m = π, or 2π for m = 0.  The trapezoidal rule in ln k converges geometrically, see `reaction`; N modes of the slab
leave an error as 1/N³.  This full network is exact but for these two sums.  It is reduced order by
order: snapshots of both shapes together, since a turn makes one the other, so that their states are alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.basics import Array
from ..closed_forms import ComplexArray
from ..eddy_currents import Source
from ..plate_network import OrderedBasis, ordered_basis
from .frame import SlabFrame
from .modes import SlabModes, modes_needed, slab_modes
from .waves import cylinder_moments

NEGLIGIBLE_MODE = 1e-5
"""Squared part of the training sources, in units of the tolerance, below which a combination of them is left out."""


@dataclass(frozen=True, eq=False)
class SlabWaves:
    """The full network.

    Parameters
    ----------
    frame : of the cylinder
    modes : of the slab at each of n wave numbers
    weights : (n, orders) √(k w_k / a_m), 1/m
    directions : of waves that make up those of the cylinder
    """

    frame: SlabFrame
    modes: SlabModes
    weights: Array
    directions: int

    def amplitudes(self, sources: Sequence[Source]) -> ComplexArray:
        """Signals but for γ (sources, n, orders): real for the shapes with cos mφ, imaginary for sin mφ."""
        count = self.weights.shape[1]
        origin, axes, k = self.frame.origin, self.frame.axes, self.modes.wave_numbers
        return np.asarray(-self.weights * cylinder_moments(sources, origin, axes, k, count, self.directions))

    def couplings(self, amplitudes: ComplexArray, frequency: float) -> ComplexArray:
        """(sources, sources) -iω Σ s s' / (λ + iω)."""
        rate = 2j * np.pi * frequency
        response = -rate * np.sum(self.modes.strengths**2 / (self.modes.rates + rate), axis=1)[:, None]
        shape = (len(amplitudes), -1)
        parts = [
            (response * part).reshape(shape) @ part.reshape(shape).T for part in (amplitudes.real, amplitudes.imag)
        ]
        return np.asarray(sum(parts))

    def power(self, amplitudes: ComplexArray) -> Array:
        """(sources,) Σ s² / λ: their squared potential in the slab."""
        return np.asarray(np.einsum("skm,k->s", np.abs(amplitudes) ** 2, self._squares))

    @property
    def _squares(self) -> Array:
        return np.asarray(np.sum(self.modes.strengths**2 / self.modes.rates, axis=1))

    def basis(
        self, amplitudes: ComplexArray, scale: Array, frequencies: Sequence[float], counts: Sequence[float], rtol: float
    ) -> list[OrderedBasis]:
        """For every order the basis from the answers to sources, its `fields` summed over the slab's modes.

        Parameters
        ----------
        scale : (sources,) how much each counts
        frequencies, counts : Hz, and how much the answers at each count
        """
        weight = np.sqrt(self._squares)
        found, largest = [], 0.0
        for m in range(amplitudes.shape[2]):
            scaled = amplitudes[:, :, m] * scale[:, None] * weight
            _, sizes, shapes = np.linalg.svd(np.concatenate([scaled.real, scaled.imag]), full_matrices=False)
            largest = max(largest, float(sizes[0]))
            kept = sizes**2 > NEGLIGIBLE_MODE * rtol * largest**2
            found.append(self._order(sizes[kept, None] * shapes[kept] / weight, frequencies, counts))
        return found

    def _order(self, rows: Array, frequencies: Sequence[float], counts: Sequence[float]) -> OrderedBasis:
        rates = self.modes.rates.ravel()
        to_modes = self.modes.strengths / np.sqrt(self.modes.rates)
        sources = (rows[:, :, None] * to_modes).reshape(len(rows), len(rates))
        omegas = 2 * np.pi * np.asarray(frequencies)
        reactions = [-1j * omega / (rates + 1j * omega) * sources for omega in omegas]
        full = ordered_basis(sources, reactions, omegas.tolist(), [np.full(len(rows), count) for count in counts])
        fields = full.fields.reshape(len(full.fields), *self.modes.rates.shape)
        return replace(full, fields=np.einsum("skn,kn->sk", fields, to_modes))


def slab_waves(frame: SlabFrame, near: Array, far: Array, frequency: float, tolerance: float) -> SlabWaves:
    """The full network for a relative accuracy and frequencies up to one (Hz).

    Parameters
    ----------
    near : (n, 3) m, corners of the floater's region, in the cylinder's frame
    far : (n, 3) m, corners of the rotor in all its places
    """
    radius, low = np.hypot(near[:, 0], near[:, 1]).max(), near[:, 2].min()
    every = np.concatenate([[[radius, 0.0, low]], far])
    lateral, height = np.hypot(every[:, 0], every[:, 1]), every[:, 2]
    digits = -np.log(tolerance)
    aperture = min(np.pi / 4, 0.8 * float(np.min(np.arctan2(low + height, radius + lateral))))
    bounds = np.log([np.sqrt(tolerance) / max(near[:, 2].max(), height.max()), (digits + 4 * np.log(digits)) / 2 / low])
    count = int(np.ceil((bounds[1] - bounds[0]) * digits / (2 * np.pi * aperture))) + 1
    nodes, step = np.linspace(float(bounds[0]), float(bounds[1]), count, retstep=True)
    k = np.exp(nodes)
    # J_m(kρ) e^{-kz} falls with the order as the power of this
    falls = np.log((height + np.hypot(height, lateral)) / np.maximum(lateral, 1e-9 * low))
    orders = int(np.ceil(digits / float(np.min(falls + falls[0])))) + 3
    directions = orders + int(np.ceil(digits / falls.min())) + 8
    modes = slab_modes(frame.slab, k, modes_needed(frame.slab, digits / (4 * low), frequency, tolerance))
    angular = np.where(np.arange(orders) == 0, 2 * np.pi, np.pi)
    return SlabWaves(frame, modes, k[:, None] * np.sqrt(step / angular), directions)
