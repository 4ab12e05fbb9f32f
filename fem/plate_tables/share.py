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

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array, frozen_array
from ..closed_forms import ComplexArray


@dataclass(frozen=True, eq=False)
class RotorShare:
    """Fourier amplitudes of the rotor's signals along the way of a plate.

    Parameters
    ----------
    distance : how far the plate goes down, m
    series : (2H+1, states, k) Chebyshev coefficients over 0…distance, √J: constant, cos φ, sin φ, cos 2φ, …
    error : estimated largest error of a signal, relative to the largest signal; in it, of harmonics that were left out
        because the floater does not feel them (`shorter_share`), what they miss of the field of the rotor's currents
    """

    distance: float
    series: Array
    error: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "series", frozen_array(self.series, self.series.shape))

    def signals(self, angle: ArrayLike, depth: float) -> Array:
        """s_i (..., states), √J, at angles (...) of the rotor (rad) and a depth of the plate (m)."""
        factors = np.polynomial.chebyshev.chebvander(np.array([self._place(depth)]), self.series.shape[2] - 1)[0]
        return np.asarray(turn_harmonics(angle, len(self.series)) @ (self.series @ factors))

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


def turn_harmonics(angle: ArrayLike, count: int) -> Array:
    """(..., count) 1, cos φ, sin φ, cos 2φ, … of angles (...), rad."""
    h = np.multiply.outer(angle, np.arange(1, count // 2 + 1))
    turns = np.stack([np.cos(h), np.sin(h)], axis=-1).reshape(*h.shape[:-1], count - 1)
    return np.concatenate([np.ones((*h.shape[:-1], 1)), turns], axis=-1)
