"""Launches over a plate: as flown one by one, the same to the last bit in any company, and what ends them."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER

from spinlev.dynamics.flights.batch import launched
from spinlev.dynamics.flights.flight import PLATE_TOLERANCE, Flight, initial_state, integrate
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.dynamics.motion.state import State
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import tilt
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Lowering, Plate, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box, Cylinder, rotation_matrix

MAGNETS = tilt(np.radians(10), 10e-3, 1.305, 1.0)
TABLE = rotor_table(MAGNETS, "dipole")
SIZE = np.array([0.1, 0.24, 0.03])
PLATE = Plate(Box(SIZE, np.array([0.0, 0.0, -0.05])), 3.5e7)
SCENE = Scene(165.0, MAGNETS, FLOATER, Drag(0.0, 0.0), plate=PLATE)
PLACES = np.array(
    [[0, 0, -17], [1, 0, -17], [0, 2, -19], [0, 0, -12.5], [0, 0, -26], [3, 1, -20], [0, 0, -2], [1, 1, -18]]
)
DURATION = 0.1


def memory_of(plate, deepest=0.0):
    region = Region(np.array([-0.004, -0.004, 0.0214]), np.array([0.004, 0.004, 0.038 + deepest]))
    return PlateMemory(plate, *PlateAround(plate, TABLE, region, (0.5, 330.0), 3e-2, slab=True).tables(), model="slab")


@pytest.fixture(scope="module")
def memory():
    return memory_of(PLATE)


@pytest.fixture(scope="module")
def starts():
    lean = np.radians(np.arange(0.0, 40.0, 5.0))
    moment = np.stack([np.sin(lean), 0 * lean, np.cos(lean)], axis=1)
    return State(1e-3 * PLACES, np.zeros((8, 3)), moment, np.zeros((8, 3)))


@pytest.fixture(scope="module")
def flown(memory, starts):
    return launched(SCENE, TABLE, memory, starts, DURATION)


def test_floaters_end_as_they_must(flown):
    """Near the cube it is drawn to it, over the plate it falls on it; one that begins in the cube is over at once."""
    ends = flown.ended_by.tolist()
    assert ends[3] == ends[4] == ends[6] == "contact"
    assert flown.levitated_s[6] == 0.0
    assert flown.last.position[3, 2] > -0.013
    assert flown.last.position[4, 2] == pytest.approx(-0.035 + 6.35e-3, abs=1e-7)
    assert ends.count("duration") >= 2
    np.testing.assert_array_equal(flown.levitated_s[flown.ended_by == "duration"], DURATION)


def test_flights_that_leave_the_plates_table_are_marked(memory, flown):
    """The table reaches from 3.4 mm under the floater that hovers to 12 mm under the rotor, and 4 mm to the side."""
    last = memory.table.in_range(memory.plate.box.to_body(flown.last.position))
    assert flown.left_plate_table[~last].all()
    assert flown.left_plate_table[6]  # it begins beyond
    assert 0 < flown.left_plate_table.sum() < len(last)
    assert f"{flown.left_plate_table.sum()} left the range of the plate's table" in repr(flown)


def test_the_company_does_not_matter(memory, starts, flown):
    order = np.array([5, 0, 7, 4])
    found = launched(SCENE, TABLE, memory, State(*(v[order] for v in starts.vectors)), DURATION)
    np.testing.assert_array_equal(found.ended_by, flown.ended_by[order])
    np.testing.assert_array_equal(found.levitated_s, flown.levitated_s[order])
    np.testing.assert_array_equal(found.left_plate_table, flown.left_plate_table[order])
    for a, b in zip(found.last.vectors, flown.last.vectors, strict=True):
        np.testing.assert_array_equal(a, b[order])


def alone_from(scene, memory, duration, currents):
    """The flight of one floater by the integrator for one, in the tables' own fields."""
    flight = Flight(scene, TABLE, duration, PLATE_TOLERANCE, True, memory)
    return integrate(flight, initial_state(scene, TABLE, [], memory)[0], duration, currents=currents)


