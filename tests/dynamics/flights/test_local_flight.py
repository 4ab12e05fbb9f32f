"""Flights through small balls: the field in a ball, agreement with the table's own flight, the ledger of changes."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from article import MAGNETS, SCENE

from spinlev.dynamics.flights.balls import ERROR
from spinlev.dynamics.flights.flight import Flight, initial_state, integrate, simulate
from spinlev.dynamics.flights.trajectory import Checkpoint, FlightStopped
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.harmonics.interior import Ball, BallField
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.scene.contents import AbsoluteStart, Lowering, Plate
from spinlev.geometry.shapes import Box

TABLE = RotorTable("moments", MAGNETS, (), tuple(uniform_moments(m, 21) for m in MAGNETS))


@pytest.fixture(scope="module")
def start():
    return initial_state(SCENE, TABLE)[0]


def kicked(start):
    """So that it leaves its small ball."""
    return replace(start, velocity=start.velocity + np.array([0.05, 0.03, 0.12]))


def both(start, duration, scene=SCENE):
    """The flight in balls and the one in the table's own field."""
    flights = (Flight(scene, TABLE, duration, compact=True, in_balls=balls) for balls in (True, False))
    return [integrate(flight, start, duration) for flight in flights]


@pytest.mark.parametrize("degree", [7, 9])
@pytest.mark.parametrize("place", [(0.5e-3, 0.0, -19.6e-3), (2e-3, 1e-3, -13e-3)])
def test_a_ball_misses_no_more_than_it_says(degree, place):
    """Inside, against the table; what is missed is harmonic, so that the surface has the largest error."""
    formula, ball = BallField(0, degree), Ball(np.array(place), 0.7e-3)
    values, error = formula.fit(TABLE.evaluate, ball)
    position = hy.make_vars("x", "y", "z")
    field, gradient = formula.expressions(position)
    compiled = hy.cfunc([*field, *(e for row in gradient for e in row)], position, compact_mode=True, opt_level=0)
    generator = np.random.default_rng(0)
    points = generator.normal(size=(200, 3))
    points *= (generator.uniform(size=200) / np.linalg.norm(points, axis=1))[:, None]
    points = ball.center + ball.radius * points
    found = compiled(np.ascontiguousarray(points.T), pars=np.tile(values[:, None], 200))
    exact, slopes = TABLE.evaluate(points)
    apart = np.linalg.norm(found[:3].T - exact, axis=1), np.linalg.norm(found[3:].T - slopes.reshape(-1, 9), axis=1)
    sizes = np.linalg.norm(exact, axis=1).mean(), np.linalg.norm(slopes, axis=(1, 2)).mean()
    assert max(a.max() / s for a, s in zip(apart, sizes, strict=True)) < 1.2 * error < 1e-4
    tensor = found[3:].reshape(3, 3, -1)
    np.testing.assert_array_equal(tensor, tensor.swapaxes(0, 1))
    assert np.abs(np.trace(tensor)).max() < 1e-14 * np.abs(tensor).max()


@pytest.mark.slow
def test_a_resting_floater_stays_in_one_ball_and_flies_as_in_the_table(start):
    near, whole = both(start, 1.0)
    assert near.field_changes.count == 0
    assert 0 < near.field_changes.error <= ERROR
    assert near.energy_error < 1e-13
    assert np.abs(near.lab.position - whole.lab.position).max() < 1e-9


@pytest.mark.slow
def test_a_kicked_floater_changes_its_ball_and_the_ledger_says_so(start):
    """The table's own Jacobi integral drifts by the sum of the changes, but for the balls' error at the two ends."""
    flown, whole = both(kicked(start), 1.0)
    changes = flown.field_changes
    assert changes.count >= 1
    assert abs(changes.energy) <= changes.total < 1e-6
    assert flown.energy_error < 1e-12
    assert np.abs(flown.lab.position - whole.lab.position).max() < 1e-6
    compiled = Flight(SCENE, TABLE, 1.0, compact=True, in_balls=False)
    packed = compiled.scales.pack(flown.rotor)
    states = np.concatenate([packed, np.zeros((len(packed), 1))], axis=1)
    sums = compiled.jacobi(compiled.values, flown.time / compiled.scales.time, states).sum(axis=0)
    assert (sums[-1] - sums[0]) / abs(sums[0]) == pytest.approx(changes.energy, abs=3e-8)


