"""Currents in the rotor in the balls of flights: against the table, and flights that grow as the eigenvalue says."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.equilibria.equilibrium import modes
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.balls import LARGE, SMALL, Balls, in_ball
from spinlev.dynamics.flights.flight import simulate
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import RotorCurrents
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.fem.rotor_metal import ball_losses, pieces_of
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Scene

MAGNETS = horizontal(1.5e-3, 10e-3, 1.305, 1.0)
CUBE = tuple(replace(magnet, conductivity=6.7e5) for magnet in MAGNETS)
SCENE = Scene(150.0, MAGNETS, PERMEABLE, Drag(0.0, 0.0))
FIELD = RotorTable("moments", MAGNETS, (), tuple(uniform_moments(m, 13) for m in MAGNETS))
LOSSES = ball_losses(pieces_of(CUBE, ()), degree=2)
TABLE = Interaction(FIELD, (RotorCurrents(LOSSES),))
SCALES = Scales.of(SCENE)


@pytest.fixture(scope="module")
def equilibrium():
    return find_equilibria(SCENE, TABLE)[0]


@pytest.mark.slow
@pytest.mark.parametrize("formula", [SMALL, LARGE])
def test_the_brake_is_that_of_the_table(equilibrium, formula):
    """At any place, moment and motion in the ball, to what is allowed; and its power is the work that it does."""
    equations, bare = (equations_of_motion(in_ball(whole, formula)) for whole in (TABLE, Interaction(FIELD)))
    added = [a - b for a, b in zip(equations.rates, bare.rates, strict=True)]
    outputs = [*added, equations.power]
    function = hy.cfunc(outputs, list(equations.variables), compact_mode=True, opt_level=0)
    center = equilibrium.position
    found = Balls(SCENE, TABLE).at(formula, 2e-4, 0.1, center)
    numbers, error = found
    assert error <= 1e-6
    known = parameters(SCENE, SCALES)
    values = np.concatenate([known, [0.0], numbers])
    radius, generator = 1 / numbers[3], np.random.default_rng(2)
    states = np.tile(SCALES.pack(equilibrium.state), (20, 1))
    away = generator.normal(size=(20, 3))
    away *= generator.uniform(size=(20, 1)) / np.linalg.norm(away, axis=1)[:, None]
    states[:, :3] = (numbers[:3] + radius * away) / SCALES.length
    states[:, 3:6] += 0.1 * generator.normal(size=(20, 3))
    states[:, 6:9] = generator.normal(size=(20, 3))
    states[:, 6:9] /= np.linalg.norm(states[:, 6:9], axis=1)[:, None]
    states[:, 9:] += 0.1 * generator.normal(size=(20, 3))
    brake = function(np.ascontiguousarray(states.T), pars=np.tile(values[: function.nparams, None], 20)).T
    exact = Rates(TABLE)(states, known)[0] - Rates(FIELD)(states, known)[0]
    for part in (slice(3, 6), slice(9, 12)):
        sizes = np.linalg.norm(exact[:, part], axis=1)
        apart = np.linalg.norm(brake[:, part] - exact[:, part], axis=1)
        assert np.median(apart / sizes) < 2e-3
        assert apart.max() < 1e-2 * sizes.max()
    drift = states[:, 3:6] - np.cross([0.0, 0.0, values[0]], states[:, :3])
    lag = states[:, 9:] - [0.0, 0.0, values[0]]
    inertia = PERMEABLE.inertia / (PERMEABLE.mass * SCALES.length**2)
    work = np.sum(brake[:, 3:6] * drift, axis=1) + inertia * np.sum(brake[:, 9:12] * lag, axis=1)
    np.testing.assert_allclose(brake[:, 12], work, rtol=1e-10)
    assert np.all(work < 0)


def test_a_kicked_flight_in_balls_grows_as_its_eigenvalue_says(equilibrium):
    """By the numbers of the ball alone: the table's own expressions are not asked; the ledger closes."""
    packed = SCALES.pack(equilibrium.state)
    slope = Rates(with_effects(SCENE, TABLE))(packed[None], parameters(SCENE, SCALES, frozen_spin=True))[1][0]
    found = modes(packed, slope)
    fastest = int(np.argmax(found.eigenvalues.real))
    shape = found.shapes[:, fastest].real / np.abs(found.shapes[:, fastest]).max()
    begun = SCALES.unpack(packed + 1e-6 * shape)
    start = AbsoluteStart(begun.position, begun.velocity, begun.moment / np.linalg.norm(begun.moment), begun.spin)
    flight = simulate(replace(SCENE, start=start), TABLE, 3.0, compact=True)
    assert flight.field_changes.error > 0
    size = np.abs((SCALES.pack(flight.rotor) - packed) @ np.linalg.pinv(found.shapes)[fastest])
    growth = np.polyfit(flight.time, np.log(size), 1)[0]
    expected = found.growth / SCALES.time
    assert expected > 0.03
    assert growth == pytest.approx(expected, rel=1e-2)
    assert flight.energy_error < 1e-12
