"""The rotor's frequency in time: laboratory equations of another integrator, the motor's ledger, and steady drives."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS, NO_DRAG
from scipy.integrate import quad, solve_ivp

from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.batch import simulate_together
from spinlev.dynamics.flights.flight import Flight, initial_state, integrate, simulate
from spinlev.dynamics.flights.live import LiveFlight
from spinlev.dynamics.flights.trajectory import Checkpoint, FlightStopped
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.floater_effects import slow_error
from spinlev.dynamics.motion.rotor_effects import RotorCurrents
from spinlev.dynamics.motion.state import turned_about_z
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor_metal import ball_losses, pieces_of
from spinlev.geometry.common import MAGNET_CONDUCTIVITY, MU_0
from spinlev.geometry.scene.contents import Drag, DriveStep, OffsetStart, Scene
from spinlev.geometry.scene.files import scene as make_scene, scene_keys

TABLE = rotor_table(MAGNETS, "dipole")
STEPS = DriveStep(100.0, 0.05), DriveStep(None, 0.02), DriveStep(140.0, 0.03)
DOWN = Scene(120.0, MAGNETS, FLOATER, Drag(2.2e-6, 1.2e-10), np.array([0.3, -0.2, -9.8]), drive=STEPS)
STEADY = replace(DOWN, gravity=np.array([0.0, 0.0, -9.81]), drive=())
START = initial_state(STEADY, TABLE)[0]
KICK, TURN = np.array([0.02, -0.01, 0.03]), np.array([4.0, 3.0, 20.0])
START = replace(START, velocity=START.velocity + KICK, spin=START.spin + TURN)


def laboratory(scene, rates):
    """Rates of place, velocity, moment, spin, angular momentum and work of the motor, nothing of which turns."""
    floater = scene.floater

    def rate(time, y):
        place, velocity, moment, spin = y[:12].reshape(4, 3)
        omega, angle = rates(time)
        field, gradient = (v[0] for v in TABLE.evaluate(turned_about_z(place, -angle)[None]))
        axes = turned_about_z(np.eye(3), angle).T
        field, gradient = axes @ field, axes @ gradient @ axes.T
        force = floater.moment * moment @ gradient
        torque = floater.moment * np.cross(moment, field)
        motor = np.cross(place, force)[2] + torque[2]
        push = (force - scene.drag.linear * velocity) / floater.mass + scene.gravity
        turn = (torque - scene.drag.angular * spin) / floater.inertia
        return [*velocity, *push, *np.cross(spin, moment), *turn, motor, omega * motor]

    return rate


def test_motion_and_motor_are_those_of_the_laboratory():
    """Another integrator, another frame, and the frequency by hand; 12 turns, SciPy's error is 1e-11."""
    knots = 2 * np.pi * np.array([120.0, 100.0, 100.0, 140.0, 140.0])
    times = np.array([0.0, 0.05, 0.07, 0.10, 0.12])

    def turn(time):
        return float(np.interp(time, times, knots))

    def rates(time):
        # a trapezoid is exact on each stretch
        ends = np.append(times[times < time], time)
        return turn(time), float(np.trapezoid([turn(end) for end in ends], ends))

    flown = integrate(Flight(DOWN, TABLE, 0.12), START, 0.12)
    begin = np.concatenate([*START.vectors, [0.0, 0.0]])
    ends = solve_ivp(laboratory(DOWN, rates), (0.0, 0.12), begin, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    found = np.concatenate([*(v[-1] for v in flown.lab.vectors), flown.given[-1]])
    np.testing.assert_allclose(found[:12], ends[:12], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found[12:], ends[12:], rtol=1e-7)
    assert flown.ended_by == "duration"
    assert flown.energy_error < 1e-13


def test_angle_is_the_integral_of_the_rate():
    for time in (0.0, 0.03, 0.05, 0.06, 0.09, 0.3):
        whole = quad(lambda t: float(DOWN.rate(t)), 0.0, time, points=[0.05, 0.07, 0.1], epsabs=1e-13)[0]
        assert DOWN.angle(time) == pytest.approx(whole, abs=1e-10)
    assert DOWN.rate(1.0) == pytest.approx(2 * np.pi * 140.0)
    assert DOWN.fastest == 140.0


def assert_given_momentum(flown):
    """Angular momentum about the axis has changed by what the motor gave."""
    orbit = FLOATER.mass * np.cross(flown.lab.position, flown.lab.velocity)[:, 2]
    momentum = orbit + FLOATER.inertia * flown.lab.spin[:, 2]
    assert np.abs(momentum - momentum[0] - flown.given[:, 0]).max() < 1e-12 * np.abs(momentum).max()


def test_the_motor_gives_the_floater_its_angular_momentum():
    """Without air, plate and sideways gravity nothing else has a torque about the axis: round-off."""
    scene = replace(DOWN, drag=NO_DRAG, gravity=np.array([0.0, 0.0, -9.81]))
    flown = integrate(Flight(scene, TABLE, 0.12), START, 0.12)
    assert_given_momentum(flown)
    energy = [
        FLOATER.mass * (np.sum(state.velocity**2) / 2 + 9.81 * state.position[2])
        + FLOATER.inertia * np.sum(state.spin**2) / 2
        - FLOATER.moment * state.moment @ TABLE.evaluate(state.position[None])[0][0]
        for state in (flown.rotor[0], flown.rotor[-1])
    ]
    assert energy[1] - energy[0] == pytest.approx(flown.given[-1, 1], rel=1e-9)
    mean = np.average(flown.motor[1:], axis=0, weights=np.diff(flown.time))
    np.testing.assert_allclose(mean * flown.time[-1], flown.given[-1], rtol=1e-12)


def test_currents_in_rotor_and_floater_take_it_from_the_motor():
    """What turns with the rotor acts on the floater through the motor: angular momentum to round-off."""
    conducting = tuple(replace(magnet, conductivity=MAGNET_CONDUCTIVITY) for magnet in MAGNETS)
    whole = Interaction(TABLE, (RotorCurrents(ball_losses(pieces_of(conducting, ()), degree=2)),))
    floater = replace(FLOATER, conductivity=MAGNET_CONDUCTIVITY)
    scene = replace(STEADY, drag=NO_DRAG, floater=floater, drive=STEPS)
    flown = integrate(Flight(scene, whole, 0.2), START, 0.2)
    assert_given_momentum(flown)
    assert flown.energy_error < 1e-12


def test_a_cuboid_takes_its_angular_momentum_from_the_motor():
    """A body of three moments of inertia, by its own attitude: orbit and swirl, to round-off."""
    keys = scene_keys(replace(STEADY, drag=NO_DRAG, drive=STEPS))
    keys["floater"] = {"shape": "cuboid", "size_mm": [9.0, 10.0, 11.0], "remanence_T": 1.305, "density_kg_m3": 7500.0}
    spin = (START.spin / (2 * np.pi)).tolist()
    keys["start"] = {"position_mm": [0.5, 0.0, -23.0], "moment": START.moment.tolist(), "spin_hz": spin}
    scene = make_scene(**keys)
    flown, floater = simulate(scene, TABLE, 0.12), scene.floater
    axes = flown.lab.axes
    swirl = np.einsum("nik,k,nlk,nl->ni", axes, floater.principal_inertia, axes, flown.lab.spin)[:, 2]
    momentum = swirl + floater.mass * np.cross(flown.lab.position, flown.lab.velocity)[:, 2]
    assert np.abs(momentum - momentum[0] - flown.given[:, 0]).max() < 1e-12 * np.abs(momentum).max()
    assert np.abs(flown.given[:, 0]).max() > 1e-3 * np.abs(momentum).max()


def test_currents_in_the_floater_follow_a_ramp():
    """A mode of delay τ = μ0σR²/π² behind a ramp of 1 Hz/s errs by ω̇τ²: 7.4e-11 for the article's floater."""
    scene = replace(STEADY, floater=replace(FLOATER, conductivity=MAGNET_CONDUCTIVITY))
    ramp = replace(scene, drive=(DriveStep(scene.frequency - 1.0, 1.0),))
    delay = MU_0 * MAGNET_CONDUCTIVITY * FLOATER.radius**2 / np.pi**2
    assert slow_error(ramp) - slow_error(scene) == pytest.approx(2 * np.pi * delay**2, rel=1e-4)
    assert 2 * np.pi * delay**2 == pytest.approx(7.4e-11, rel=0.02)


@pytest.mark.parametrize("tilted", [False, True])
def test_a_drive_that_holds_is_none(tilted):
    """The driven equations at a steady rate are the steady ones, also in the air and with currents in the floater."""
    floater = replace(FLOATER, conductivity=MAGNET_CONDUCTIVITY)
    gravity = np.array([0.3 * tilted, 0.0, -9.8])
    still = replace(DOWN, floater=floater, drag=replace(Drag.of(floater), air=True), gravity=gravity, drive=())
    held = replace(still, drive=(DriveStep(None, 0.1), DriveStep(120.0, 0.1)))
    one, two = (integrate(Flight(scene, TABLE, 0.3), START, 0.3) for scene in (still, held))
    assert np.abs(one.lab.position - two.lab.position).max() < 1e-11
    assert one.given is None
    assert two.motor[:, 1] == pytest.approx(still.angular_velocity * two.motor[:, 0])


def test_down_to_rest_and_up_from_it():
    """In air, whose torque has a root of the rate: a rotor that rests is an ordinary instant."""
    drive = DriveStep(0.0, 0.1), DriveStep(None, 0.02), DriveStep(120.0, 0.1)
    scene = replace(DOWN, drag=replace(Drag.of(FLOATER), air=True), gravity=np.zeros(3), drive=drive)
    far = replace(START, position=np.array([0.0, 0.0, -0.06]), velocity=np.zeros(3))
    flown = integrate(Flight(scene, TABLE, 0.25), far, 0.25)
    assert flown.ended_by == "duration"
    assert flown.energy_error < 1e-12
    assert flown.steps < 2000
    rest = (flown.time > 0.1) & (flown.time < 0.12)
    assert np.ptp(flown.angle[rest]) == 0.0


def test_side_by_side_as_one_by_one():
    """Drives in SIMD lanes and in balls, the second of which is another one."""
    scenes = [replace(DOWN, drive=STEPS), replace(DOWN, drive=(DriveStep(90.0, 0.1),))]
    flown = simulate_together(scenes, TABLE, [START, START], 0.2)
    for scene, one in zip(scenes, flown, strict=True):
        alone = integrate(Flight(scene, TABLE, 0.2, in_balls=True), START, 0.2)
        assert one.ended_by == alone.ended_by
        assert len(one.time) == len(alone.time)
        np.testing.assert_allclose(one.lab.position, alone.lab.position, atol=1e-10)
        np.testing.assert_allclose(one.given, alone.given, rtol=1e-6, atol=1e-6 * np.abs(alone.given).max())


def test_a_live_motion_follows_the_drive():
    """Piece by piece as in one; put elsewhere, the floater turns as fast as the rotor does then."""
    scene = replace(STEADY, drive=STEPS, start=OffsetStart(np.zeros(3)))
    live = LiveFlight(scene, TABLE, find_equilibria(scene, TABLE))
    pieces = [live.onward(0.03) for _ in range(3)]
    whole = simulate(scene, TABLE, 0.09)
    assert pieces[-1].angle == pytest.approx(float(scene.angle(0.09)))
    np.testing.assert_allclose(pieces[-1].lab.position[-1], whole.lab.position[-1], atol=1e-9)
    live.put(np.array([1e-3, 0.0, -19e-3]))
    np.testing.assert_allclose(live.now.velocity, np.cross([0.0, 0.0, scene.rate(0.09)], live.now.position), atol=1e-9)


def test_begins_at_the_equilibrium_of_the_first_frequency():
    scene = replace(DOWN, frequency=130.0, gravity=np.array([0.0, 0.0, -9.81]), drag=NO_DRAG, drive=STEPS)
    flown = simulate(scene, TABLE, 0.01)
    steady = simulate(replace(scene, drive=()), TABLE, 0.01)
    np.testing.assert_allclose(flown.lab.position[0], steady.lab.position[0], rtol=1e-12)


def test_an_interrupted_motion_goes_on_to_the_last_bit(tmp_path):
    """In the middle of a ramp: the checkpoint has the leg, and what the motor gave."""
    scene = replace(STEADY, drive=(DriveStep(105.0, 1.6),), start=OffsetStart(np.zeros(3)))
    whole, kept = simulate(scene, TABLE, 2.0), Checkpoint(tmp_path / "kept.npz", "this one", every=0.0)
    begun = list[float]()

    def stop(part):
        begun.append(part)
        if part > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(FlightStopped):
        simulate(scene, TABLE, 2.0, progress=stop, checkpoint=kept)
    assert 0.5 < begun[-1] < 0.8
    resumed = simulate(scene, TABLE, 2.0, checkpoint=kept)
    assert np.array_equal(resumed.lab.position[-1], whole.lab.position[-1])
    assert np.array_equal(resumed.given[-1], whole.given[-1])
