"""Eigenvalues of equilibria against small motions that are simulated, and against what symmetry demands."""

from dataclasses import replace

import numpy as np
import pytest
from article import MAGNETS, SCENE

from spinlev.dynamics.equilibria.equilibrium import left_eigenvectors, modes
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.flight import Flight, integrate
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.magnets import vertical
from spinlev.geometry.scene.contents import Drag

CUBOID = RotorTable("cuboid", MAGNETS, MAGNETS)


def dipole_table(magnets):
    return RotorTable("dipole", magnets, (), tuple(uniform_moments(m, 1) for m in magnets))


def motion_about(scene, equilibrium):
    """Eigenvalues in 1/s."""
    scales = Scales.of(scene)
    state = scales.pack(equilibrium.state)
    slope = Rates(CUBOID)(state[None], parameters(scene, scales, frozen_spin=True))[1][0]
    return modes(state, slope), scales


def kicked(scene, equilibrium, kick, duration):
    """Time and deviation (n, 3) of the position in the rotor's frame after a change (12,) of the scaled state."""
    scales = Scales.of(scene)
    start = scales.unpack(scales.pack(equilibrium.state) + kick)
    start = replace(start, moment=start.moment / np.linalg.norm(start.moment))
    flight = integrate(Flight(scene, CUBOID, duration, compact=True), start, duration)
    assert flight.ended_by == "duration"
    return flight.time, flight.rotor.position - equilibrium.position


def fit_residual(time, signal, eigenvalues):
    """Part of `signal` (n, k) that is no combination of exp(λt)."""
    basis = np.exp(np.multiply.outer(time, eigenvalues))
    basis = np.concatenate([basis.real, basis.imag], axis=1)
    rest = signal - basis @ np.linalg.lstsq(basis, signal, rcond=1e-12)[0]
    return np.linalg.norm(rest) / np.linalg.norm(signal)


@pytest.mark.parametrize("drag", [Drag(0.0, 0.0), Drag(5e-2, 0.0)], ids=["without drag", "with strong linear drag"])
def test_small_motion_is_made_of_the_eigenmodes(drag):
    """Frequencies to 0.01 Hz and damping to 0.2 /s decide whether half a second of motion is reproduced."""
    scene = replace(SCENE, drag=drag)
    equilibrium = next(e for e in find_equilibria(scene, CUBOID) if abs(e.distance - 20e-3) < 1e-3)
    motion, scales = motion_about(scene, equilibrium)
    rates = motion.eigenvalues / scales.time
    assert equilibrium.growth_per_s == pytest.approx(rates.real.max(), abs=1e-9)
    kick = 1e-6 * np.random.default_rng(6).normal(size=12)
    kick[9:] -= equilibrium.state.moment * (kick[9:] @ equilibrium.state.moment)
    kick[6:9] = 0.0
    time, deviation = kicked(scene, equilibrium, kick, 0.5)
    fitted = fit_residual(time, deviation, rates)
    assert fitted < 3e-4  # the motion's own curvature: its size, 1e-5 radii, against 1e-1
    assert fit_residual(time, deviation, rates + 0.2) > 10 * fitted
    assert fit_residual(time, deviation, rates * (1 + 1e-3)) > 10 * fitted


def test_growth_rate_equals_that_of_a_simulated_escape():
    equilibrium = next(e for e in find_equilibria(SCENE, CUBOID) if abs(e.distance - 29.8e-3) < 1e-3)
    assert not equilibrium.stable
    motion, _ = motion_about(SCENE, equilibrium)
    shape = motion.shapes[:, np.argmax(motion.eigenvalues.real)].real
    time, deviation = kicked(SCENE, equilibrium, 1e-8 * shape, 0.15)
    size = np.linalg.norm(deviation, axis=1)
    window = time > 0.02
    slope = np.polyfit(time[window], np.log(size[window]), 1)[0]
    assert slope == pytest.approx(equilibrium.growth_per_s, rel=1e-4)  # non-linear by then: 1e-6


