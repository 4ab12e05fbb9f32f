"""Currents of floaters that are no spheres: power in the body's own frame, torque, energy, growth of modes."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spinlev.dynamics.equilibria.equilibrium import LOCKED, free_directions, left_eigenvectors
from spinlev.dynamics.equilibria.perturbed import growth_by_floater
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.flight import Flight, simulate
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.floater_effects import FLOATER_CURRENTS, SLOW_ENOUGH, FloaterCurrents, slow_error
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Parameter, Scales, State, matrices_of
from spinlev.fem.floater_metal import GRADIENTS, conducting, current_shape, loss_and_delay, round_part
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import MU_0, InputError
from spinlev.geometry.magnets import Magnet, horizontal, tilt
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Scene
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box, Cylinder, Sphere

ROTOR = horizontal(2e-3, 10e-3, 1.305, 1.0)
TABLE = rotor_table(ROTOR, "dipole")


def floater(body, conductivity=6.7e5):
    return Floater(body.circumradius, 1.305, 1.0, 7500.0, conductivity, body)


def piece(body, conductivity=6.7e5, remanence=1.305):
    return FloaterPart(Magnet(body, np.array([0.0, 0.0, remanence]), 1.0, conductivity=conductivity), 7500.0)


BRICK = Box((12e-3, 10e-3, 8e-3))
FLOATERS = {
    "cylinder": floater(Cylinder(6.35e-3, 11e-3)),
    "disc": floater(Cylinder(6e-3, 2e-3)),
    "cube": floater(Box((10e-3,) * 3)),
    "brick": floater(BRICK),
    "two cylinders": Floater.composed(
        [piece(Cylinder(5e-3, 4e-3)), piece(Cylinder(3e-3, 4e-3, np.array([0.0, 0.0, 4e-3])))]
    ),
    "cube with brass": Floater.composed(
        [piece(Box((10e-3,) * 3)), piece(Box((4e-3,) * 3, np.array([7e-3, 0.0, 3e-3])), 1.5e7, 0.0)]
    ),
}


def scene_of(body, rotor=ROTOR, frequency=110.0):
    return Scene(frequency, rotor, body, Drag(0.0, 0.0))


def state_of(body, drift=None, lag=None, frequency=110.0):
    """A state in which the floater moves and turns against the rotor."""
    axes, turning = body.axes(np.array([1.0, 2.0, -3.0]) / 14**0.5), np.array([0.0, 0.0, 2 * np.pi * frequency])
    place = np.array([3e-3, 1e-3, -17e-3])
    drift = np.array([0.7, -0.2, 0.1]) if drift is None else drift
    lag = np.array([30.0, -800.0, -490.0]) if lag is None else lag
    moment = axes @ body.pointing
    return State(place, drift + np.cross(turning, place), moment, lag + turning, None if body.round else axes)


def wrench(scene, state, table=TABLE, late=False):
    """(6,) force, N, and torque, N m, that the currents add in a state; they may be late."""
    body, scales = scene.floater, Scales.of(scene)
    effect = FloaterCurrents.of(scene)
    equations = [equations_of_motion(Interaction(table, effects, not body.round)) for effects in ((effect,), ())]
    rates = [rate for one in equations for rate in one.rates]
    function = hy.cfunc(rates, list(equations[0].variables), compact_mode=True, opt_level=0)
    values = parameters(scene, scales)
    values[Parameter.SLOWNESS] *= late
    whole, bare = np.split(function(scales.pack(state), pars=values[: function.nparams]), 2)
    force, torque = (whole - bare)[3:6] * body.mass * scales.length, (whole - bare)[-3:] * body.inertia
    if not body.round:
        torque = state.axes @ (torque * body.principal_inertia / body.inertia)
    return np.concatenate([force, torque]) / scales.time**2


def field_seen(body, place, axes):
    """(8,) field and gradient along the body's axes."""
    b, g = (part[0] for part in TABLE.evaluate(place[None]))
    return np.concatenate([axes.T @ b, np.einsum("kij,ij->k", GRADIENTS, axes.T @ g @ axes)])


