"""The floater's own currents as an effect: their torque, and that they only ever take from the Jacobi integral."""

from dataclasses import replace

import numpy as np

from spinlev.dynamics.effects import FloaterCurrents, with_effects
from spinlev.dynamics.motion import Interaction, Rates, Scales, State, parameters
from spinlev.fem.closed_forms import rotating_torque
from spinlev.fem.rotor_tables import rotor_table
from spinlev.geometry.bodies import horizontal
from spinlev.geometry.scenes import Drag, Floater, Scene

FLOATER = Floater(radius=6.35e-3, remanence=1.305, recoil_permeability=1.0, density=7500.0, conductivity=6.7e5)
SCENE = Scene(110.0, horizontal(2e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
TABLE = rotor_table(SCENE.rotor, "dipole")


def test_torque_on_a_floater_at_rest_in_the_laboratory():
    """Accelerations with and without the effect differ by σ's closed form for the field across the spin, alone."""
    moment = np.array([1.0, 2.0, -3.0]) / np.sqrt(14)
    state = State(np.array([3e-3, 1e-3, -21e-3]), np.zeros(3), moment, np.zeros(3))
    scales = Scales.of(SCENE)
    values, given = parameters(SCENE, scales), scales.pack(state)[None]
    change = Rates(with_effects(SCENE, TABLE))(given, values)[0][0] - Rates(TABLE)(given, values)[0][0]
    field = TABLE.evaluate(state.position)[0][0]
    lag = np.array([0.0, 0.0, -SCENE.angular_velocity])
    unit = float(rotating_torque(FLOATER.radius, FLOATER.conductivity, SCENE.frequency, 1.0)) / SCENE.angular_velocity
    torque = unit * (field * (field @ lag) - field @ field * lag)
    assert np.abs(torque).max() > 0
    np.testing.assert_allclose(change[9:] * FLOATER.inertia / scales.time**2, torque, rtol=1e-9)
    assert not change[:9].any()


def test_an_effect_is_added_once_and_only_where_the_scene_asks():
    once = with_effects(SCENE, TABLE)
    assert [effect.name for effect in with_effects(SCENE, once).effects] == [FloaterCurrents().name]
    bare = replace(SCENE, floater=replace(FLOATER, conductivity=None))
    assert with_effects(bare, TABLE).effects == ()
    assert with_effects(bare, Interaction(TABLE, (FloaterCurrents(),))).effects == once.effects
