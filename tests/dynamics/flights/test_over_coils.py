"""Conductors over coils: TEAM problem 28 against coaxial rings, motion in six degrees, energy, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from second_opinions.coaxial_rings import Rings

from spinlev.dynamics.flights.conductor import (
    Supply,
    conductor_motion,
    free_motion,
    heights_over,
    levitation_height,
    room_over,
)
from spinlev.fem.closed_forms.coil import CoilField
from spinlev.fem.closed_forms.eddy_bodies import thin_field_torque
from spinlev.fem.plate.eddy import solve_eddy
from spinlev.fem.plate.floating import AxialPotential, Levitated, _Seen, floating_modes, free_modes, sampled_poses
from spinlev.geometry.common import InputError
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.geometry.scene.contents import AbsoluteStart, Plate
from spinlev.geometry.scene.files import parse_scene
from spinlev.geometry.scene.making import assemble
from spinlev.geometry.shapes import Box
from spinlev.studies.catalogue.measured import team28

SCENE = team28()
BODY, WEIGHT = SCENE.floater.bodies[0], SCENE.floater.mass * 9.81


def conductor(scene, frequency):
    return Levitated(scene.floater.bodies[0], 3.4e7, scene.coils, Supply(scene.coils).shares, frequency)


@pytest.fixture(scope="module")
def modes():
    return floating_modes(conductor(SCENE, 50.0), heights_over(SCENE), 1e-3, order=2)


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
    ours = levitation_height(SCENE, modes)
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
    assert Supply(coils).groups == [[0, 2], [1], [3]]
    assert Supply(coils).shares[0] == [1.0, 0.0, -1.0, 0.0]


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
        ({"plate": Plate(Box([0.01, 0.01, 0.01]), 3e7)}, "plate must be left out"),
        ({"start": AbsoluteStart(np.array([0, 0, -5e-3]), np.zeros(3), np.eye(3)[2], np.zeros(3))}, "above all coils"),
    ],
)
def test_scenes_that_it_cannot_move_are_refused(changes, said):
    with pytest.raises(InputError, match=said):
        heights_over(replace(SCENE, **changes))


PAIR = """
[floater]
shape = "cylinder"
diameter_mm = 40.0
height_mm = 3.0
remanence_T = 0.0
density_kg_m3 = 2700.0
conductivity_S_m = 3.4e7
[start]
position_mm = [0.0, 0.0, 3.5]
[[coils]]
radius_mm = 12.0
width_mm = 8.0
height_mm = 16.0
center_mm = [0.0, 0.0, -10.0]
turns = 500.0
current_A = 14.0
frequency_hz = 100.0
[[coils]]
radius_mm = 28.0
width_mm = 8.0
height_mm = 16.0
center_mm = [0.0, 0.0, -10.0]
turns = 300.0
current_A = -10.0
frequency_hz = 100.0
"""
DISC = parse_scene(PAIR)


@pytest.fixture(scope="module")
def free():
    return free_modes(conductor(DISC, 100.0), room_over(DISC), order=3)


@pytest.mark.slow
def test_free_motion_along_the_axis_is_that_along_the_axis(free):
    """Both have finite elements of order 3 on other meshes: nearest to the coils 2e-3 of the force are between them."""
    axial = floating_modes(conductor(DISC, 100.0), heights_over(DISC), order=3)
    for height in (2.5e-3, 6e-3, 15e-3):
        force = free.mean_force(np.array([0.0, 0.0, height]), np.eye(3), np.array([14.0]), 100.0)
        assert np.hypot(*force[:2]) < 1e-3 * abs(force[2])
        assert force[2] == pytest.approx(axial.mean_force(height, np.array([14.0]), np.array([100.0])), rel=3e-3)
    ways = [move(DISC, modes, 0.04) for move, modes in ((conductor_motion, axial), (free_motion, free))]
    fallen = [3.5e-3 - way.height for way in ways]
    assert fallen[1] == pytest.approx(fallen[0], abs=4e-3 * fallen[0].max())
    assert max(way.energy_error for way in ways) < 1e-8


@pytest.mark.slow
def test_free_force_is_the_slope_of_couplings_solved_for_directly(free):
    """Aside, tilted and by finite elements alone: F = ½ Re ∂/∂x' ∫ J(x)·A(x') dV, by differences."""
    body, tilt = DISC.floater.bodies[0], Rotation.from_rotvec([0.02, 0.05, 0.0]).as_matrix()
    coils = [AxialPotential.of(CoilField(DISC.coils, [1.0, -10 / 14]), 0.04, (0.0, 0.04))]
    place, step = np.array([1e-3, 5e-4, 5e-3]), 2e-4
    mesh = plate_mesh(body, 3.4e7, [[0.0, 0.0, -5e-3]], 100.0, MeshRule(distance_share=0.8))
    ends = [_Seen(coils, place + sign * step * axis, tilt) for axis in np.eye(3) for sign in (1, -1)]
    found = solve_eddy(mesh, 3, 100.0, [_Seen(coils, place, tilt)]).couplings_to(ends)[:, 0].real
    exact = 14.0**2 / 2 * (found[::2] - found[1::2]) / (2 * step)
    force = free.mean_force(place, tilt, np.array([14.0]), 100.0)
    assert force == pytest.approx(exact, abs=3e-3 * np.linalg.norm(exact))


@pytest.mark.slow
def test_free_conductor_takes_power_in_a_thousand_poses(free):
    """In any direction and at any frequency: -Im of couplings, ω Σ λ G²/(λ² + ω²)."""
    omega = 2 * np.pi * np.array([1.0, 100.0, 1e4])
    for pose in sampled_poses(DISC.floater.bodies[0], room_over(DISC), 1000, 7):
        power = omega / (free.rates[:, None] ** 2 + omega**2) * (free.rates * free.flux(*pose)[:, 0] ** 2)[:, None]
        assert power.sum(axis=0).min() > 0


@pytest.mark.slow
def test_free_motion_keeps_its_energy_aside_and_tilted(free):
    """It slides off, as nothing holds it above two coils that are opposed."""
    start = replace(DISC.start, position=np.array([1e-3, 5e-4, 3.5e-3]), moment=np.array([0.02, 0.0, 1.0]))
    motion = free_motion(replace(DISC, start=start), free, 0.05)
    assert motion.energy_error < 1e-8
    assert np.hypot(*motion.position[-1, :2]) > np.hypot(*motion.position[0, :2])
    assert np.abs(motion.spin[-1]).max() > 0.1


def test_sphere_that_spins_over_a_steady_coil_slows_down_as_in_a_uniform_field():
    """By (2π/15) σ R⁵ B × (Ω × B): to 1e-3 the field is uniform over it and the slowing slow."""
    wide = {"radius_mm": 300.0, "width_mm": 10.0, "height_mm": 10.0, "center_mm": [0.0, 0.0, 0.0]}
    coil = wide | {"turns": 1000.0, "current_A": 15.0}
    ball = {"diameter_mm": 20.0, "remanence_T": 0.0, "density_kg_m3": 2700.0, "conductivity_S_m": 3.4e7}
    drag, start = {"linear_N_s_m": 0.0, "angular_N_m_s": 0.0}, {"position_mm": [1.0, 2.0, 20.0], "spin_hz": [2.0, 0, 1]}
    scene = assemble(
        {"floater": ball, "coils": [coil], "start": start, "drag": drag, "gravity_m_s2": [0.0] * 3}, "spun"
    )
    modes = free_modes(conductor(scene, 50.0), room_over(scene), order=2)
    motion = free_motion(scene, modes, 0.03)
    field = CoilField(scene.coils).flux_density(motion.position[:1])[0, 2] * 15.0
    rate = thin_field_torque(0.01, 3.4e7) * field**2 / scene.floater.inertia
    spin = np.einsum("nab,nb->na", motion.axes, motion.spin)
    settled = motion.time > 2e-3
    slope = np.polyfit(motion.time[settled], np.log(spin[settled, 0]), 1)[0]
    assert slope == pytest.approx(-rate, rel=5e-3)
    assert spin[-1, 2] == pytest.approx(spin[0, 2], rel=1e-3)  # about the field it goes on
    assert motion.energy_error < 1e-8
