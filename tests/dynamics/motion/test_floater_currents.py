"""The floater's own currents as an effect: against a closed form in the floater's frame, and of what form they are."""

import re
from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
import scipy

from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.floater_effects import SLOW_ENOUGH, FloaterCurrents, slow_error
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Parameter, Scales, State
from spinlev.fem.closed_forms.eddy_bodies import thin_field_torque
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.table import RotorTable
from spinlev.fem.rotor_metal import CUBE, ball_losses
from spinlev.geometry.common import MU_0, InputError
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box

FLOATER = Floater(radius=6.35e-3, remanence=1.305, recoil_permeability=1.0, density=7500.0, conductivity=6.7e5)
SCENE = Scene(110.0, horizontal(2e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
TABLE = rotor_table(SCENE.rotor, "dipole")
CENTERED = horizontal(0.0, 10e-3, 1.305, 1.0)
SLOW = replace(SCENE, floater=replace(FLOATER, conductivity=0.67))
"""So poor a conductor that its currents are 3e-8 of a radian behind the field: only a thin field's loss is left."""


def test_power_beside_a_dipole_is_that_of_a_ball_in_its_own_frame():
    """The same relative motion seen from the floater, a ball at rest by which the dipole moves: degrees 1 and 2.

    The closed form of `ball_losses` knows nothing of fields, gradients or frames; so the effect's tensors are right.
    """
    floater, rotor = SLOW.floater, np.array([0.0, 0.0, SCENE.angular_velocity])
    state = State(
        np.array([3e-3, 1e-3, -17e-3]),
        np.array([0.7, -0.2, 0.1]),
        np.array([1.0, 2.0, -3.0]) / np.sqrt(14),
        np.array([30.0, -800.0, 200.0]),
    )
    scales = Scales.of(SLOW)
    equations = equations_of_motion(with_effects(SLOW, TABLE))
    power = hy.cfunc([equations.power], list(equations.variables), compact_mode=True, opt_level=0)
    found = power(scales.pack(state), pars=parameters(SLOW, scales)[: power.nparams])[0]
    drift, lag = state.velocity - np.cross(rotor, state.position), state.spin - rotor
    edge = floater.radius / CUBE
    table = ball_losses([((Box((edge,) * 3, state.position),), floater.conductivity)], degree=2)
    center, moment = SCENE.rotor[0].box.center, TABLE.moment
    moving = -drift - np.cross(lag, center - state.position)
    rates = np.concatenate([moving, -lag])
    matrix = table.dissipation(center[None], moment[None])[0]
    unit = floater.mass * scales.length**2 / scales.time**3
    assert found * unit == pytest.approx(-rates @ matrix @ rates, rel=1e-6)  # the delay is 3e-8 of a radian


def test_force_and_torque_are_the_powers_derivatives():
    """Half of them, with the sign turned: the matrix of velocities is symmetric, and no direction gains."""
    scales, values = Scales.of(SCENE), parameters(SCENE, Scales.of(SCENE))
    values[Parameter.SLOWNESS] = 0.0  # as strong, without delay: what is even in the turn, the lift, is no loss
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


def wrench(scene: Scene, state: State, table: RotorTable = TABLE) -> np.ndarray:
    """(6,) force, N, and torque, N m, that the currents add in a state."""
    scales, packed = Scales.of(scene), Scales.of(scene).pack(state)[None]
    values = parameters(scene, scales)
    whole = Interaction(table, (FloaterCurrents(),))
    added = (Rates(whole)(packed, values)[0] - Rates(table)(packed, values)[0])[0]
    floater = scene.floater
    return np.concatenate([added[3:6] * floater.mass * scales.length, added[9:] * floater.inertia]) / scales.time**2


def skin(degree: int, number: float) -> complex:
    """Response of a ball to a field of a potential's degree that alternates, over that of a thin field: Bessel's I."""
    x = np.sqrt(1j * number)
    above, below = (scipy.special.iv(degree + n + 0.5, x) for n in (1, -1))
    return complex((2 * degree + 1) * (2 * degree + 3) * above / below / x**2)


@pytest.mark.parametrize(("number", "tolerance"), [(0.1, 1e-6), (3.69, 1e-6), (20.0, 1e-5), (290.0, 3e-3)])
def test_a_ball_at_rest_on_the_axis_feels_the_exact_torque_and_lift(number: float, tolerance: float):
    """Field and gradient of a dipole across the axis only turn there, so that the closed forms of degrees 1 and 2 do.

    The number is ωμ0σR²; 3.69 is a copper ball of 12.7 mm at 200 Hz.  What modes beyond the eighth and fifth leave is
    the tolerance, at least that of the lift's central difference.
    """
    conductivity = number / (SCENE.angular_velocity * MU_0 * FLOATER.radius**2)
    scene = replace(SCENE, rotor=CENTERED, floater=replace(FLOATER, conductivity=conductivity))
    table, height, step = rotor_table(CENTERED, "dipole"), -25e-3, 2e-5
    state = State(np.array([0.0, 0.0, height]), np.zeros(3), np.array([0.0, 0.0, 1.0]), np.zeros(3))
    lift, torque = wrench(scene, state, table)[[2, 5]]
    strength = thin_field_torque(FLOATER.radius, conductivity) * scene.angular_velocity

    def size(z: float) -> complex:
        """Torque and, in its imaginary part, twice the energy of the response at a height (m)."""
        b, g = (part[0] for part in table.evaluate(np.array([[0.0, 0.0, z]])))
        return strength * (skin(1, number) * (b @ b) + 2 / 21 * FLOATER.radius**2 * skin(2, number) * np.sum(g * g))

    assert torque == pytest.approx(size(height).real, rel=tolerance)
    slope = (size(height + step) - size(height - step)).imag / (2 * step)
    assert lift == pytest.approx(slope / 2, rel=max(tolerance, 1e-5))
    assert lift < 0


def test_turns_about_any_axis_and_drift_are_those_of_the_modes_solved_one_by_one():
    """The polynomials in X of degrees 1 and 2 against dense inverses for a ball of copper in a general state."""
    scene = replace(SCENE, floater=replace(FLOATER, conductivity=5.8e7, radius=12e-3))
    rotor = np.array([0.0, 0.0, scene.angular_velocity])
    state = State(
        np.array([8e-3, 3e-3, -27e-3]),
        np.array([0.7, -0.2, 0.1]),
        np.array([0.0, 0.6, 0.8]),
        np.array([90.0, -400, 200]),
    )
    drift, lag = state.velocity - np.cross(rotor, state.position), state.spin - rotor
    radius, conductivity = scene.floater.radius, 5.8e7
    b, g = (part[0] for part in TABLE.evaluate(state.position[None]))
    step = 1e-6 * np.eye(3)
    bend = np.stack([np.squeeze(np.diff([TABLE.evaluate((state.position + s)[None])[1][0] for s in (-d, d)], axis=0))
                     for d in step], axis=2) / 2e-6  # fmt: skip
    turn = np.cross(lag, np.eye(3)).T  # X of vectors
    both = np.kron(turn, np.eye(3)) + np.kron(np.eye(3), turn)  # X of matrices, row by row
    delay = MU_0 * conductivity * radius**2
    change, changes = np.zeros(3), bend @ drift
    for z in np.pi * np.arange(1, 400):
        inverse = np.linalg.inv(np.eye(3) - delay / z**2 * turn)
        change = change + 90 / z**4 * (inverse @ inverse @ g @ drift - turn @ inverse @ b)
    for n in range(1, 400):
        z = scipy.optimize.brentq(lambda x: scipy.special.spherical_jn(1, x), np.pi * n, np.pi * (n + 1))
        inverse = np.linalg.inv(np.eye(9) - delay / z**2 * both)
        changes = changes - 350 / z**4 * (both @ inverse @ g.ravel()).reshape(3, 3)
    kappa = thin_field_torque(radius, conductivity)
    quadrupole = 2 / 21 * radius**2 * kappa
    force = -kappa * g.T @ change - quadrupole * np.einsum("ijk,ij->k", bend, changes)
    product = changes @ g
    twist = np.array([product[1, 2] - product[2, 1], product[2, 0] - product[0, 2], product[0, 1] - product[1, 0]])
    torque = kappa * np.cross(b, change) - 2 * quadrupole * twist
    # 1e-4: modes beyond those that are followed, in sums of thousands here, and the differences of the gradient.
    found = wrench(scene, state)
    np.testing.assert_allclose(found[:3], force, atol=1e-4 * np.linalg.norm(force))
    np.testing.assert_allclose(found[3:], torque, atol=1e-4 * np.linalg.norm(torque))


def test_a_floater_with_too_thin_a_skin_is_refused_with_a_way_out():
    scene = replace(SCENE, floater=replace(FLOATER, radius=0.05, remanence=0.0, conductivity=5.8e7), frequency=400.0)
    with pytest.raises(InputError, match=r"floater.conductivity_S_m must leave its skin depth at least 0.082 of its"):
        with_effects(scene, TABLE)


def test_a_magnet_too_fast_for_its_own_currents_is_refused_and_what_is_named_will_do():
    """A ball without remanence has no motion as fast as the rotor, and may be of copper."""
    copper = replace(SCENE, floater=replace(FLOATER, radius=15e-3, conductivity=5.8e7), frequency=120.0)
    with pytest.raises(InputError, match=r"large against it where it has a remanence; .* 4\.27 mm at 240 Hz") as caught:
        with_effects(copper, TABLE)
    most, slowest = (float(x) for x in re.findall(r"at most (\S+) S/m or (\S+) Hz", str(caught.value))[0])
    for conductivity, frequency in ((most, 120.0), (5.8e7, slowest)):
        there = replace(copper, floater=replace(copper.floater, conductivity=conductivity), frequency=frequency)
        assert with_effects(there, TABLE).effects
        assert slow_error(there) == pytest.approx(SLOW_ENOUGH, rel=0.03)  # three digits, and half a percent less
    assert with_effects(replace(copper, floater=replace(copper.floater, remanence=0.0)), TABLE).effects


def test_an_effect_is_added_once_and_only_where_the_scene_asks():
    once = with_effects(SCENE, TABLE)
    assert [effect.name for effect in with_effects(SCENE, once).effects] == [FloaterCurrents().name]
    bare = replace(SCENE, floater=replace(FLOATER, conductivity=None))
    assert with_effects(bare, TABLE).effects == ()
    assert with_effects(bare, Interaction(TABLE, (FloaterCurrents(),))).effects == once.effects
