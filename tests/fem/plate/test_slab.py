"""Infinite slab: independent quadrature, limits, reciprocity, energy."""

from __future__ import annotations

from functools import cache

import mpmath
import numpy as np
import pytest
from second_opinions.phasor import mean_force, mean_loss, mean_torque
from second_opinions.plane_conductors import ThinSheet, reaction_gradient
from second_opinions.sliding import drag_tensor, sliding_force

from spinlev.fem.plate.slab import Slab, mutual_tensor, reaction_tensor
from spinlev.geometry.common import MU_0

PLATE = Slab(3.5e7, 0.03)
ROUND_OFF = 1e-12
"""A few hundred ulp: sums of some 300 terms without cancellation."""


def independent_integrals(powers: tuple[int, ...], height: float, frequency: float) -> list[complex]:
    """The literal formula of PHYSICS.md by adaptive tanh-sinh quadrature with 30 digits."""
    mp = mpmath.mp.clone()
    mp.dps = 30
    h, t, rate = mp.mpf(height), mp.mpf("0.03"), 2 * mp.pi * mp.mpf(frequency) * mp.mpf(MU_0) * mp.mpf("3.5e7")

    @cache  # the nodes are the same for all powers
    def answer(k):
        kappa = mp.sqrt(k * k + 1j * rate)
        e = mp.exp(-2 * kappa * t)
        return mp.exp(-2 * k * h) * (kappa**2 - k**2) * (1 - e) / ((k + kappa) ** 2 - (k - kappa) ** 2 * e)

    scales = {mp.mpf(0), mp.sqrt(rate), rate * t / 2, 1 / t, 1 / h, 4 / h, 12 / h, 40 / h}
    pieces = sorted(s for s in scales if s <= 40 / h)
    return [complex(mp.quad(lambda k, power=power: k**power * answer(k), pieces)) for power in powers]


@pytest.mark.parametrize("height", [0.008, 0.02, 0.06])
@pytest.mark.parametrize("frequency", [0.1, 10.0, 100.0, 1e3, 1e5])
def test_ten_digits_against_independent_quadrature(height, frequency):
    second, third = independent_integrals((2, 3), height, frequency)
    tensor = reaction_tensor(PLATE, height, frequency) / (MU_0 / (4 * np.pi))
    gradient = reaction_gradient(PLATE, height, frequency) / (MU_0 / (4 * np.pi))
    pairs = ((tensor[2, 2], -second), (tensor[0, 0], -second / 2), (gradient[2, 2, 2], third))
    worst = max(abs(getattr(f, p) / getattr(t, p) - 1) for f, t in pairs for p in ("real", "imag"))
    print(f"\n{height * 1e3:g} mm, {frequency:g} Hz: {worst:.1e}")
    assert worst < 1e-10


def test_perfect_conductor_and_its_approach():
    height = np.array([0.008, 0.02, 0.06])
    image = -MU_0 / (16 * np.pi * height**3)
    assert reaction_tensor(Slab(np.inf), height, 50.0)[:, 2, 2] == pytest.approx(image, rel=ROUND_OFF)
    depth = 1 / np.sqrt(np.pi * 1e6 * MU_0 * 3.5e7)
    # first order in the skin depth: the image plane sinks by (1 - i)δ/2, next order 10 (δ/h)² = 1e-3
    sunk = -MU_0 / (16 * np.pi * (height + (1 - 1j) * depth / 2) ** 3)
    assert reaction_tensor(PLATE, height, 1e6)[:, 2, 2] == pytest.approx(sunk, rel=10 * (depth / 0.008) ** 2)


def test_low_frequency_limit():
    frequency, height = 1e-7, np.array([0.008, 0.02, 0.06])
    resistive = -2j * np.pi * frequency * MU_0**2 * 3.5e7 * (1 / height - 1 / (height + 0.03)) / (32 * np.pi)
    # next order is ωμ0σ t h ~ 1e-8, and enters with a logarithm
    assert reaction_tensor(PLATE, height, frequency)[:, 2, 2].imag == pytest.approx(resistive.imag, rel=1e-8)
    assert not reaction_tensor(PLATE, height, 0.0).any()


def test_thin_sheet_and_half_space_are_limits_of_the_slab():
    thin = reaction_tensor(Slab(3.5e13, 3e-8), 0.02, 100.0)
    assert thin[2, 2] == pytest.approx(reaction_tensor(ThinSheet(1.05e6), 0.02, 100.0)[2, 2], rel=1e-5)  # t/h ~ 1e-6
    deep = reaction_tensor(Slab(3.5e7, 5.0), 0.02, 100.0)  # e^{-2t/δ} ~ 0
    assert deep[2, 2] == pytest.approx(reaction_tensor(Slab(3.5e7), 0.02, 100.0)[2, 2], rel=ROUND_OFF)