def test_a_launch_is_what_one_flight_is(memory, starts):
    """The same equations integrated to round-off by another integrator; a thirtieth of a second is not yet chaotic."""
    few = State(*(v[:2] for v in starts.vectors))
    scenes = [replace(SCENE, start=AbsoluteStart(*(v[k] for v in few.vectors))) for k in range(2)]
    currents = np.array([initial_state(scene, TABLE, [], memory)[1] for scene in scenes])
    for k, scene in enumerate(scenes):
        alone = alone_from(scene, memory, 0.03, currents[k])  # it ends where the plate's table does
        found = launched(SCENE, TABLE, memory, few, float(alone.time[-1]), 1e-13, currents)
        assert np.abs(found.last.position[k] - alone.rotor.position[-1]).max() < 1e-10
        assert np.abs(found.last.moment[k] - alone.rotor.moment[-1]).max() < 1e-8


@pytest.mark.slow
def test_over_a_plate_that_goes_down_it_is_so_too(starts):
    scene = replace(SCENE, plate=replace(PLATE, lowering=Lowering(0.001, 0.2, 0.004)))
    memory, few = memory_of(scene.plate, 0.004), State(*(v[:1] for v in starts.vectors))
    one = replace(scene, start=AbsoluteStart(*(v[0] for v in few.vectors)))
    currents = initial_state(one, TABLE, [], memory)[1]
    alone = alone_from(one, memory, 0.05, currents)  # it ends where the plate's table does
    assert alone.time[-1] > 0.005  # while the plate goes down
    found = launched(scene, TABLE, memory, few, float(alone.time[-1]), 1e-13, currents[None])
    assert np.abs(found.last.position[0] - alone.rotor.position[-1]).max() < 1e-9


@pytest.mark.parametrize(
    "body", [Cylinder(7e-3, 5e-3), pytest.param(Box((10e-3,) * 3), marks=pytest.mark.slow)], ids=["disc", "cube"]
)
def test_launches_of_other_shapes_are_what_each_is_alone(memory, body):
    """By another integrator, to round-off; the plate is touched by the lowest point of the true surface."""
    floater = Floater(body.circumradius, FLOATER.remanence, 1.0, FLOATER.density, body=body)
    scene, duration = replace(SCENE, floater=floater), 0.008
    moment = np.array([[0.1, 0.0, 0.995], [0.3, -0.2, 0.93]])
    places, falling = 1e-3 * np.array([[0, 0, -22], [0, 0, -26]]), np.array([[0, 0, 0], [0, 0, -0.8]])
    starts = State(places, falling, moment, np.zeros((2, 3)))
    begun = [
        initial_state(replace(scene, start=AbsoluteStart(*(v[k] for v in starts.vectors))), TABLE, [], memory)
        for k in range(2)
    ]
    found = launched(scene, TABLE, memory, starts, duration, 1e-13, np.array([currents for _, currents in begun]))
    assert found.ended_by.tolist() == ["duration", "contact"]
    alone = integrate(
        Flight(scene, TABLE, duration, PLATE_TOLERANCE, True, memory, in_balls=False),
        begun[0][0],
        duration,
        currents=begun[0][1],
    )
    assert np.abs(found.last.position[0] - alone.rotor.position[-1]).max() < 1e-10
    assert np.abs(found.last.moment[0] - alone.rotor.moment[-1]).max() < 1e-8
    (solid,) = floater.placed(found.last.position[1], found.last.orientation[1])
    lowest = solid.center[2] - solid.support(np.array([[0.0, 0.0, -1.0]]))[0]
    assert lowest == pytest.approx(-0.035, abs=1e-6)


def test_what_cannot_be_flown_is_said(memory, starts):
    with pytest.raises(InputError, match="duration must be positive"):
        launched(SCENE, TABLE, memory, starts, 0.0)
    with pytest.raises(InputError, match="one state at least"):
        launched(SCENE, TABLE, memory, State(*(v[:0] for v in starts.vectors)), 1.0)
    upright = replace(PLATE, body=replace(PLATE.box, rotation=rotation_matrix((0.0, 90.0, 0.0))))
    with pytest.raises(InputError, match="lie flat"):
        launched(SCENE, TABLE, replace(memory, plate=upright), starts, 1.0)