def loss_in_own_frame(body, state, drift, lag):
    """Power (W) that is lost, from fields that a body sees 2e-7 s apart, and its loss by finite elements."""
    axes, step = body.axes(state.moment) if body.round else state.axes, 1e-7
    ends = [
        field_seen(body, state.position + s * step * drift, Rotation.from_rotvec(s * step * lag).as_matrix() @ axes)
        for s in (-1, 1)
    ]
    rates = (ends[1] - ends[0]) / (2 * step)
    return float(rates @ loss_and_delay(conducting(body))[0] @ rates * body.conductivity)


@pytest.mark.parametrize("name", FLOATERS)
def test_power_is_that_of_the_fields_that_the_body_sees(name):
    """The effect in the rotor's frame against fields in the body's: to the round-off that is left out of tensors."""
    body, drift, lag = FLOATERS[name], np.array([0.7, -0.2, 0.1]), np.array([30.0, -800.0, -490.0])
    state = state_of(body, drift, lag)
    found = wrench(scene_of(body), state) @ np.concatenate([drift, lag])
    assert -found == pytest.approx(loss_in_own_frame(body, state, drift, lag), rel=2e-4)


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("cylinder", "brick", "cube with brass") else pytest.param(name, marks=pytest.mark.slow)
        for name in FLOATERS
    ],
)
def test_force_and_torque_are_the_powers_derivatives(name):
    """The matrix of velocities is symmetric, and no direction gains."""
    body, units = FLOATERS[name], np.diag(np.repeat([1.0, 100.0], 3))
    matrix = np.array([-wrench(scene_of(body), state_of(body, *np.split(unit, 2))) for unit in units])
    matrix = matrix * np.repeat([1.0, 100.0], 3)
    np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=1e-6 * np.abs(matrix).max())
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    assert values[0] > -1e-6 * values[-1]
    assert values[1] > 0


class Uniform:
    """A field across z, T."""

    def expressions(self, position):
        zero, strength = hy.expression(0.0), hy.expression(0.1)
        return [strength, zero, zero], [[zero] * 3] * 3


@pytest.mark.parametrize("name", ["brick", "cube with brass"])
def test_torque_of_a_steady_turn_is_the_loss_by_the_rate(name):
    """In a uniform field at rest, at every angle of a turn about an axis that is none of the body's."""
    body, rate = FLOATERS[name], 300.0
    axis, field = np.array([1.0, -0.5, 2.0]) / 5.25**0.5, np.array([0.1, 0.0, 0.0])
    loss = loss_and_delay(conducting(body))[0][:3, :3] * body.conductivity
    for angle in (0.3, 1.7, 4.0):
        turned = Rotation.from_rotvec(angle * axis).as_matrix()
        state = State(np.zeros(3), np.zeros(3), turned @ body.pointing, rate * axis, turned)
        torque = wrench(scene_of(body, frequency=0.0), state, Uniform())[3:]
        change = turned.T @ -np.cross(rate * axis, field)
        assert -torque @ axis * rate == pytest.approx(change @ loss @ change, rel=5e-4)


def test_a_meshed_ball_feels_what_a_sphere_does():
    """Of copper, whose currents are late: the same force and torque, by tensors and delays of finite elements."""
    sphere = Floater(6e-3, 1.305, 1.0, 7500.0, 5.8e7)
    meshed = Floater.composed([piece(Sphere(6e-3), 5.8e7)])
    scene = scene_of(sphere)
    late = MU_0 * 5.8e7 * 6e-3**2 * scene.angular_velocity
    found = [wrench(replace(scene, floater=one), state_of(one), late=True) for one in (sphere, meshed)]
    assert late > 1.5
    for part in (slice(3), slice(3, 6)):
        assert found[1][part] == pytest.approx(found[0][part], abs=2e-3 * np.linalg.norm(found[0][part]))


