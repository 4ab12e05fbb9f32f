"""Conducting sphere in a uniform field: limits and the energy balance with its own currents."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import spherical_in

from spinlev.fem.closed_forms.eddy_bodies import SERIES, polarizability, thin_field_torque
from spinlev.geometry.common import MU_0

RADIUS, CONDUCTIVITY = 6.35e-3, 6.7e5


def test_thin_field_limit():
    """(2π/15) σ ω B² R⁵; the next term is of the relative order (ωμ0σR²)², 1e-5 here."""
    omega, b = 2 * np.pi * 60.0, 0.012
    expected = 2 * np.pi / 15 * CONDUCTIVITY * omega * b**2 * RADIUS**5
    assert -polarizability(RADIUS, CONDUCTIVITY, 60.0).imag * b**2 == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("frequency", [100.0, 300.0, -300.0])
def test_thin_field_torque_leaves_what_it_says(frequency):
    """-(ωμ0σR²)²/105 of the torque, whose next order is a tenth of a per cent of it or less."""
    omega = 2 * np.pi * frequency
    exact = -polarizability(RADIUS, CONDUCTIVITY, frequency).imag
    thin = thin_field_torque(RADIUS, CONDUCTIVITY) * omega
    expected = (omega * MU_0 * CONDUCTIVITY * RADIUS**2) ** 2 / 105
    assert 1 - exact / thin == pytest.approx(expected, rel=1e-2)


def test_superconducting_limit():
    """-2πR³/μ0 at skin depths small against R; the deviation is 3/|x|, 1.7e-5 here."""
    found = polarizability(RADIUS, 1e12, 1e8) * MU_0 / (-2 * np.pi * RADIUS**3)
    assert abs(found - 1) < 2e-5


def test_series_joins_the_closed_form():
    """Either side of |x²| = SERIES: the frequencies differ by 2e-9, the forms by their errors of 3e-11."""
    frequency = SERIES / (2 * np.pi * MU_0 * CONDUCTIVITY * RADIUS**2)
    below, above = (polarizability(RADIUS, CONDUCTIVITY, frequency * (1 + s * 1e-9)) for s in (-1, 1))
    assert abs(above - below) < 2.2e-9 * abs(above)


@pytest.mark.parametrize("conductivity", [CONDUCTIVITY, 5e7, 1e10])
def test_work_of_the_field_is_the_loss_of_the_currents(conductivity):
    """½ ω² σ ∫|A|² dV of the inner solution A_φ ∝ i₁(kr) sin θ, by quadrature, against -½ ω Im α B²."""
    frequency = 100.0
    omega = 2 * np.pi * frequency
    k = np.sqrt(1j * omega * MU_0 * conductivity)
    r, w = np.polynomial.legendre.leggauss(200)
    r, w = RADIUS * (r + 1) / 2, RADIUS * w / 2
    # at the surface d(r A)/dr + A = 3 B r / 2 sin θ: the applied field and the outer dipole, continuous with slope
    slope = spherical_in(1, k * RADIUS, derivative=True) * k * RADIUS + 2 * spherical_in(1, k * RADIUS)
    amplitude = 3 * RADIUS / 2 / slope
    loss = (
        0.5 * omega**2 * conductivity * 8 * np.pi / 3 * np.sum(w * r**2 * abs(amplitude * spherical_in(1, k * r)) ** 2)
    )
    work = -0.5 * omega * polarizability(RADIUS, conductivity, frequency).imag
    assert work == pytest.approx(loss, rel=1e-10)


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="conductivity_S_m must be positive"):
        polarizability(RADIUS, 0.0, 1.0)
