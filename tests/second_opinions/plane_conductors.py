"""Of an infinite plane conductor: the limit of a thin sheet, and the gradient of a dipole's own reaction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from spinlev.fem.closed_forms.eddy_bodies import ComplexArray
from spinlev.fem.plate.slab import Slab, wave_numbers
from spinlev.geometry.common import MU_0


@dataclass(frozen=True)
class ThinSheet:
    """A sheet whose thickness is small against everything else, of given `conductance` σt (S)."""

    conductance: float

    def __post_init__(self) -> None:
        if not self.conductance > 0:
            raise ValueError(f"Input conductance_S must be positive; instead received {self.conductance!r}.")

    def reflection(self, wave_number: ArrayLike, frequency: ArrayLike) -> ComplexArray:
        """Γ = iωμ0σt / (2k + iωμ0σt) at wave numbers (1/m) and frequencies (Hz)."""
        rate = 2j * np.pi * MU_0 * self.conductance * np.asarray(frequency, float)
        return np.asarray(rate / (2 * np.asarray(wave_number, float) + rate))


PlaneConductor = Slab | ThinSheet


def reaction_gradient(slab: Slab, height: ArrayLike, frequency: ArrayLike) -> ComplexArray:
    """T (..., 3, 3, 3), T/(A m³): ∂_l B_i = T_lij m_j of the reaction field at the dipole that causes it.

    It is symmetric and without trace in its first two indices.  Accuracy and errors as `reaction_tensor`.
    """
    h, f = np.broadcast_arrays(np.asarray(height, float), np.asarray(frequency, float))
    k, weight = wave_numbers(h)
    integral = np.sum(weight * k**3 * np.exp(-2 * k * h[..., None]) * slab.reflection(k, f[..., None]), axis=-1)
    pattern = np.zeros((3, 3, 3))
    pattern[2, 2, 2] = 1.0
    for a in (0, 1):
        pattern[2, a, a] = pattern[a, 2, a] = 0.5
        pattern[a, a, 2] = -0.5
    return MU_0 / (4 * np.pi) * integral[..., None, None, None] * pattern
