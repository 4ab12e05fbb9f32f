"""A magnet with its moment upright, thrown straight at an infinite conducting slab: the motion in time, by hand.

In the slab the azimuthal potential is A = ∫ a(k, z) J₁(kρ) dk.  A dipole m at height h over the face has
a_s = (μ0 m/4π) k e^{-k|z-h|}; that of the currents obeys a_r'' - k² a_r = μ0σ ∂(a_r + a_s)/∂t inside and decays as
e^{-k|z|} outside.  Linear elements over the thickness make it K a_r = -M ∂(a_r + a_s)/∂t, whose modes u_j relax at
rates λ_j.  The flux of each, p_j = y_j + c_j(h), stays but for ∂p_j/∂t = -λ_j (p_j - c_j), and on the magnet acts

    F = -m ∫ k² e^{-kh} Σ_j y_j u_j(0) dk.

Nothing of it is the package's: its slab has closed modes, waves of cylinders and a reduced network.
"""

import numpy as np
import scipy

from spinlev.geometry.common import MU_0, Array


def thrown_over_slab(
    conductivity: float, thickness: float, moment: float, mass: float, height: float, speed: float, times: Array
) -> Array:
    """Heights (n,) m of the magnet's centre over the face at evenly spaced times (n,) s, upright all the way.

    `height` and `speed` (m, m/s, up) are those at the first time, when no currents flow.
    """
    node, weight = np.polynomial.legendre.leggauss(60)
    logs = np.log([1.0, 2000.0])
    k = np.exp(logs.mean() + np.diff(logs) / 2 * node)
    weight = weight * np.diff(logs) / 2 * k
    rates, faces, drives = (
        np.array(part) for part in zip(*(_modes(conductivity, thickness, q) for q in k), strict=True)
    )
    step = times[1] - times[0]
    decay, lost = np.exp(-rates * step), -np.expm1(-rates * step)

    def source(h: float) -> Array:
        return np.asarray(MU_0 * moment / (4 * np.pi) * (k * np.exp(-k * h))[:, None] * drives)

    def acceleration(h: float, flux: Array) -> float:
        currents = np.sum((flux - source(h)) * faces, axis=1)
        return float(-moment * np.sum(weight * k**2 * np.exp(-k * h) * currents) / mass - 9.81)

    flux, found = source(height), [height]
    for _ in times[1:]:  # half a kick, a drift in which the currents relax about the middle's sources, half a kick
        speed += step / 2 * acceleration(height, flux)
        middle = height + step / 2 * speed
        height += step * speed
        flux = decay * flux + lost * source(middle)
        speed += step / 2 * acceleration(height, flux)
        found.append(height)
    return np.array(found)


def _modes(conductivity: float, thickness: float, k: float, cells: int = 80) -> tuple[Array, Array, Array]:
    """Rates, values at the face, and what e^{kz} drives, of the modes at one wave number; the slab is -t < z < 0."""
    z = -thickness * (1 - np.cos(np.pi * np.arange(cells + 1) / cells)) / 2  # cells are small at both faces
    width = -np.diff(z)
    stiff, mass = np.zeros((2, cells + 1, cells + 1))
    for n, d in enumerate(width):
        pair = np.ix_([n, n + 1], [n, n + 1])
        mass[pair] += MU_0 * conductivity * d / 6 * np.array([[2, 1], [1, 2]])
        stiff[pair] += np.array([[1, -1], [-1, 1]]) / d + k**2 * d / 6 * np.array([[2, 1], [1, 2]])
    stiff[0, 0] += k
    stiff[-1, -1] += k
    rates, shapes = scipy.linalg.eigh(stiff, mass)
    return rates, shapes[0], shapes.T @ mass @ np.exp(k * z)
