"""The floater's own currents as an effect: against a closed form in the floater's frame, and of what form they are."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest

from spinlev.dynamics.effects import FloaterCurrents, with_effects
from spinlev.dynamics.motion import Interaction, Rates, Scales, State, equations_of_motion, parameters
from spinlev.fem.rotor_losses import ball_losses
from spinlev.fem.rotor_losses.balls import CUBE
from spinlev.fem.rotor_tables import rotor_table
from spinlev.geometry.basics import Box
from spinlev.geometry.bodies import horizontal
from spinlev.geometry.scenes import Drag, Floater, Scene

FLOATER = Floater(radius=6.35e-3, remanence=1.305, recoil_permeability=1.0, density=7500.0, conductivity=6.7e5)
SCENE = Scene(110.0, horizontal(2e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
TABLE = rotor_table(SCENE.rotor, "dipole")


def test_power_beside_a_dipole_is_that_of_a_ball_in_its_own_frame():
    """The same relative motion seen from the floater, a ball at rest by which the dipole moves: degrees 1 and 2.

    The closed form of `ball_losses` knows nothing of fields, gradients or frames; so the effect's tensors are right.
    """
    rotor = np.array([0.0, 0.0, SCENE.angular_velocity])
    state = State(
        np.array([3e-3, 1e-3, -17e-3]),
        np.array([0.7, -0.2, 0.1]),
        np.array([1.0, 2.0, -3.0]) / np.sqrt(14),
        np.array([30.0, -800.0, 200.0]),
    )
    scales = Scales.of(SCENE)
    equations = equations_of_motion(with_effects(SCENE, TABLE))
    power = hy.cfunc([equations.power], list(equations.variables), compact_mode=True, opt_level=0)
    found = power(scales.pack(state), pars=parameters(SCENE, scales)[: power.nparams])[0]
    drift, lag = state.velocity - np.cross(rotor, state.position), state.spin - rotor
    edge = FLOATER.radius / CUBE
    table = ball_losses([((Box((edge,) * 3, state.position),), FLOATER.conductivity)], degree=2)
    center, moment = SCENE.rotor[0].box.center, TABLE.moment
    moving = -drift - np.cross(lag, center - state.position)
    rates = np.concatenate([moving, -lag])
    matrix = table.dissipation(center[None], moment[None])[0]
    unit = FLOATER.mass * scales.length**2 / scales.time**3
    assert found * unit == pytest.approx(-rates @ matrix @ rates, rel=2e-5)  # κ is that at the rotor's frequency


def test_force_and_torque_are_the_powers_derivatives():
    """Half of them, with the sign turned: the matrix of velocities is symmetric, and no direction gains."""
    scales, values = Scales.of(SCENE), parameters(SCENE, Scales.of(SCENE))
    rates, bare = Rates(with_effects(SCENE, TABLE)), Rates(TABLE)
    place, moment = np.array([3e-3, 1e-3, -17e-3]), np.array([0.0, 0.6, 0.8])
    rotor = np.array([0.0, 0.0, SCENE.angular_velocity])
    matrix = np.zeros((6, 6))
    for k in range(6):
        change = np.eye(6)[k]
        state = State(place, np.cross(rotor, place) + change[:3], moment, rotor + 100.0 * change[3:])
        packed = scales.pack(state)[None]
        added = (rates(packed, values)[0] - bare(packed, values)[0])[0]
        wrench = (
            np.concatenate([added[3:6] * FLOATER.mass * scales.length, added[9:] * FLOATER.inertia]) / scales.time**2
        )
        matrix[:, k] = -wrench * np.repeat([1.0, 100.0], 3)
    np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=1e-9 * np.abs(matrix).max())
    assert np.all(np.linalg.eigvalsh(matrix)[3:] > 0)
    assert np.linalg.eigvalsh(matrix)[0] > -1e-9 * np.abs(matrix).max()


def test_an_effect_is_added_once_and_only_where_the_scene_asks():
    once = with_effects(SCENE, TABLE)
    assert [effect.name for effect in with_effects(SCENE, once).effects] == [FloaterCurrents().name]
    bare = replace(SCENE, floater=replace(FLOATER, conductivity=None))
    assert with_effects(bare, TABLE).effects == ()
    assert with_effects(bare, Interaction(TABLE, (FloaterCurrents(),))).effects == once.effects
