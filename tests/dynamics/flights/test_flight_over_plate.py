"""A flight over a plate that goes down, stopped and taken up again."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS

from spinlev.dynamics.flights.flight import PLATE_TOLERANCE, Flight, initial_state, integrate
from spinlev.dynamics.flights.trajectory import Checkpoint, FlightStopped
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.contents import Drag, Lowering, Plate, Scene
from spinlev.geometry.shapes import Box

TABLE = rotor_table(MAGNETS, "dipole")
PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.047)), 3.5e7, Lowering(0.02, 0.2, 4e-3))
SCENE = Scene(110.0, MAGNETS, FLOATER, Drag(0.0, 0.0), plate=PLATE)
REGION = Region(np.array([-3e-3, -3e-3, 0.024]), np.array([3e-3, 3e-3, 0.037]))
DURATION = 0.08


@pytest.fixture(scope="module")
def memory():
    return PlateMemory(PLATE, *PlateAround(PLATE, TABLE, REGION, rtol=1e-2, slab=True).tables(), "slab")


@pytest.fixture(scope="module")
def local(memory):
    return Flight(SCENE, TABLE, DURATION, PLATE_TOLERANCE, True, memory)


@pytest.fixture(scope="module")
def start():
    return initial_state(replace(SCENE, plate=None), TABLE)[0]


def still(memory):
    return np.zeros(len(memory.table.rates))


def test_a_stopped_flight_goes_on_to_the_last_bit(local, memory, start, tmp_path):
    """Stopped after the plate has begun to move, and taken up by the same code."""
    whole = integrate(local, start, DURATION, currents=still(memory))
    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this flight", 0.0)

    def stop(done):
        if done > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(FlightStopped):
        integrate(local, start, DURATION, stop, still(memory), checkpoint)
    second = integrate(local, start, DURATION, None, still(memory), checkpoint)
    for found, exact in zip(second.lab.vectors, whole.lab.vectors, strict=True):
        np.testing.assert_array_equal(found, exact)
    assert second.field_changes == whole.field_changes
