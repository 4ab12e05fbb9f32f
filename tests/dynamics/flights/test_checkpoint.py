"""A flight that is stopped and goes on is the flight that was not stopped, to the last bit; bad files are refused."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS

from spinlev.dynamics.flights.flight import simulate
from spinlev.dynamics.flights.trajectory import Checkpoint, FlightStopped
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import Drag, Scene

DIPOLE = RotorTable("dipole", MAGNETS, (), tuple(uniform_moments(m, 1) for m in MAGNETS))
SCENE = Scene(110.0, MAGNETS, FLOATER, Drag(2.2e-6, 1.2e-10))


@pytest.fixture
def checkpoint(tmp_path):
    return Checkpoint(tmp_path / "checkpoint.npz", "this flight", 0.0)


def stopped_at(part):
    def progress(done):
        if done > part:
            raise KeyboardInterrupt

    return progress


def begun(part, checkpoint):
    """What is flown when the user stops at a part of the flight."""
    with pytest.raises(FlightStopped) as stop:
        simulate(SCENE, DIPOLE, 4.0, compact=True, progress=stopped_at(part), checkpoint=checkpoint)
    return stop.value.simulated


@pytest.fixture(scope="module")
def whole():
    return simulate(SCENE, DIPOLE, 4.0, compact=True)


@pytest.mark.parametrize("seconds", [0.0, 1e9])
def test_a_stopped_flight_goes_on_to_the_last_bit(checkpoint, whole, seconds):
    """Also where no checkpoint was due before the stop: then that of the stop itself."""
    checkpoint = replace(checkpoint, every=seconds)
    first = begun(0.3, checkpoint)
    assert first.ended_by == "stopped"
    assert 0 < first.levitated_s < 2
    assert len(checkpoint.read()["times"]) == len(first.time)
    second = simulate(SCENE, DIPOLE, 4.0, compact=True, checkpoint=checkpoint)
    checkpoint.remove()
    assert not checkpoint.path.exists()
    np.testing.assert_array_equal(second.time, whole.time)
    for found, exact in zip(second.lab.vectors, whole.lab.vectors, strict=True):
        np.testing.assert_array_equal(found, exact)
    assert second.energy_error == whole.energy_error


def test_another_flights_checkpoint_is_refused(checkpoint):
    begun(0.1, checkpoint)
    other = Checkpoint(checkpoint.path, "another flight")
    with pytest.raises(InputError, match="another scene"):
        other.read()


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b"not an archive"])
def test_a_damaged_checkpoint_is_reported(checkpoint, damage):
    begun(0.1, checkpoint)
    checkpoint.path.write_bytes(damage(checkpoint.path.read_bytes()))
    with pytest.raises(InputError, match="damaged"):
        checkpoint.read()


def test_a_flipped_bit_is_reported_or_harmless(checkpoint):
    """Also where it makes an archive look encrypted or packed in another way."""
    begun(0.1, checkpoint)
    whole, kept = checkpoint.path.read_bytes(), checkpoint.read()
    chance, refused = np.random.default_rng(0), 0
    directory = whole.rindex(b"steps.npy") - 400  # most of the file is samples: half of the bits near its end
    for k in range(400):
        place = chance.integers(directory if k % 2 else 0, len(whole))
        bit = 1 << chance.integers(8)
        checkpoint.path.write_bytes(whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1 :])
        try:
            found = checkpoint.read()
        except InputError:
            refused += 1
        else:
            for name, values in kept.items():
                np.testing.assert_array_equal(found[name], values)
    assert refused > 200
