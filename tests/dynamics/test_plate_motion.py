"""The plate in the motion: identities that hold whatever the accuracy of its table, and two ways to the same answer."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS
from scipy.integrate import solve_ivp
from second_opinions.phasor import mean_force, mean_torque
from second_opinions.plate_tables import reaction_gradient

from spinlev.dynamics.equilibria.equilibrium import LOCKED, Survey, resampled
from spinlev.dynamics.equilibria.orbits import differentiation, floquet_modes, periodic_orbit
from spinlev.dynamics.equilibria.perturbed import plate_action
from spinlev.dynamics.equilibria.search import find_equilibria, survey, with_plate
from spinlev.dynamics.flights.flight import Flight, initial_state, integrate, simulate
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.plate import PlateForce, PlateMemory
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Parameter, Scales
from spinlev.fem.plate.table import Region, RotorShare
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.meshes.plate import MeshRule
from spinlev.geometry.scene.contents import Drag, Lowering, OffsetStart, Plate, Scene
from spinlev.geometry.shapes import Box

CUBOID = RotorTable("cuboid", MAGNETS, MAGNETS)
PLATE = Plate(Box((0.1, 0.24, 0.03), (0.01, 0.0, -0.055)), 3.5e7, Lowering(0.1, 0.02, 0.002))
SCENE = Scene(110.0, MAGNETS, FLOATER, Drag(0.0, 0.0), plate=PLATE, start=OffsetStart(np.zeros(3)))
REGION = Region(np.array([-0.014, -0.004, 0.031]), np.array([-0.006, 0.004, 0.041]))
VALUES = parameters(SCENE, Scales.of(SCENE), frozen_spin=True)
INERTIA = FLOATER.inertia * np.array([1.0, 0.65, 1.25])
UNEVEN = replace(
    SCENE, floater=replace(FLOATER, moments_of_inertia=tuple(INERTIA)), plate=replace(PLATE, lowering=None)
)


@pytest.fixture(scope="module")
def memory():
    """A rough plate off the axis: its table may err by 0.3, its identities do not."""
    table, share = PlateAround(PLATE, CUBOID, REGION, (5.0, 250.0), 0.3, rule=MeshRule(3.0, 4.0, 4.0)).tables()
    return PlateMemory(PLATE, table, share)


@pytest.fixture(scope="module")
def rates():
    return Rates(CUBOID)


@pytest.fixture(scope="module")
def known(rates):
    return survey(SCENE, CUBOID, rates=rates)


@pytest.fixture(scope="module")
def shaken(known, memory, rates):
    return with_plate(SCENE, CUBOID, Survey(known.equilibria[:1], ()), memory, rates).equilibria[0]


@pytest.fixture(scope="module")
def uneven():
    """A sphere with three moments of inertia, a dipole to all, at rest in the rotor's frame, and its equations."""
    rates = Rates(Interaction(CUBOID, (), turning=True))
    found = survey(UNEVEN, CUBOID, rates=rates).equilibria
    return next(one for one in found if one.kind == LOCKED and one.distance < 20e-3), rates


def state_near(scene, equilibrium, count, size=1e-2):
    state = Scales.of(scene).pack(equilibrium.state)
    return state + size * np.random.default_rng(3).normal(size=(count, len(state)))


@pytest.mark.parametrize("turning", [False, True])
def test_derivatives_of_the_plates_forces(turning, memory, known, uneven):
    """Central differences, good to 1e-9 of the largest derivative; of a body's quaternion, too."""
    scene, near = (UNEVEN, uneven[0]) if turning else (SCENE, known.equilibria[0])
    force, rng = PlateForce(memory, parameters(scene, Scales.of(scene))), np.random.default_rng(0)
    times, states = np.array([0.3, 4.0]), state_near(scene, near, 2)
    currents, way, step = rng.normal(size=(2, len(memory.table.rates))), rng.normal(size=states.shape), 1e-5
    heard, ahead, behind = (force(times, states + s * way) for s in (0, step, -step))
    slope = (ahead.signals - behind.signals) / (2 * step)
    assert np.abs(slope - np.einsum("nix,nx->ni", heard.by_state, way)).max() < 1e-9 * np.abs(heard.by_state).max()
    slope = np.einsum("nix,ni->nx", ahead.fields - behind.fields, currents) / (2 * step)
    pull = np.einsum("nkyx,nk,ny->nx", heard.pull, force.strengths(currents), way)
    assert np.abs(slope - pull).max() < 1e-8 * np.abs(pull).max()


