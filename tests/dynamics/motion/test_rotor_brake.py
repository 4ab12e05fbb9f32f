"""Currents in the rotor as an effect: the table's force and power, and flights that grow as the eigenvalue says.

The table is that of balls in closed form, the field a dipole's: both cheap, and no less a test of the equations.
"""

from dataclasses import replace

import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.equilibria.equilibrium import modes
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.flight import simulate
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import RotorCurrents
from spinlev.dynamics.motion.state import Scales, State
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor_metal import ball_losses, pieces_of
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Scene

CUBE = tuple(replace(magnet, conductivity=6.7e5) for magnet in horizontal(1.5e-3, 10e-3, 1.305, 1.0))
BARE = Scene(150.0, horizontal(1.5e-3, 10e-3, 1.305, 1.0), PERMEABLE, Drag(0.0, 0.0))
FIELD = rotor_table(BARE.rotor, "dipole")
LOSSES = ball_losses(pieces_of(CUBE, ()), degree=2)
TABLE = Interaction(FIELD, (RotorCurrents(LOSSES),))
SCALES = Scales.of(BARE)
STATE = State(
    np.array([3e-3, 1e-3, -21e-3]),
    np.array([0.3, -0.2, 0.1]),
    np.array([1.0, 2.0, -3.0]) / np.sqrt(14),
    np.array([30.0, -800.0, 200.0]),
)
ROTOR = np.array([0.0, 0.0, BARE.angular_velocity])
RATES = np.concatenate([STATE.velocity - np.cross(ROTOR, STATE.position), STATE.spin - ROTOR])
MATRIX = LOSSES.dissipation(STATE.position[None], PERMEABLE.moment * STATE.moment[None])[0]


def test_force_and_torque_are_minus_the_tables_matrix():
    """-D q̇ with q̇ the velocity against the rotor and the turn against it, back in SI units."""
    values, given = parameters(BARE, SCALES), SCALES.pack(STATE)[None]
    added = (Rates(TABLE)(given, values)[0] - Rates(FIELD)(given, values)[0])[0]
    wrench = -MATRIX @ RATES
    assert np.linalg.norm(wrench[:3]) > 1e-6
    np.testing.assert_allclose(added[3:6] * PERMEABLE.mass * SCALES.length / SCALES.time**2, wrench[:3], rtol=1e-8)
    np.testing.assert_allclose(added[9:] * PERMEABLE.inertia / SCALES.time**2, wrench[3:], rtol=1e-8)


def test_a_floater_in_step_with_the_rotor_feels_nothing():
    """Also one that spins about its own moment."""
    values = parameters(BARE, SCALES)
    still = replace(STATE, velocity=np.cross(ROTOR, STATE.position), spin=ROTOR - 300.0 * STATE.moment)
    given = SCALES.pack(still)[None]
    added = Rates(TABLE)(given, values)[0] - Rates(FIELD)(given, values)[0]
    assert np.abs(added).max() < 1e-15


def grown(scene, table, equilibrium, duration, kick=1e-6):
    """Growth per second of a flight that begins along the mode that grows, and that of its eigenvalue."""
    scales = Scales.of(scene)
    packed = scales.pack(equilibrium.state)
    slope = Rates(with_effects(scene, table))(packed[None], parameters(scene, scales, frozen_spin=True))[1][0]
    found = modes(packed, slope)
    fastest = int(np.argmax(found.eigenvalues.real))
    shape = found.shapes[:, fastest].real / np.abs(found.shapes[:, fastest]).max()
    begun = scales.unpack(packed + kick * shape)
    start = AbsoluteStart(begun.position, begun.velocity, begun.moment / np.linalg.norm(begun.moment), begun.spin)
    flight = simulate(replace(scene, start=start), table, duration)
    seen = scales.pack(flight.rotor) - packed
    left = np.linalg.pinv(found.shapes)[fastest]
    size = np.abs(seen @ left)
    growth = np.polyfit(flight.time, np.log(size), 1)[0]
    return growth, found.growth / scales.time, flight


def test_a_kicked_flight_grows_as_its_eigenvalue_says():
    """By a factor of 1.1 in 3 s, with the ledger closed; without the currents it does not grow."""
    equilibrium = find_equilibria(BARE, FIELD)[0]
    growth, expected, flight = grown(BARE, TABLE, equilibrium, 3.0)
    assert expected == pytest.approx(0.0352, rel=0.12)  # that of the cube by finite elements
    assert growth == pytest.approx(expected, rel=1e-2)
    assert flight.energy_error < 1e-12
    calm, none, _ = grown(BARE, FIELD, equilibrium, 3.0)
    assert abs(calm) < 1e-3 * growth
    assert abs(none) < 1e-6


def test_its_power_is_the_loss_of_the_table():
    """Rate of the Jacobi integral: minus q̇ᵀ D q̇."""
    import heyoka as hy

    equations = equations_of_motion(TABLE)
    power = hy.cfunc([equations.power], list(equations.variables), compact_mode=True, opt_level=0)
    values = parameters(BARE, SCALES)[: power.nparams]
    found = power(SCALES.pack(STATE), pars=values)[0]
    unit = PERMEABLE.mass * SCALES.length**2 / SCALES.time**3
    assert found * unit == pytest.approx(-RATES @ MATRIX @ RATES, rel=1e-9)


def test_metal_in_which_currents_have_memory_is_refused():
    """Copper in the rotor: 3.8 mm of skin depth at twice 150 Hz."""
    copper = replace(BARE, rotor=tuple(replace(magnet, conductivity=6e7) for magnet in BARE.rotor))
    with pytest.raises(InputError, match="must leave its skin depth large"):
        with_effects(copper, FIELD)