HALVES = [Box((9e-3, 10e-3, 5e-3), (0.0, 0.0, height)) for height in (-2.5e-3, 2.5e-3)]
UNEVEN = {
    "half of copper": [piece(half, conductivity) for half, conductivity in zip(HALVES, (5.8e7, 0.0), strict=True)],
    "a step": [piece(Box((10e-3, 10e-3, 4e-3)), 5.8e7), piece(Box((4e-3, 10e-3, 6e-3), (3e-3, 0.0, 5e-3)), 5.8e7)],
    "round": [piece(Cylinder(5e-3, 4e-3), 5.8e7), piece(Cylinder(3e-3, 4e-3, np.array([0.0, 0.0, 4e-3])), 2e7)],
}


@pytest.mark.parametrize(
    "name", ["a step", *(pytest.param(name, marks=pytest.mark.slow) for name in ("half of copper", "round"))]
)
def test_what_is_late_in_a_body_without_a_centre_is_the_own_field_of_its_currents(name):
    """A slow turn at rest: L ü of field and gradient, with one delay for the gradient, and one for what joins the two.

    What that misses of L is within what is stated.
    """
    body, lag, small = Floater.composed(UNEVEN[name]), np.array([30.0, -800.0, -490.0]), 1e-4
    state, shape = state_of(body, np.zeros(3), lag), current_shape(body)
    axes, scene = body.axes(state.moment) if body.round else state.axes, scene_of(body)
    found = (wrench(scene, state, late=small) - wrench(scene, state)) / small

    def seen(place, turn):
        return field_seen(body, state.position + place, Rotation.from_rotvec(turn).as_matrix() @ axes)

    zero, step = np.zeros(3), 1e-5
    now, ends = seen(zero, zero), [seen(zero, sign * step * lag) for sign in (-1, 1)]
    change = (ends[0] - 2 * now + ends[1]) / step**2
    slopes = [(seen(h, zero) - seen(-h, zero)) / 2e-7 for h in 1e-7 * np.eye(3)]
    slopes = np.array(slopes + [(seen(zero, h) - seen(zero, -h)) / 2e-6 for h in 1e-6 * np.eye(3)])
    loss, _, own, _ = loss_and_delay(conducting(body))
    own, loss = (round_part(matrix) if body.round else matrix for matrix in (own, loss))
    known = own.copy()
    known[3:, 3:] = np.trace(own[3:, 3:]) / np.trace(loss[3:, 3:]) * loss[3:, 3:]
    mixed = np.sum(own[:3, 3:] * loss[:3, 3:]) / np.sum(loss[:3, 3:] ** 2) * loss[:3, 3:]
    known[:3, 3:], known[3:, :3] = mixed, mixed.T
    unit = MU_0 * body.conductivity**2
    expected, exact = (unit * slopes @ matrix @ change for matrix in (known, own))
    units, in_radii = np.repeat([1.0, body.radius], 3), np.repeat([1.0, body.radius], [3, 5])
    many = np.linalg.norm(slopes * in_radii, axis=1) * np.linalg.norm(change * in_radii)
    sizes = unit * np.trace(own[:3, :3]) / 3 * many
    print(f"\n{name}: {np.abs(found - exact) / sizes} of what a field does, stated {shape.delay_error:.3f}")
    assert found / units == pytest.approx(expected / units, abs=5e-3 * np.linalg.norm(expected / units))
    assert (np.abs(found - exact) < (shape.delay_error + 5e-3) * sizes).all()