def test_steady_drag_lift_and_torque_are_those_of_the_frequency_domain(memory, known):
    """A moment that turns in one place, without the rotor's share: mean force and torque of the phasors, 1e-10."""
    alone = replace(memory, share=RotorShare(0.0, np.zeros((1, len(memory.table.rates), 1)), 0.0))
    scales, force = Scales.of(SCENE), PlateForce(alone, VALUES)
    place = np.array([0.0, 0.0, -0.0195])
    moment = np.array([np.sin(0.4), 0.0, np.cos(0.4)])
    state, times = np.zeros(12), 2 * np.pi * np.arange(33) / 33
    state[:3], state[6:9] = place / scales.length, moment
    heard = force(times, np.tile(state, (33, 1)))
    currents = np.einsum("iab,bi->ai", force.remembered(33), heard.signals) - heard.signals
    push = np.einsum("nix,ni->nx", heard.fields, currents).mean(axis=0)
    found_force = push[2] * FLOATER.mass * scales.length / scales.time**2
    found_torque = push[5] * FLOATER.inertia / scales.time**2
    body, turning = PLATE.box.to_body(place), FLOATER.moment * np.sin(0.4) * np.array([1, -1j, 0])
    tensor = memory.table.reaction_tensor(body, SCENE.frequency)[0]
    gradient = reaction_gradient(memory.table, body, SCENE.frequency)[0]
    assert found_torque == pytest.approx(mean_torque(tensor, turning)[2], rel=1e-10)
    assert found_force == pytest.approx(mean_force(gradient, turning)[2], rel=1e-10)
    settled = force.settled(state)
    np.testing.assert_allclose(settled - heard.signals[0], currents[0], atol=1e-12 * np.abs(currents).max())


def test_equilibrium_with_a_plate_is_a_periodic_motion(shaken, memory):
    """Flown for twenty turns it comes back to itself after each, to round-off, and the ledger closes."""
    assert shaken.currents is not None
    scene = replace(SCENE, plate=replace(PLATE, lowering=None))
    flight = Flight(scene, CUBOID, 0.2, compact=True, memory=memory)
    flight.values[: len(VALUES)] = VALUES
    flown = integrate(flight, shaken.start, 20 / scene.frequency, currents=shaken.currents[0])
    turns = np.isclose(flown.time * scene.frequency, np.round(flown.time * scene.frequency), atol=1e-7)
    assert turns.sum() == 21
    assert np.abs(flown.rotor.position[turns] - shaken.start.position).max() < 1e-11
    assert np.ptp(flown.rotor.position[:, 0]) > 1e-5  # the plate does shake it
    assert flown.energy_error < 1e-11


def test_ledger_closes_while_the_plate_goes_down(shaken, memory):
    """Work = change of energy + loss in the plate, in free motion after a kick, with the plate lowered meanwhile."""
    start = replace(shaken.start, velocity=shaken.start.velocity + np.array([0.01, 0.02, 0.0]))
    flight = Flight(SCENE, CUBOID, 0.3, compact=True, memory=memory)
    flown = integrate(flight, start, 0.3, currents=shaken.currents[0])
    assert flown.ended_by == "duration"
    assert flown.energy_error < 1e-10


