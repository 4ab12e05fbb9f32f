"""The rotor's share of a plate's states: what its turning field adds to the signals s_i.

The rotor turns by the angle φ = ωt about the laboratory's z axis while the plate stands d below its first place:

    s_i(φ, d) = Σ_h [C_hi(d) cos hφ + S_hi(d) sin hφ],

with amplitudes that are Chebyshev series in d.  The rotor is its field table, so that all moments are there, and what
recoil permeability and mutual demagnetisation add.  Both sums are interpolations at equidistant angles and at Chebyshev
points: they converge geometrically.

Energy.  With the floater's share, s_i = b_i·m + r_i(φ, d), the energy ½ Σ y_i² of the currents changes by
Σ y_i dp_i/dt - Σ y_i ds_i/dt: the first is minus the loss Σ λ_i y_i², the second is minus the work of the currents on
whatever makes s_i change.  On the floater they do Σ y_i d(b_i·m)/dt, on the rotor Σ y_i ∂r_i/∂φ per radian, a torque
that the motor must balance, and Σ y_i ∂r_i/∂d per metre of lowering.  Magnetisation is constant, hence no other work.
The static interaction of rotor and floater is not in these sums.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import heyoka as hy
import numpy as np

from ...geometry.basics import Array, frozen_array
from ...geometry.scenes import Plate
from ..closed_forms import ComplexArray
from ..eddy_currents import Source
from ..rotor_tables import AccuracyError, RotorTable
from .rotor_source import posed_rotor, rotor_parts

MOST_TERMS = 15
"""Highest number of harmonics, and of points along the way."""
NOISE = 1e-10
"""Amplitudes below this share of the largest signal are what symmetry forbids."""


class Network(Protocol):
    """Currents as states that listen to sources."""

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """s_i, √J, of sources in the plate's frame: (sources, states) for each group of states."""