def test_a_ball_holds_the_circle_of_a_floater_that_was_displaced(start):
    """Let go at rest in the turning frame, it flies off in the laboratory's; the table's own field is never needed."""
    offset = np.array([1e-4, 0.0, 0.0])
    turning = np.cross([0.0, 0.0, SCENE.angular_velocity], offset)
    flight = Flight(SCENE, TABLE, 0.5, compact=True)
    begun = replace(start, position=start.position + offset, velocity=start.velocity + turning)
    flown = integrate(flight, begun, 0.5)
    assert np.ptp(flown.rotor.position[:, 0]) > 5e-4
    assert 1 <= flown.field_changes.count <= 3
    assert list(flight.parts) == [7, 9]


def test_a_floater_that_swings_wider_than_any_ball_is_in_several_a_turn(start):
    """Its circle has 3.5 mm; the table's own field is not needed, and the jumps from ball to ball add up to no more."""
    offset = np.array([3e-4, 0.0, 0.0])
    turning = np.cross([0.0, 0.0, SCENE.angular_velocity], offset)
    begun = replace(start, position=start.position + offset, velocity=start.velocity + turning)
    near, whole = both(begun, 0.5)
    assert np.hypot(*near.lab.position[:, :2].T).max() > 3e-3
    assert near.field_changes.count > 50
    assert near.energy_error < 1e-12
    assert abs(near.field_changes.energy) < 1e-5
    assert np.abs(near.lab.position - whole.lab.position).max() < 1e-6


def test_contact_is_that_of_the_tables_own_flight():
    """Drawn to the magnet; near it there is no room for a ball, and the table's own field takes over."""
    place, turning = np.array([2e-3, 0.0, -16e-3]), np.array([0.0, 0.0, SCENE.angular_velocity])
    drawn = AbsoluteStart(place, np.cross(turning, place), np.array([-1.0, 0.0, 0.0]), turning)
    scene = replace(SCENE, start=drawn)
    flown, whole = both(initial_state(scene, TABLE)[0], 1.0, scene)
    assert flown.ended_by == whole.ended_by == "contact"
    assert flown.field_changes.count >= 1
    assert flown.levitated_s == pytest.approx(whole.levitated_s, rel=1e-7)
    assert np.abs(flown.lab.position[-1] - whole.lab.position[-1]).max() < 1e-8
    assert flown.energy_error < 1e-12


def test_a_stopped_flight_with_changes_goes_on_to_the_last_bit(start, tmp_path):
    state = kicked(start)
    scene = replace(SCENE, start=AbsoluteStart(*state.vectors))
    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this flight", 0.0)

    def stop(done):
        if done > 0.3:
            raise KeyboardInterrupt

    whole = simulate(scene, TABLE, 1.0, compact=True)
    assert whole.field_changes.count >= 1
    with pytest.raises(FlightStopped):
        simulate(scene, TABLE, 1.0, compact=True, progress=stop, checkpoint=checkpoint)
    second = simulate(scene, TABLE, 1.0, compact=True, checkpoint=checkpoint)
    for found, exact in zip(second.lab.vectors, whole.lab.vectors, strict=True):
        np.testing.assert_array_equal(found, exact)
    assert second.field_changes == whole.field_changes
    assert second.energy_error == whole.energy_error


@pytest.mark.slow
def test_over_a_plate_that_is_lowered_it_flies_as_in_the_table(start):
    """Changes of the ball while the plate moves; the energy of currents and motion balances as without balls."""
    plate = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.047)), 3.5e7, Lowering(0.05, 0.02, 4e-3))
    region = Region(np.array([-3e-3, -3e-3, 0.024]), np.array([3e-3, 3e-3, 0.037]))
    memory = PlateMemory(plate, *PlateAround(plate, TABLE, region, rtol=1e-2, slab=True).tables(), "slab")
    scene, still = replace(SCENE, plate=plate), np.zeros(len(memory.table.rates))
    state = replace(start, velocity=start.velocity + np.array([0.03, 0.02, 0.06]))
    near, whole = [
        integrate(Flight(scene, TABLE, 0.5, 1e-13, True, memory, balls), state, 0.5, currents=still)
        for balls in (True, False)
    ]
    assert near.field_changes.count >= 1
    assert near.energy_error < 1e-9
    alone = integrate(Flight(scene, TABLE, 0.5, 1e-13, True), state, 0.5)
    done = np.abs(alone.lab.position - whole.lab.position).max()
    assert np.abs(near.lab.position - whole.lab.position).max() < 1e-3 * done


def test_short_expressions_fly_by_themselves():
    assert Flight(SCENE, RotorTable("cuboid", MAGNETS, MAGNETS), 1.0, compact=True).balls is None
    assert Flight(SCENE, TABLE, 1.0, compact=True).balls is not None