def test_mutual_tensor_is_reciprocal_and_holds_the_reaction_at_the_dipole():
    rng = np.random.default_rng(4)
    a, b = rng.uniform((-0.05, -0.05, 0.008), (0.05, 0.05, 0.05), (2, 20, 3))
    forth, back = mutual_tensor(PLATE, a, b, 100.0), mutual_tensor(PLATE, b, a, 100.0)
    assert forth == pytest.approx(np.swapaxes(back, -1, -2), rel=ROUND_OFF, abs=1e-14 * abs(forth).max())
    assert mutual_tensor(PLATE, a, a, 100.0) == pytest.approx(reaction_tensor(PLATE, a[:, 2], 100.0), rel=1e-11)


def test_mutual_tensor_of_a_perfect_conductor_is_the_image_dipole():
    point, source = np.array([0.03, -0.04, 0.01]), np.array([0.0, 0.01, 0.02])
    offset = point - source * [1, 1, -1]
    r = np.linalg.norm(offset)
    dipole = MU_0 / (4 * np.pi) * (3 * np.outer(offset, offset) / r**5 - np.eye(3) / r**3)
    # image of m: lateral parts kept, normal part reversed
    assert mutual_tensor(Slab(np.inf), point, source, 50.0) == pytest.approx(dipole @ np.diag([1, 1, -1]), rel=1e-11)


def test_gradient_is_the_derivative_of_the_mutual_tensor():
    source, step = np.array([0.0, 0.0, 0.02]), 1e-4
    shifts = step * np.eye(3)
    fourth_order = [
        (8 * (mutual_tensor(PLATE, source + s, source, 80.0) - mutual_tensor(PLATE, source - s, source, 80.0))
         - mutual_tensor(PLATE, source + 2 * s, source, 80.0) + mutual_tensor(PLATE, source - 2 * s, source, 80.0))
        / (12 * step) for s in shifts]  # fmt: skip
    exact = reaction_gradient(PLATE, 0.02, 80.0)
    assert np.array(fourth_order) == pytest.approx(exact, rel=1e-7, abs=1e-8 * abs(exact).max())  # (step/h)^4 ~ 6e-10


def test_dissipation_torque_and_lift_of_any_moment():
    rng = np.random.default_rng(1)
    height, frequency = rng.uniform(0.008, 0.06, 50), 10 ** rng.uniform(-1, 5, 50)
    tensor = reaction_tensor(PLATE, height, frequency)
    moment = rng.normal(size=(50, 3)) + 1j * rng.normal(size=(50, 3))
    assert (mean_loss(tensor, moment, frequency) > 0).all()
    turning = np.array([1.0, -1j, 0.0])
    torque = mean_torque(tensor, turning)
    assert -torque[:, 2] * 2 * np.pi * frequency == pytest.approx(mean_loss(tensor, turning, frequency), rel=ROUND_OFF)
    lift = mean_force(reaction_gradient(PLATE, height, frequency), moment)
    assert (lift[:, 2] > 0).all()


def test_lift_is_the_slope_of_the_reactive_energy():
    step = 1e-5
    low, high = (reaction_tensor(PLATE, 0.02 + s, 100.0)[2, 2] for s in (-step, step))
    # moving source and image together: F_z = ½·½ d/dh Re G_zz, the halves from time and from self-interaction
    assert mean_force(reaction_gradient(PLATE, 0.02, 100.0), [0, 0, 1.0])[2] == pytest.approx(
        (high - low).real / (2 * step) / 4,
        rel=1e-6,  # (step/h)²
    )


def test_sliding_over_a_thin_sheet_is_reitz():
    sheet, speed = ThinSheet(1e5), 30.0
    wind = 2 / (MU_0 * 1e5)
    lift_limit = 3 * MU_0 / (32 * np.pi * 0.02**4)
    lift = lift_limit * (1 - wind / np.hypot(speed, wind))
    found = sliding_force(sheet, 0.02, [0.0, speed], [0, 0, 1.0])
    assert found == pytest.approx([0.0, -wind / speed * lift, lift], rel=1e-10, abs=1e-12 * lift)


@pytest.mark.parametrize("moment", [(0, 0, 1.0), (1.0, 0, 0), (0.3, -0.5, 0.8)])
def test_slow_drag_is_the_slope_of_sliding_and_of_the_torque_free_limit(moment):
    velocity = np.array([3e-6, -2e-6])
    drag = drag_tensor(PLATE, 0.02, moment)
    assert sliding_force(PLATE, 0.02, velocity, moment)[:2] == pytest.approx(-drag[:2, :2] @ velocity, rel=1e-6)
    vertical = MU_0**2 * 3.5e7 / (64 * np.pi) * (0.02**-3 - 0.05**-3)
    assert drag_tensor(PLATE, 0.02, (0, 0, 1.0)) == pytest.approx(np.diag([0.5, 0.5, 1]) * vertical, rel=ROUND_OFF)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Slab(-1.0), "Input conductivity_S_m must be positive; instead received -1.0."),
        (lambda: Slab(1e7, 0.0), "Input thickness_m must be positive; instead received 0.0."),
        (lambda: ThinSheet(0.0), "Input conductance_S must be positive"),
        (lambda: reaction_tensor(PLATE, -0.01, 50.0), "Input height_m must be positive"),
        (lambda: reaction_tensor(PLATE, 0.01, -50.0), "Input frequency_hz must be finite and not negative"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