def test_flight_over_a_sinking_plate_equals_another_integrator(shaken, memory, rates):
    """Two turns from a kick, of floater and plate by an eighth-order method: the same to 1e-11 m.

    There the states are p themselves, with all of the rotor's share in their equations.
    """
    plate = replace(PLATE, lowering=Lowering(0.0, 0.1, 0.002))
    scene, scales, n = replace(SCENE, plate=plate), Scales.of(SCENE), len(memory.table.rates)
    values = parameters(scene, scales)
    start = replace(shaken.start, velocity=shaken.start.velocity + np.array([0.01, 0.02, 0.03]))

    def slope(time, state):
        here = values.copy()
        here[Parameter.PLATE_DEPTH] = 0.1 * time * scales.time / scales.length
        force = PlateForce(replace(memory, plate=plate), here)
        heard = force(np.array([time]), state[None, :12])
        currents = state[12:] - heard.signals[0]
        floater = rates(state[None, :12], here)[0][0]
        push = heard.fields[0].T @ currents
        return np.concatenate([floater[:3], floater[3:6] + push[:3], floater[6:9], floater[9:] + push[3:],
                               -force.rates * currents])  # fmt: skip

    currents, duration = shaken.currents[0], 2 / scene.frequency
    first = np.concatenate([scales.pack(start), currents * values[Parameter.PLATE_SHARE]])
    end = solve_ivp(slope, (0, duration / scales.time), first, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    flight = Flight(scene, CUBOID, duration, compact=True, memory=replace(memory, plate=plate))
    flown = integrate(flight, start, duration, currents=currents)
    assert n > 5
    assert np.abs(flown.rotor.position[-1] - scales.unpack(end[:12]).position).max() < 1e-11


def test_multipliers_are_the_growth_of_a_kicked_flight(shaken, memory, rates):
    """One turn of a small kick, by the integrator, against Floquet's modes: 1e-6 of the kick."""
    scene, scales = replace(SCENE, plate=replace(PLATE, lowering=None)), Scales.of(SCENE)
    orbit = periodic_orbit(rates, VALUES, 0.0, PlateForce(memory, VALUES), scales.pack(shaken.state))
    modes = floquet_modes(orbit)
    flight = Flight(scene, CUBOID, 0.2, compact=True, memory=memory)
    integrator, currents = flight.part(0).integrator, orbit.plate[0] / VALUES[Parameter.PLATE_SHARE]
    middle = flight.begin(scales.unpack(orbit.states[0]), 0.2, currents).state

    def after_one_turn(state):
        integrator.time, integrator.state[:] = 0.0, state
        integrator.pars[:] = flight.values[: len(integrator.pars)]
        integrator.propagate_until(2 * np.pi)
        return integrator.state.copy()

    size, step = len(middle) - 1, 1e-6
    turn = np.array(
        [(after_one_turn(middle + step * unit) - after_one_turn(middle - step * unit))[:-1] / (2 * step)
         for unit in np.eye(size + 1)[:-1]]
    ).T  # fmt: skip
    multipliers = np.linalg.eigvals(turn)
    for rate in modes.eigenvalues:
        assert np.abs(multipliers - np.exp(2 * np.pi * rate)).min() < 1e-6
    assert shaken.growth_per_s == pytest.approx(modes.growth / scales.time, abs=1e-6)


def test_the_stated_error_of_growth_is_that_of_the_steps(shaken, memory, rates, monkeypatch):
    """Against eight times as many steps: never less, and for no mode a thousand times too much where steps decide."""
    force = PlateForce(memory, VALUES)
    orbit = periodic_orbit(rates, VALUES, 0.0, force, Scales.of(SCENE).pack(shaken.state))
    modes = floquet_modes(orbit)
    monkeypatch.setattr("spinlev.dynamics.equilibria.orbits.STEPS", 192)
    exact = floquet_modes(orbit)
    for rate, error in zip(modes.eigenvalues, modes.errors, strict=True):
        assert np.abs(exact.eigenvalues - rate).min() < error
    assert 1e-11 < modes.errors.max() < 1e-8
    assert exact.errors.max() < 1e-3 * modes.errors.max()


def test_without_a_plate_multipliers_are_the_eigenvalues(known, rates):
    """Where nothing shakes, both say the same: 1e-6 of the rotor's rate, frequencies beyond it included."""
    for equilibrium in known.equilibria[:2]:
        orbit = periodic_orbit(rates, VALUES, 0.0, None, Scales.of(SCENE).pack(equilibrium.state))
        modes = floquet_modes(orbit)
        assert modes.growth / Scales.of(SCENE).time == pytest.approx(equilibrium.growth_per_s, abs=1e-5)
        found = modes.angular_frequencies / (2 * np.pi * Scales.of(SCENE).time)
        np.testing.assert_allclose(found, equilibrium.frequencies_hz, rtol=1e-6)


def test_over_an_infinite_slab_multipliers_are_the_eigenvalues_of_the_turning_frame(known, rates):
    """A slab looks the same from every angle: the motion is steady; the plate's states turn as pairs cos mφ, sin mφ.

    In the rotor's frame everything is then autonomous; its eigenvalues are Floquet's to 1e-6 of the rotor's rate.
    """
    plate = replace(PLATE, lowering=None)
    table, share = PlateAround(plate, CUBOID, REGION, rtol=1e-2, slab=True).tables()
    force = PlateForce(PlateMemory(plate, table, share, "slab"), VALUES)
    orbit = periodic_orbit(rates, VALUES, 0.0, force, Scales.of(SCENE).pack(known.equilibria[0].state))
    assert np.ptp(orbit.states, axis=0).max() < 1e-9
    assert np.abs(orbit.states[0] - Scales.of(SCENE).pack(known.equilibria[0].state)).max() > 1e-3
    matrix, kinds = orbit.derivatives[0].copy(), table.multipoles.kinds.astype(int)
    used = [kinds[np.abs(row) > 0] for row in table.weights]
    orders = np.array([kind[0, 1] for kind in used])
    assert all((kind[:, 1] == m).all() for kind, m in zip(used, orders, strict=True))
    for m in range(1, orders.max() + 1):
        cosines, sines = np.split(12 + np.flatnonzero(orders == m), 2)
        matrix[cosines, sines] += m
        matrix[sines, cosines] -= m
    exact = np.linalg.eigvals(matrix)
    for rate in floquet_modes(orbit).eigenvalues:
        assert np.abs(exact - rate).min() < 1e-6


def test_what_the_plate_burns_comes_from_the_turn(known, rates):
    """Without the rotor's share the loss is the plate's torque about the rotor's axis times its rate: 1e-9."""
    plate, scales = replace(PLATE, lowering=None), Scales.of(SCENE)
    table, share = PlateAround(plate, CUBOID, REGION, rtol=1e-2, slab=True).tables()
    alone = PlateMemory(plate, table, replace(share, series=0 * share.series), "slab")
    found = with_plate(SCENE, CUBOID, Survey(known.equilibria[:1], ()), alone, rates).equilibria[0]
    action = plate_action(SCENE, alone, found)
    force = PlateForce(alone, VALUES)
    heard = force(np.zeros(1), scales.pack(found.start)[None])
    currents = found.currents[0] * VALUES[Parameter.PLATE_SHARE] - heard.signals[0]
    push = heard.fields[0].T @ currents * FLOATER.mass * scales.length / scales.time**2
    orbit = np.cross(found.position, push[:3])[2]  # the force drags the floater's orbit as well
    assert action["torque"][2] < 0
    assert action["force"][2] > 0
    assert action["loss"] == pytest.approx(-SCENE.angular_velocity * (action["torque"][2] + orbit), rel=1e-9)
    with pytest.raises(ValueError, match="found with the plate"):
        plate_action(SCENE, alone, known.equilibria[0])


def test_gravity_across_the_axis_makes_the_motion_periodic(rates):
    """Gravity tilted by 2°: the periodic motion that the equilibrium becomes is one of the full simulation."""
    tilted = 9.81 * np.array([np.sin(0.035), 0.0, -np.cos(0.035)])
    scene = replace(SCENE, plate=None, gravity=tilted)
    found = find_equilibria(scene, CUBOID, rates=rates)[0]
    assert found.stable
    assert found.turn is not None
    flight = Flight(scene, CUBOID, 0.2, compact=True)
    flown = integrate(flight, found.start, 10 / scene.frequency)
    turns = np.isclose(flown.time * scene.frequency, np.round(flown.time * scene.frequency), atol=1e-7)
    assert np.abs(flown.rotor.position[turns] - found.start.position).max() < 1e-10
    lab = flown.lab.position.mean(axis=0)
    assert lab[0] > 5e-5  # it hangs towards where gravity points: 0.34 m/s² against some 10 Hz


@pytest.mark.slow
def test_gravity_across_the_axis_shakes_a_locked_body(uneven):
    """Back to itself after each of five turns in which deviations grow 600 times; half the gravity moves it half."""
    ways = []
    for tilt in (0.035, 0.0175):
        scene = replace(UNEVEN, plate=None, gravity=9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)]))
        survey = find_equilibria(scene, CUBOID, rates=uneven[1])
        found = next(one for one in survey if one.kind == LOCKED and 18e-3 < one.distance < 20e-3)
        ways.append(found.turn.position - found.without.position)
    assert np.abs(ways[0]).max() > 1e-5
    assert np.abs(ways[0] - 2 * ways[1]).max() < 0.02 * np.abs(ways[0]).max()
    flown = integrate(Flight(scene, CUBOID, 0.2, compact=True), found.start, 5 / scene.frequency)
    assert np.abs(flown.rotor.position[::200] - found.start.position).max() < 1e-10