def test_a_brick_that_turns_freely_loses_as_it_says():
    """Euler's equations with the currents in a uniform field: kinetic energy against the loss along the way."""
    body = floater(BRICK, 6.7e5)
    scene = scene_of(body, frequency=0.0)
    scales, effect = Scales.of(scene), FloaterCurrents.of(scene)
    equations = equations_of_motion(Interaction(Uniform(), (effect,), True))
    values = parameters(scene, scales)
    values[[Parameter.TORQUE, Parameter.SLOWNESS]] = 0.0  # no magnet, and no delay
    values[Parameter.GRAVITY_X : Parameter.GRAVITY_Z + 1] = 0.0
    system = list(zip(equations.variables, equations.rates, strict=True))
    integrator = hy.taylor_adaptive(system, np.zeros(13), tol=1e-16, compact_mode=True)
    integrator.pars[:] = values[: len(integrator.pars)]
    integrator.state[6:] = np.concatenate([[1.0, 0.0, 0.0, 0.0], np.array([150.0, 400.0, -250.0]) * scales.time])
    times = np.linspace(0.0, 0.05, 4001)
    states = integrator.propagate_grid(times / scales.time)[-1]
    spins, axes = states[:, 10:] / scales.time, matrices_of(states[:, 6:10])
    energy = 0.5 * spins**2 @ body.principal_inertia
    change = -np.cross(spins, axes.swapaxes(1, 2) @ np.array([0.1, 0.0, 0.0]))
    loss = loss_and_delay(conducting(body))[0][:3, :3] * body.conductivity
    power = np.einsum("ni,ij,nj->n", change, loss, change)
    lost = np.sum((power[1:] + power[:-1]) / 2 * np.diff(times))
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-3)
    assert lost > 1e-3 * energy[0]


LEVITATING = Scene(
    130.0,
    tilt(np.radians(10.0), Box((0.01,) * 3), 1.305, 1.0),
    floater(Cylinder(6.35e-3, 11e-3), 6.7e6),
    Drag(0.0, 0.0),
)
FIELD = rotor_table(LEVITATING.rotor, "dipole")


@pytest.fixture(scope="module")
def round_equilibrium():
    return find_equilibria(LEVITATING, with_effects(LEVITATING, FIELD))[0]


@pytest.mark.slow
def test_a_mode_of_a_cylinder_grows_in_a_trajectory_as_it_says(round_equilibrium):
    """Over 130 turns, with the spin about the moment held as in modes: amplitude and phase.

    About the equilibrium of the trajectory's own equations, which have the shape as a few dipoles.
    """
    whole, scales = with_effects(LEVITATING, FIELD), Scales.of(LEVITATING)
    rates, values = Rates(whole), parameters(LEVITATING, scales, frozen_spin=True)
    middle = scales.pack(round_equilibrium.state)
    for _ in range(5):
        value, slope = (part[0] for part in rates(middle[None], values))
        tangents, projections = free_directions(middle)
        middle = middle - tangents @ np.linalg.solve(projections @ slope @ tangents, projections @ value)
        middle[6:9] /= np.linalg.norm(middle[6:9])
    assert np.abs(value).max() < 1e-12
    found, right = np.linalg.eig(projections @ slope @ tangents)
    leading = int(np.argmax(found.real))
    assert found[leading].real / scales.time == pytest.approx(round_equilibrium.growth_per_s, rel=0.02)
    assert 0.1 < round_equilibrium.growth_per_s < 1.0
    flight = Flight(LEVITATING, whole, 1.0, in_balls=False)
    course = flight.begin(scales.unpack(middle), 1.0, None, flight.interval(1.0))
    integrator, held = flight.part(0).integrator, course.values.copy()
    held[Parameter.SPIN_EDDY] = 0.0
    kick, turns = 1e-6 * (tangents @ right[:, leading]).real, 2 * np.pi * 130
    integrator.pars[:], integrator.state[:] = held[: len(integrator.pars)], course.state
    integrator.state[:12] = middle + kick
    integrator.propagate_until(turns)
    left = left_eigenvectors(right)[leading] @ projections
    grown = left @ (integrator.state[:12] - middle) / (left @ kick)
    assert np.log(np.abs(grown)) == pytest.approx(found[leading].real * turns, rel=1e-4)
    assert np.angle(grown * np.exp(-1j * found[leading].imag * turns)) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.slow
def test_growth_by_the_currents_of_a_cylinder(round_equilibrium):
    """By the eigenvalues of the motion with them and without them."""
    bare = replace(LEVITATING, floater=replace(LEVITATING.floater, conductivity=None))
    alone = find_equilibria(bare, with_effects(bare, FIELD))[0]
    said = growth_by_floater(LEVITATING, FIELD, alone, False)
    assert said == pytest.approx(round_equilibrium.growth_per_s - alone.growth_per_s, rel=0.03)
    assert growth_by_floater(LEVITATING, FIELD, round_equilibrium, True) == pytest.approx(said, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(10e-3, 10e-3, 10e-3), (10.2e-3, 10e-3, 9.9e-3)])
