"""Time averages of a harmonic dipole in the field that it causes: torque, force and loss.

Phasors are e^{+iωt}: the moment at time t is Re(m e^{iωt}), and m = (1, -i, 0) turns about +z.  With the
reaction B = G m and its gradient ∂_l B_i = T_lij m_j at the dipole

    torque ½ Re(conj(m) × G m)     force ½ Re(conj(m_i) T_lij m_j)     loss -½ ω Im(conj(m) · G m)

The loss is the power that the source of m hands to the conductor, the mean of m · dB/dt.
J. D. Jackson, Classical Electrodynamics (3rd ed. 1999), sections 5.16 and 6.9.
"""

import numpy as np
from numpy.typing import ArrayLike

from spinlev.geometry.common import Array


def mean_torque(reaction: ArrayLike, moment: ArrayLike) -> Array:
    """Time-averaged torque (..., 3), N m, on `moment` (..., 3) A m² from the reaction tensor (..., 3, 3) T/(A m²)."""
    moment = np.asarray(moment, complex)
    field = np.einsum("...ij,...j->...i", np.asarray(reaction), moment)
    return np.asarray(np.cross(moment.conj(), field).real / 2)


def mean_force(gradient: ArrayLike, moment: ArrayLike) -> Array:
    """Time-averaged force (..., 3), N, from T_lij (..., 3, 3, 3), T/(A m³), ∂_l B_i = T_lij m_j, A m²."""
    moment = np.asarray(moment, complex)
    return np.asarray(np.einsum("...i,...lij,...j->...l", moment.conj(), np.asarray(gradient), moment).real / 2)


def mean_loss(reaction: ArrayLike, moment: ArrayLike, frequency: ArrayLike) -> Array:
    """Time-averaged Joule loss (...,), W, of the conductor at `frequency` (Hz)."""
    moment = np.asarray(moment, complex)
    work = np.einsum("...i,...ij,...j->...", moment.conj(), np.asarray(reaction), moment)
    return np.asarray(-np.pi * np.asarray(frequency) * work.imag)