def test_without_drag_eigenvalues_come_in_pairs_of_both_signs():
    """The linearised motion is Hamiltonian: λ, -λ and their conjugates; five frequencies if all are imaginary."""
    for equilibrium in find_equilibria(SCENE, CUBOID):
        motion, _ = motion_about(SCENE, equilibrium)
        distance = np.abs(motion.eigenvalues[:, None] + motion.eigenvalues[None, :]).min(axis=1)
        assert np.all(distance <= 2 * motion.errors)
        if equilibrium.stable:
            assert len(equilibrium.frequencies_hz) == 5


@pytest.mark.slow
def test_stokes_drag_is_resolved():
    """Rates of 1e-4 /s are far above round-off, and the sign of drag turns theirs."""
    damped = replace(SCENE, drag=Drag(2.2e-6, 1.2e-10))
    driven = replace(SCENE, drag=Drag(-2.2e-6, -1.2e-10))
    rates = []
    for scene in (damped, driven):
        near = next(e for e in find_equilibria(scene, CUBOID) if abs(e.distance - 19.9e-3) < 1e-3)
        assert near.growth_error_per_s < 1e-2 * abs(near.growth_per_s)
        motion, scales = motion_about(scene, near)
        rates.append(np.sort(motion.eigenvalues.real / scales.time))
        assert near.stable == (scene is damped)
    np.testing.assert_allclose(rates[0], -rates[1][::-1], rtol=1e-3)  # second order in drag, and round-off
    assert -2e-4 < rates[0].max() < 0


@pytest.mark.parametrize(("frequency", "spin", "stable"), [(80.0, 0.0, True), (100.0, 0.0, False), (80.0, -0.4, False)])
def test_published_stability_of_the_vertical_rotor(frequency, spin, stable):
    """PHYSICS.md: stable at 80 Hz, oscillatory loss from about 100 Hz, laterally unstable from s = -0.4."""
    magnets = vertical(14e-3, 10e-3, 1.305, 1.0)
    scene = replace(SCENE, frequency=frequency, rotor=magnets)
    found = [e for e in find_equilibria(scene, dipole_table(magnets), spin) if 15e-3 < e.distance < 30e-3]
    assert found
    assert found[0].stable is stable


def test_modes_are_named_by_their_shapes():
    """Bounce alone moves along the axis; side modes lie about the rotor's rate, at the slow lateral rate from it."""
    equilibrium = next(e for e in find_equilibria(SCENE, CUBOID) if e.stable)
    modes = {mode.name: mode for mode in equilibrium.modes}
    assert list(modes) == ["bounce", "side, backward", "side, forward", "precession", "nutation"]
    assert 10 < modes["bounce"].frequency_hz < 30
    assert modes["side, backward"].frequency_hz < SCENE.frequency < modes["side, forward"].frequency_hz
    assert modes["precession"].frequency_hz < modes["nutation"].frequency_hz
    np.testing.assert_allclose(sorted(m.frequency_hz for m in modes.values()), equilibrium.frequencies_hz, rtol=1e-12)


def test_of_a_pair_that_does_not_oscillate_the_growing_one_is_told():
    far = next(e for e in find_equilibria(SCENE, CUBOID) if not e.stable)
    assert far.modes[0].name == "bounce"
    assert far.modes[0].frequency_hz == pytest.approx(0, abs=1e-6)
    assert far.modes[0].growth_per_s == pytest.approx(far.growth_per_s)


def test_left_eigenvectors_are_dual_to_the_right_ones():
    """To round-off; where eigenvectors have run together (one Jordan block among others) what is found is finite."""
    matrices = np.random.default_rng(2).normal(size=(3, 10, 10))
    right = np.linalg.eig(matrices)[1]
    np.testing.assert_allclose(left_eigenvectors(right) @ right, np.eye(10) + np.zeros((3, 1, 1)), atol=1e-12)
    right[1, :, 4] = right[1, :, 3] = np.eye(10)[3]
    found = left_eigenvectors(right)
    np.testing.assert_allclose(found[::2] @ right[::2], np.eye(10) + np.zeros((2, 1, 1)), atol=1e-12)
    assert np.isfinite(found).all()