@dataclass(frozen=True, eq=False)
class RotorShare:
    """Fourier amplitudes of the rotor's signals along the way of a plate.

    Parameters
    ----------
    distance : how far the plate goes down, m
    series : (2H+1, states, k) Chebyshev coefficients over 0…distance, √J: constant, cos φ, sin φ, cos 2φ, …
    error : estimated largest error of a signal, relative to the largest signal; in it, of harmonics that were left out
        because the floater does not feel them (`share_trim`), what they miss of the field of the rotor's currents
    """

    distance: float
    series: Array
    error: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "series", frozen_array(self.series, self.series.shape))

    def signals(self, angle: float, depth: float) -> Array:
        """s_i (states,), √J, at a rotor's angle (rad) and a depth of the plate (m)."""
        factors = np.polynomial.chebyshev.chebvander(np.array([self._place(depth)]), self.series.shape[2] - 1)[0]
        return np.asarray(_harmonics(angle, len(self.series)) @ (self.series @ factors))

    def filtered(self, factors: ComplexArray) -> RotorShare:
        """What a linear system makes of the share, with the response (H+1, states) to cos hφ → Re(… e^{ihφ})."""
        turns = (self.series[1::2] - 1j * self.series[2::2]) * factors[1:, :, None]
        series = np.empty_like(self.series)
        series[0] = self.series[0] * factors[0].real[:, None]
        series[1::2], series[2::2] = turns.real, -turns.imag
        return replace(self, series=series)

    def _place(self, depth: float) -> float:
        return 2 * depth / self.distance - 1 if self.distance else 0.0

    def basis(self, angle: hy.expression, depth: hy.expression) -> list[list[hy.expression]]:
        """Harmonics of the angle (rad) times Chebyshev polynomials of the depth (m), as `series` has them."""
        place = depth * (2 / self.distance) - 1.0 if self.distance else hy.expression(0.0)
        powers = [hy.expression(1.0), place]
        while len(powers) < self.series.shape[2]:
            powers.append(2.0 * place * powers[-1] - powers[-2])
        turns = [hy.expression(1.0)]
        for h in range(1, len(self.series) // 2 + 1):
            turns += [hy.cos(float(h) * angle), hy.sin(float(h) * angle)]
        return [[turn * power for power in powers[: self.series.shape[2]]] for turn in turns]

    def expressions(self, basis: Sequence[Sequence[hy.expression]]) -> list[hy.expression]:
        """s_i of every state as heyoka expressions of the `basis`, whose members all of them share."""
        members = [member for row in basis for member in row]
        columns = self.series.swapaxes(0, 1).reshape(self.series.shape[1], len(members))
        return [hy.sum([float(c) * m for c, m in zip(row, members, strict=True) if c]) for row in columns]


def rotor_share(
    network: Network, plate: Plate, rotor: RotorTable, tolerance: float = 1e-4, most: int = MOST_TERMS
) -> RotorShare:
    """Signals of a rotor for the pose and the way of `plate`.

    Parameters
    ----------
    network : of a plate of the same size and conductivity, or of what stands for it
    tolerance : for the estimated error; harmonics and depths are added until it is met
    most : highest number of either

    Raises
    ------
    AccuracyError : the tolerance is not met with the most terms
    """
    parts = rotor_parts(rotor, plate)
    distance = plate.lowering.distance if plate.lowering else 0.0
    harmonics, depths = 5, 4 if distance else 1
    while True:
        series, samples = _sampled(network, plate, parts, distance, harmonics, depths)
        size = np.abs(samples).max()
        turns = float(np.abs(series[-4:]).max() / size)  # of two harmonics: symmetry may forbid one
        ways = float(np.abs(series[..., -1]).max() / size) if distance else 0.0
        if max(turns, ways) <= tolerance / 2:
            return _trimmed(distance, series, turns + ways, tolerance / 2, float(size))
        if max(harmonics, depths) >= most:
            raise AccuracyError(
                f"Input tolerance must be at least {turns + ways:.1e} for this rotor and this way; instead received "
                f"{tolerance:.1e}."
            )
        harmonics += 2 * (turns > tolerance / 2)
        depths += 2 * (ways > tolerance / 2)


def _trimmed(distance: float, series: Array, error: float, tolerance: float, size: float) -> RotorShare:
    """The share without its highest harmonics, whose sum no signal misses by more than the tolerance."""
    tails = np.cumsum(np.abs(series).sum(axis=2).max(axis=1)[::-1])[::-1] / size
    kept = max(3, int(np.argmax(np.append(tails, 0.0) <= tolerance)) | 1)
    part = series[:kept]
    small = np.abs(part) < NOISE * size
    return RotorShare(distance, np.where(small, 0.0, part), error + float(np.append(tails, [0.0, 0.0])[kept]))


def _sampled(
    network: Network, plate: Plate, parts: Sequence[Source], distance: float, harmonics: int, depths: int
) -> tuple[Array, Array]:
    """Series (2H+1, states, depths) through samples (depths, 2H+1, states) at equidistant angles, Chebyshev depths."""
    turns = 2 * harmonics + 1
    nodes = np.cos(np.pi * (np.arange(depths) + 0.5) / depths)
    angles = 2 * np.pi * np.arange(turns) / turns
    ways = distance * (1 + nodes) / 2
    sources = [posed_rotor(parts, plate, angle, depth) for depth in ways for angle in angles]
    samples = np.concatenate(network.couplings(sources), axis=1).reshape(depths, turns, -1)
    fourier = np.linalg.inv(np.array([_harmonics(angle, turns) for angle in angles]))
    chebyshev = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, depths - 1))
    return np.einsum("ha,kn,nas->hsk", fourier, chebyshev, samples, optimize=True), samples


def _harmonics(angle: float, count: int) -> Array:
    h = np.arange(1, count // 2 + 1) * angle
    return np.concatenate([[1.0], np.stack([np.cos(h), np.sin(h)], axis=1).ravel()])
