"""What the turning rotor alone leaves in a plate."""

from types import SimpleNamespace

import numpy as np

from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.fem.plate.table import RotorShare

RATES = np.array([30.0, 400.0, 9000.0])
SHARE = RotorShare(0.02, np.random.default_rng(0).normal(size=(7, 3, 4)), 0.0)
MEMORY = PlateMemory(None, SimpleNamespace(rates=RATES), SHARE)


def test_states_in_the_steady_turn_obey_their_equations():
    """∂q/∂t = -λ (q - r) at every angle and depth, by a difference of order 4, for both senses of rotation."""
    for omega in (700.0, -700.0):
        states, step = MEMORY.left_by_rotor(omega), 1e-3
        for angle, depth in ((0.0, 0.0), (1.0, 0.007), (4.0, 0.02)):
            near = [states.signals(angle + k * step, depth) for k in (-2, -1, 1, 2)]
            slope = omega * (near[0] - 8 * near[1] + 8 * near[2] - near[3]) / (12 * step)
            left, signals = states.signals(angle, depth), SHARE.signals(angle, depth)
            np.testing.assert_allclose(slope, -RATES * (left - signals), atol=1e-9 * np.abs(RATES * left).max())


def test_a_rotor_at_rest_drives_nothing():
    assert np.array_equal(MEMORY.left_by_rotor(0.0).series, SHARE.series)