def test_a_flight_begins_on_the_orbit(known, memory, shaken):
    flown = simulate(SCENE, CUBOID, 0.02, [shaken], memory=memory)
    np.testing.assert_allclose(flown.lab.position[0], shaken.start.position, atol=1e-15)
    assert flown.beyond_plate_table == 0
    assert flown.energy_error < 1e-9


def test_trigonometric_interpolation():
    times = 2 * np.pi * np.arange(9) / 9
    wave = np.cos(3 * times) + 0.2 * np.sin(times)
    np.testing.assert_allclose(differentiation(9) @ wave, -3 * np.sin(3 * times) + 0.2 * np.cos(times), atol=1e-13)
    finer = 2 * np.pi * np.arange(17) / 17
    np.testing.assert_allclose(resampled(wave, 17), np.cos(3 * finer) + 0.2 * np.sin(finer), atol=1e-14)
    assert VALUES[Parameter.SPIN_DRAG] == 0


def test_a_locked_body_over_a_plate_is_a_periodic_motion(uneven, memory):
    """Flown for ten turns it comes back to itself after each, and a small kick grows by the stated growth.

    The flight has the plate's force and the body's turn by other expressions.
    """
    alone, rates = uneven
    (found,) = with_plate(UNEVEN, CUBOID, Survey((alone,), ()), memory, rates).equilibria
    assert found.kind == LOCKED
    assert found.currents is not None
    assert np.ptp(found.turn.position[:, 2]) > 1e-7  # the plate does shake it
    assert np.linalg.norm(found.position - alone.position) > 1e-5
    assert abs(found.growth_per_s / alone.growth_per_s - 1) > 5e-3
    flight, turns = Flight(UNEVEN, CUBOID, 0.1, compact=True, memory=memory), 10

    def flown(start):
        motion = integrate(flight, start, turns / UNEVEN.frequency, currents=found.currents[0])
        assert motion.energy_error < 1e-11
        return motion.rotor.position[:: len(motion.time) // turns]

    start = found.start
    still = flown(start)
    assert len(still) == turns + 1
    assert np.abs(still - start.position).max() < 1e-10
    apart = flown(replace(start, position=start.position + np.array([0.0, 0.0, 1e-11]))) - still
    # of a pair of multipliers: each deviation follows from the two before it
    sums, product = np.linalg.lstsq(np.stack([apart[-2], -apart[-3]], axis=1), apart[-1])[0]
    assert sums**2 < 4 * product
    assert np.log(product) / 2 * UNEVEN.frequency == pytest.approx(found.growth_per_s, rel=2e-3)
    action = plate_action(UNEVEN, memory, found)
    assert action["loss"] > 0
    begun, currents = initial_state(
        replace(UNEVEN, start=OffsetStart(np.zeros(3))), CUBOID, [replace(found, stable=True)]
    )
    np.testing.assert_allclose(begun.axes, start.axes, atol=1e-15)
    np.testing.assert_array_equal(currents, found.currents[0])


@pytest.mark.slow
def test_a_locked_body_as_even_as_a_sphere_moves_as_the_sphere(memory, rates):
    """Place, moment and modes of a body whose inertia differs by 1e-8 are those of the round body's orbit over a plate.

    That one has the body spin with which it comes back to itself after a turn.
    """
    inertia = FLOATER.inertia * np.array([1.0, 1 + 1e-8, 1.0])
    scene = replace(UNEVEN, floater=replace(FLOATER, remanence=0.03, moments_of_inertia=tuple(inertia)))
    found = next(one for one in find_equilibria(scene, CUBOID, memory=memory) if one.kind == LOCKED)
    assert np.linalg.norm(found.position - found.without.position) > 1e-5
    assert np.ptp(found.turn.position[:, 2]) > 1e-9
    along = np.sum(found.turn.spin * found.turn.moment, axis=1) / scene.angular_velocity
    assert np.ptp(along) < 1e-7
    scales, values = Scales.of(scene), parameters(scene, Scales.of(scene))
    states, force = replace(scales, pointing=None).pack(found.turn), PlateForce(memory, values)
    orbit = periodic_orbit(rates, values, along[0], force, states)
    assert np.abs(orbit.states - states).max() < 1e-8
    whole = periodic_orbit(Rates(Interaction(CUBOID, (), turning=True)), values, 0.0, force, scales.pack(found.turn))
    of_body, of_sphere = (np.exp(2 * np.pi * floquet_modes(one).eigenvalues) for one in (whole, orbit))
    assert max(np.abs(of_body - one).min() for one in of_sphere) < 1e-8  # it has a turn about its moment beside them
