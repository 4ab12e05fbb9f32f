"""Newton's method on the five balances: what it says of its error is so, where it stops early as well."""

import numpy as np

from spinlev.dynamics.motion import Rates, Scales, parameters
from spinlev.dynamics.steady import EVERY, Balance, solve
from spinlev.fem.rotor_tables import rotor_table
from spinlev.geometry.bodies import horizontal
from spinlev.geometry.scenes import Drag, Floater, Scene

SCENE = Scene(110.0, horizontal(2e-3, 10e-3, 1.305, 1.0), Floater(6.35e-3, 1.305, 1.0, 7500.0), Drag(0.0, 0.0))


def test_the_estimate_of_the_error_holds():
    """From starts about the stable equilibrium: against sixty steps more than the one at which it stopped.

    Round-off is 1e-14 here; an early stop leaves what the next step would have mended, a few 1e-13.
    """
    balance = Balance(
        Rates(rotor_table(SCENE.rotor, "dipole")), parameters(SCENE, Scales.of(SCENE), frozen_spin=True), 0.0
    )
    place, pointing = np.array([[0.1, 0.0, -3.1]]), np.array([[-0.1, 0.0, 1.0]])
    place, pointing, step = solve(balance, place, pointing / np.linalg.norm(pointing), EVERY)
    assert step[0] < 1e-8
    generator = np.random.default_rng(0)
    starts = place + 0.03 * generator.normal(size=(200, 3))
    moments = pointing + 0.03 * generator.normal(size=(200, 3))
    moments /= np.linalg.norm(moments, axis=1)[:, None]
    found, turned, step = solve(balance, starts, moments, EVERY)
    near = np.linalg.norm(found - place, axis=1) < 1e-3
    assert near.sum() > 150
    exact, pointing = place, pointing
    for _ in range(5):
        exact, pointing, _ = solve(balance, exact, pointing, EVERY, 1)
    apart = np.maximum(np.linalg.norm(found - exact, axis=1), np.linalg.norm(turned - pointing, axis=1))[near]
    assert np.all(apart < 3 * step[near] + 1e-14)
    assert step[near].max() < 1e-11
