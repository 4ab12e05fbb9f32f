"""Eddy currents of a conducting sphere in closed form, and of a tube as a series.

In a uniform field B e^{iωt} a non-magnetic sphere takes the moment (W. R. Smythe, Static and Dynamic Electricity,
3rd ed., section 10.06)

    m = α B,    α = -(2πR³/μ0) [1 - 3 coth(x)/x + 3/x²],    x² = iωμ0σR²,

and where skin depth is large against R: α = -iω (2π/15) σ R⁵.  In a field of size B⊥ that turns at ω across its axis
it feels the torque -Im α B⊥² along the turn.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import iv, ive, kv

from ...geometry.common import MU_0, Array
from ..harmonics.solid import gauss_legendre

ComplexArray = NDArray[np.complex128]
# |x²| below which four terms of the series are used: there they and the closed form are both good to 3e-11
SERIES = 0.02
COEFFICIENTS = (1 / 15, -2 / 315, 1 / 1575, -2 / 31185)


def polarizability(radius: float, conductivity: float, frequency: ArrayLike) -> ComplexArray:
    """α of a sphere in a uniform oscillating field.

    (...,) A m²/T to 3e-11, 0 at 0 Hz, for a `radius` (m), `conductivity` (S/m) and `frequency` (...,) Hz of either
    sign. Raises ValueError: radius or conductivity not positive.
    """
    for name, value in (("radius_m", radius), ("conductivity_S_m", conductivity)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"Input {name} must be positive; instead received {value!r}.")
    square = 2j * np.pi * np.asarray(frequency, float) * MU_0 * conductivity * radius**2
    small = np.abs(square) < SERIES
    x = np.sqrt(np.where(small, 1.0, square))
    closed = 1 - 3 / (x * np.tanh(x)) + 3 / x**2
    series = sum(c * square ** (n + 1) for n, c in enumerate(COEFFICIENTS))
    return np.asarray(-2 * np.pi * radius**3 / MU_0 * np.where(small, series, closed))


def thin_field_torque(radius: float, conductivity: float) -> float:
    """(2π/15) σ R⁵, N m s/T²: torque per B × (Ω × B), Ω the field's relative angular velocity; to (ωμ0σR²)²/105."""
    return 2 * np.pi / 15 * conductivity * radius**5


def skin_number(radius: float, conductivity: float, frequency: float) -> float:
    """ωμ0σR² of a `radius` (m), `conductivity` (S/m) and `frequency` (Hz): twice the square of radius by skin depth."""
    return float(2 * np.pi * frequency * MU_0 * conductivity * radius**2)


def sphere_reaction(radius: float, conductivity: float, frequency: float, distance: float) -> complex:
    """G_rr, T/(A m²), of a sphere of `radius`, `conductivity` at a dipole at `distance`, at a `frequency`; m, S/m, Hz.

    Of each harmonic r^l the part l/(l+1) R^(2l+1) I_(l+3/2)(x)/I_(l-1/2)(x) comes back as r^-(l+1), the first by α.
    """
    degrees = np.arange(1, 1 + int(np.ceil(40 / np.log(distance / radius))))
    x = np.sqrt(2j * np.pi * frequency * MU_0 * conductivity) * radius
    back = ive(degrees + 1.5, x) / ive(degrees - 0.5, x)
    terms = degrees * (degrees + 1) * (radius / distance) ** (2 * degrees + 1) * back
    return complex(-MU_0 / (4 * np.pi * distance**3) * np.sum(terms))


def tube_reaction(inner: float, outer: float, conductivity: float, frequency: float) -> complex:
    """G_zz, T/(A m²), at the axis of a tube: radii `inner` and `outer` in m, `conductivity` S/m, `frequency` Hz."""
    k, dk, back = _tube_harmonics(inner, outer, conductivity, lambda k: 2 * np.pi * frequency + 0 * k)
    return complex(MU_0 / (2 * np.pi**2) * np.sum(dk * k**2 * back))


def tube_drag(
    inner: float, outer: float, conductivity: float, speed: float, magnet: tuple[float, float] | None = None
) -> float:
    """Drag on a dipole of 1 A m² along the axis of an infinite tube, N/(A m²)², of `inner`, `outer`, `conductivity`.

    As `tube_reaction`; each harmonic e^{ik(z-vt)} has the frequency kv. `speed`: m/s; `magnet`: radius a and height h,
    m, of a cylinder magnetised along the axis: 2 I₁(ka)/ka · sin(kh/2)/(kh/2) of the dipole's; None for a dipole.
    """
    k, dk, back = _tube_harmonics(inner, outer, conductivity, lambda k: k * speed)
    share = np.ones_like(k)
    if magnet:
        radius, height = magnet
        share = 2 * iv(1, k * radius) / (k * radius) * np.sinc(k * height / (2 * np.pi))
    return float(-MU_0 / (2 * np.pi**2) * np.sum(dk * k**3 * back.imag * share**2))


def _tube_harmonics(
    inner: float, outer: float, conductivity: float, rates: Callable[[Array], Array]
) -> tuple[Array, Array, ComplexArray]:
    """Wave numbers k, 1/m, their weights and what comes back of each at an angular frequency (rad/s) of its own.

    Of a harmonic e^{ikz} of a dipole's A_φ, k K₁(kρ), C I₁(kρ) comes back, with A and H continuous at both walls.
    """
    nodes, weights = gauss_legendre(400)
    k, dk = 20 / inner * (nodes + 1), 20 / inner * weights
    within = np.sqrt(k**2 + 1j * rates(k) * MU_0 * conductivity)
    rows = np.zeros((len(k), 4, 4), complex)
    for row, radius, outside, at in ((0, inner, iv, 0), (2, outer, kv, 3)):
        x, y, sign = k * radius, within * radius, 1.0 if at == 0 else -1.0
        rows[:, row, at], rows[:, row, 1], rows[:, row, 2] = outside(1, x), -iv(1, y), -kv(1, y)
        rows[:, row + 1, at] = sign * k * outside(0, x)
        rows[:, row + 1, 1], rows[:, row + 1, 2] = -within * iv(0, y), within * kv(0, y)
    source = np.stack([-kv(1, k * inner), k * kv(0, k * inner), 0 * k, 0 * k], axis=1)
    return k, dk, np.linalg.solve(rows, source[:, :, None])[:, 0, 0]
