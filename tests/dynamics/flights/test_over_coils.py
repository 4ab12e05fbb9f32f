"""A conductor over coils: TEAM problem 28 against coaxial rings, its energy, a table of time, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from ngsolve import SetNumThreads
from scipy.optimize import brentq
from second_opinions.coaxial_rings import Rings

from spinlev.dynamics.flights.conductor import (
    Supply,
    conductor_motion,
    heights_over,
    levitation_height,
    sources_of,
)
from spinlev.fem.plate.floating import floating_modes
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import AbsoluteStart
from spinlev.geometry.scene.files import parse_scene
from spinlev.studies.catalogue.measured import TEAM28

SetNumThreads(1)
SCENE = parse_scene(TEAM28)
BODY, WEIGHT = SCENE.floater.bodies[0], SCENE.floater.mass * 9.81


@pytest.fixture(scope="module")
def modes():
    supply = Supply(SCENE.coils, sources_of(SCENE.coils))
    return floating_modes(BODY, 3.4e7, SCENE.coils, supply.shares, heights_over(SCENE), 50.0, 1e-3, order=3)


@pytest.fixture(scope="module")
def rings():
    return Rings(0.0, BODY.radius, BODY.height, 3.4e7, 80, 4)


def force(modes, height):
    return modes.mean_force(height, np.array([20.0]), np.array([50.0]))


@pytest.mark.parametrize("height", [5.3e-3, 9e-3, 12.8e-3, 20e-3])
def test_mean_force_at_rest_is_that_of_coaxial_rings(modes, rings, height):
    """320 rings are some 2e-4 of the force from their limit."""
    assert force(modes, height) == pytest.approx(rings.mean_force(SCENE.coils, height, 50.0), rel=1e-3)


def test_height_is_that_of_coaxial_rings(modes, rings):
    theirs = brentq(lambda z: rings.mean_force(SCENE.coils, z, 50.0) - WEIGHT, 0.01, 0.016, xtol=1e-8)
    ours = levitation_height(modes, Supply(SCENE.coils, sources_of(SCENE.coils)), WEIGHT)
    assert ours - 1.5e-3 == pytest.approx(theirs - 1.5e-3, rel=1e-3)


def test_energy_balance_closes_with_the_heat(modes):
    motion = conductor_motion(SCENE, modes, 0.1)
    assert motion.ended_by == "duration"
    assert motion.heat[-1] > 1.0  # J, against which the balance is
    assert motion.energy_error < 1e-8
    assert motion.height.max() > motion.height[0] + 5e-3  # it rises


def test_table_of_time_is_the_sine_that_it_follows(modes):
    """Straight lines over 1/200 of a period miss a sine by (π/200)²/2 of its size."""
    times = np.linspace(0.0, 0.02, 201)
    leader = SCENE.coils[0]  # the other's current is in proportion
    table = replace(leader, current=np.stack([times, leader.amperes(times)], axis=1), frequency=0.0)
    ends = [conductor_motion(replace(SCENE, coils=(coil,)), modes, 0.02).height[-1] for coil in (table, leader)]
    assert ends[0] - SCENE.start.position[2] == pytest.approx(ends[1] - SCENE.start.position[2], rel=2e-3)


def test_tables_are_sources_of_their_own():
    times = np.array([[0.0, 1.0], [1.0, 2.0]])
    coils = [SCENE.coils[0], replace(SCENE.coils[0], current=times), SCENE.coils[1], replace(SCENE.coils[0], phase=1.0)]
    assert sources_of(coils) == [[0, 2], [1], [3]]
    assert Supply(coils, sources_of(coils)).shares[0] == [1.0, 0.0, -1.0, 0.0]


def test_without_current_it_falls_onto_the_coils(modes):
    scene = replace(SCENE, coils=tuple(replace(coil, current=coil.current * 1e-6) for coil in SCENE.coils))
    motion = conductor_motion(scene, modes, 1.0)
    fall = SCENE.start.position[2] - modes.heights[0]
    assert motion.ended_by == "contact"
    assert motion.time[-1] == pytest.approx(np.sqrt(2 * fall / 9.81), rel=1e-4)  # air takes 2e-5


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"floater": replace(SCENE.floater, conductivity=None)}, "conductivity_S_m"),
        ({"start": AbsoluteStart(np.array([1e-3, 0, 5e-3]), np.zeros(3), np.eye(3)[2], np.zeros(3))}, "one vertical"),
        ({"start": AbsoluteStart(np.array([0, 0, -5e-3]), np.zeros(3), np.eye(3)[2], np.zeros(3))}, "above all coils"),
    ],
)
def test_scenes_that_it_cannot_move_are_refused(changes, said):
    with pytest.raises(InputError, match=said):
        heights_over(replace(SCENE, **changes))
