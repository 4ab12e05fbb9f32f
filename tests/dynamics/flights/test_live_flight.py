"""A flight to play with: the same motion as in one go, exact parabolas after a push, and ends that can be undone."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS
from places import OVER_PLATE

from spinlev.dynamics.flights.flight import StartError, simulate
from spinlev.dynamics.flights.live import LiveFlight
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Cylinder
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation

DIPOLE = RotorTable("dipole", MAGNETS, (), tuple(uniform_moments(m, 1) for m in MAGNETS))
UP, STILL = np.array([0.0, 0.0, 1.0]), np.zeros(3)
START = AbsoluteStart(np.array([0.0, 0.0, -0.03]), STILL, UP, STILL)
SCENE = Scene(110.0, MAGNETS, Floater(6.35e-3, 0.0, 1.0, 7500.0), Drag(0.0, 0.0), start=START)
"""A floater that is no magnet and feels no air: it falls freely."""
GRAVITY = np.array([0.0, 0.0, -9.81])


def test_pieces_are_the_flight_in_one_go():
    """13 turns of the rotor: a step errs by round-off, and there are other steps."""
    scene = replace(SCENE, floater=FLOATER, drag=Drag.stokes(6.35e-3))
    whole = simulate(scene, DIPOLE, 0.12, compact=True)
    live = LiveFlight(scene, DIPOLE, ())
    times = np.concatenate([live.onward(seconds).time for seconds in (0.02, 0.04, 0.06)])
    assert (np.diff(times) > 0).all()
    assert live.time == pytest.approx(0.12, rel=1e-12)
    for found, known in zip(live.now.vectors, whole.lab.vectors, strict=True):
        assert found == pytest.approx(known[-1], rel=1e-9, abs=1e-12)


def test_a_push_is_a_change_of_velocity_along_the_laboratorys_axes():
    live = LiveFlight(SCENE, DIPOLE, ())
    live.onward(0.013)
    before = live.now
    live.push(np.array([0.1, -0.2, 0.3]))
    live.onward(0.02)
    velocity = before.velocity + np.array([0.1, -0.2, 0.3])
    assert live.now.position == pytest.approx(before.position + 0.02 * velocity + GRAVITY * 0.02**2 / 2, abs=1e-14)


def test_a_disc_is_put_where_its_own_surface_is_free():
    """2 mm below the magnet's face, where a ball about it would overlap; 1 mm farther up it does itself."""
    disc = Cylinder(6e-3, 3e-3)
    live = LiveFlight(replace(SCENE, floater=Floater(disc.circumradius, 0.0, 1.0, 7500.0, None, disc)), DIPOLE, ())
    live.put(np.array([0.0, 0.0, -8.5e-3]))
    assert live.now.position[2] == -8.5e-3
    assert live.onward(1e-3).ended_by == "duration"
    with pytest.raises(StartError, match="mm inside one of them"):
        live.put(np.array([0.0, 0.0, -6e-3]))


def test_a_floater_that_is_let_go_turns_with_the_rotor():
    live = LiveFlight(SCENE, DIPOLE, ())
    live.onward(0.013)
    place = np.array([5e-3, 0.0, -0.04])
    live.put(place)
    there, angle = live.now, SCENE.angular_velocity * live.time
    assert there.position == pytest.approx([5e-3 * np.cos(angle), 5e-3 * np.sin(angle), -0.04], abs=1e-15)
    assert there.velocity == pytest.approx(np.cross(SCENE.angular_velocity * UP, there.position), abs=1e-12)
    live.onward(0.01)
    fallen = there.position + 0.01 * there.velocity + GRAVITY * 0.01**2 / 2
    assert live.now.position == pytest.approx(fallen, abs=1e-13)


def test_a_flight_ends_by_contact_or_loss_and_begins_again_where_the_floater_is_put():
    live = LiveFlight(SCENE, DIPOLE, ())
    live.push(np.array([0.0, 0.0, 3.0]))
    assert live.onward(0.1).ended_by == "contact"
    touched = live.time
    assert live.onward(0.1).time.tolist() == [touched]
    live.put(np.array([0.0, 0.0, -0.05]))
    assert live.onward(1.0).ended_by == "lost"
    assert live.time - touched == pytest.approx(np.sqrt(2 * 0.05 / 9.81), rel=1e-9)  # to 0.1 m below the rotor


def test_what_cannot_be_changes_nothing():
    live = LiveFlight(SCENE, DIPOLE, ())
    state = live.now
    with pytest.raises(StartError, match=r"free of the magnets and the plate; instead it begins at \(0, 0, -5\) mm"):
        live.put(np.array([0.0, 0.0, -5e-3]))
    for seconds in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="seconds must be positive"):
            live.onward(seconds)
    assert np.array_equal(live.now.vectors, state.vectors)


def test_the_plates_memory_is_in_the_flight():
    """Each kick dies out as the plate's bounce does, at 2.8 /s; without it nothing does."""
    levitation = Levitation(OVER_PLATE, Models("dipole", "slab", plate_rtol=1e-2))
    rest = levitation.stability.position[2]
    swing = {}
    for name, one in (("plate", levitation), ("none", levitation.elsewhere(Models("dipole", "none")))):
        live = one.live_flight()
        live.push(np.array([0.0, 0.0, 0.01]))
        live.onward(1.5)
        swing[name] = np.abs(
            live.onward(0.2).lab.position[:, 2] - (rest if name == "plate" else one.stability.position[2])
        )
    assert swing["plate"].max() < 0.1 * swing["none"].max()
