"""A steady dipole that moves over an infinite slab: drag and lift.

In the frame of the slab a Fourier part k of the field of a dipole with velocity v has the frequency -k·v, so that
with q = (i k_x, i k_y, -k) and the reflection Γ(k, ω) of `reaction`

    F = -(μ0/8π²) ∫ d²k/k  q |m·q|² e^{-2kh} Γ(k, -k·v).

For slow motion in any direction F = -C v with the constant drag tensor C.
J. R. Reitz, J. Appl. Phys. 41 (1970) 2067, eqs. 20-25; the tensor is derived here from Γ ≈ iωμ0σ(1 - e^{-2kt})/4k².
"""

import numpy as np
from numpy.typing import ArrayLike

from second_opinions.plane_conductors import PlaneConductor
from spinlev.fem.plate.slab import Slab, wave_numbers
from spinlev.fem.rotor.models import AccuracyError
from spinlev.geometry.common import MU_0, Array

PRECISION = 1e-11
MOST_DIRECTIONS = 2**16


def drag_tensor(slab: Slab, height: float, moment: ArrayLike) -> Array:
    """C (3, 3), N s/m: the force -C v on a dipole `moment` (3,), A m², that moves slowly with v, `height` m up.

    Exact in the limit of slow motion, μ0σ|v|(h + t) ≪ 1.  A vertical moment has C_zz = μ0²σm²/64π (h⁻³ - (h+t)⁻³),
    and half of it in the plane.
    """
    m_x, m_y, m_z = np.asarray(moment, float)
    lateral = m_x**2 + m_y**2
    tensor = np.zeros((3, 3))
    tensor[0, 0] = m_z**2 + (3 * m_x**2 + m_y**2) / 4
    tensor[1, 1] = m_z**2 + (3 * m_y**2 + m_x**2) / 4
    tensor[0, 1] = tensor[1, 0] = m_x * m_y / 2
    tensor[2, 2] = 2 * m_z**2 + lateral
    shape = height**-3 - (height + slab.thickness) ** -3
    return MU_0**2 * slab.conductivity / (128 * np.pi) * shape * tensor


def sliding_force(conductor: PlaneConductor, height: float, velocity: ArrayLike, moment: ArrayLike) -> Array:
    """Force (3,), N, on a dipole `moment` (3,), A m², that slides steadily with `velocity` (2,), m/s, in the plane.

    The directions of k are doubled until the force is settled to 1e-11 of its size.

    Raises
    ------
    AccuracyError : the force does not settle (speeds far above 2/(μ0σt), where drag is all but gone)
    """
    moment, velocity = np.asarray(moment, float), np.asarray(velocity, float)
    previous, directions = np.full(3, np.inf), 32
    while directions <= MOST_DIRECTIONS:
        force = _force(conductor, height, velocity, moment, directions)
        if np.linalg.norm(force - previous) <= PRECISION * np.linalg.norm(force):
            return force
        previous, directions = force, 2 * directions
    raise AccuracyError(f"Input velocity_m_s must be slower for a settled force; instead received {velocity!r}.")


def _force(conductor: PlaneConductor, height: float, velocity: Array, moment: Array, directions: int) -> Array:
    """The integral with a given number of directions of k."""
    k, weight = wave_numbers(np.array(height))
    weight = weight * k**3 * np.exp(-2 * k * height)
    total = np.zeros(3)
    for angle in np.array_split(2 * np.pi * (np.arange(directions) + 0.5) / directions, max(1, directions // 256)):
        along = np.stack([np.cos(angle), np.sin(angle)])
        intensity = (moment[:2] @ along) ** 2 + moment[2] ** 2
        frequency = -(velocity @ along)[:, None] * k / (2 * np.pi)
        part = intensity * (conductor.reflection(k, frequency) @ weight)
        total += np.array([*(along @ part.imag), part.real.sum()])
    return MU_0 / (8 * np.pi**2) * (2 * np.pi / directions) * total