def test_the_energy_of_a_trajectory_is_balanced(size):
    """In balls, by the currents' power as it is integrated along; that is the loss in the body's own frame, above."""
    body = floater(Box(size), 6.7e6)
    bare = replace(LEVITATING, floater=replace(body, conductivity=None))
    first = find_equilibria(bare, with_effects(bare, FIELD))[0]
    start = AbsoluteStart(*replace(first.state, velocity=first.state.velocity + np.array([0.0, 0.0, 0.01])).vectors)
    scene = replace(LEVITATING, floater=body, start=start)
    flown = simulate(scene, FIELD, 0.2)
    assert flown.energy_error < 1e-11
    assert flown.ended_by == "duration"


@pytest.mark.slow
def test_a_locked_body_has_the_currents_in_its_modes():
    """At rest in the rotor's frame there are none, so that the place stays; modes are damped or driven by them."""
    found = []
    for conductivity in (6.7e6, None):
        scene = replace(LEVITATING, floater=floater(BRICK, conductivity))
        locked = [one for one in find_equilibria(scene, with_effects(scene, FIELD)) if one.kind == LOCKED]
        found.append(min(locked, key=lambda one: one.distance))
    whole, alone = found
    assert whole.position == pytest.approx(alone.position, abs=1e-8)
    said = growth_by_floater(replace(LEVITATING, floater=floater(BRICK, 6.7e6)), FIELD, alone, False)
    assert said == pytest.approx(whole.growth_per_s - alone.growth_per_s, rel=0.05)
    assert abs(said) > 1e-6


def test_a_mean_over_turns_has_mean_tensors():
    """A brick's about its moment; the mean of its tensors, and no other where it is round already."""
    body = floater(BRICK)
    own, mean = (FloaterCurrents.of(scene_of(one)) for one in (body, body.averaged))
    whole, even = (np.sum(np.reshape(e.tensors, (-1, 3, 3)), axis=0) for e in (own, mean))
    assert even[0, 0] == even[1, 1] == pytest.approx((whole[0, 0] + whole[1, 1]) / 2, rel=1e-9)
    assert even[2, 2] == pytest.approx(whole[2, 2], rel=1e-9)
    cylinder = FLOATERS["cylinder"]
    assert FloaterCurrents.of(scene_of(cylinder)) == FloaterCurrents.of(scene_of(cylinder.averaged))


def test_what_is_too_slow_is_refused_and_what_is_named_will_do():
    """The skin depth of a ball whose currents are as slow; a thin disc may be of far better metal than a ball."""
    copper = scene_of(floater(Cylinder(12e-3, 20e-3), 5.8e7), frequency=150.0)
    with pytest.raises(InputError, match=r"in a cylinder whose currents are as slow as in a ball of 25.7. mm") as told:
        with_effects(copper, TABLE)
    most = float(str(told.value).split("at most ")[1].split(" S/m")[0])
    there = replace(copper, floater=replace(copper.floater, conductivity=most))
    assert slow_error(there) == pytest.approx(SLOW_ENOUGH, rel=0.03)
    assert FLOATER_CURRENTS in {effect.name for effect in with_effects(there, TABLE).effects}
    assert slow_error(scene_of(floater(Cylinder(12e-3, 1e-3), 5.8e7))) < slow_error(
        scene_of(floater(Cylinder(12e-3, 12e-3), 5.8e7))
    )


def test_scenes_that_differ_in_their_shape_have_other_equations():
    """By equality and text, which keys of shared equations hold."""
    one, two = (FloaterCurrents.of(scene_of(FLOATERS[name])) for name in ("brick", "cube"))
    again = FloaterCurrents.of(scene_of(floater(BRICK, 10.0), frequency=90.0))
    assert one == again
    assert one != two
    assert str(one) != str(two)
    assert one.compiled_in != two.compiled_in
    assert FloaterCurrents.of(scene_of(floater(BRICK, None))) is None
