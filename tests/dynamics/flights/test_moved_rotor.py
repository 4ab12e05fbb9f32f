"""A rotor that is moved and whose axis is turned: laboratory equations of another integrator, energy, where it is."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS, NO_DRAG
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.flights.flight import Flight, initial_state, integrate, simulate
from spinlev.dynamics.motion.state import turned_about_z
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.contents import Drag, DriveStep, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box

TABLE = rotor_table(MAGNETS, "dipole")
TILTED = tuple((np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])).tolist())
STEPS = (
    DriveStep(110.0, 0.02, center=(2e-3, 0.0, 1e-3), axis=TILTED),
    DriveStep(None, 0.01),
    DriveStep(None, 0.02, axis=(0.0, 0.0, 1.0)),
)
SCENE = Scene(120.0, MAGNETS, FLOATER, Drag(2.2e-6, 1.2e-10), np.array([0.3, -0.2, -9.8]), drive=STEPS)
STEADY = replace(SCENE, gravity=np.array([0.0, 0.0, -9.81]), drive=())
START = initial_state(STEADY, TABLE)[0]
KICK, TURN = np.array([0.02, -0.01, 0.03]), np.array([4.0, 3.0, 20.0])
START = replace(START, velocity=START.velocity + KICK, spin=START.spin + TURN)


def laboratory(scene):
    """Rates of place, velocity, moment and spin, all in the laboratory, with the rotor's pose by hand."""
    floater = scene.floater
    lean = np.cross([0.0, 0.0, 1.0], TILTED)
    lean *= np.arcsin(np.linalg.norm(lean)) / np.linalg.norm(lean)

    def rate(time, y):
        place, velocity, moment, spin = y.reshape(4, 3)
        part, back = min(time / 0.02, 1.0), np.clip((time - 0.03) / 0.02, 0.0, 1.0)
        tilt = Rotation.from_rotvec((part - back) * lean).as_matrix()
        center = part * np.array([2e-3, 0.0, 1e-3])
        angle = 2 * np.pi * (120.0 * time - 250.0 * time**2 if time < 0.02 else 2.3 + 110.0 * (time - 0.02))
        axes = tilt @ turned_about_z(np.eye(3), angle).T
        field, gradient = (v[0] for v in TABLE.evaluate((axes.T @ (place - center))[None]))
        field, gradient = axes @ field, axes @ gradient @ axes.T
        push = (floater.moment * moment @ gradient - scene.drag.linear * velocity) / floater.mass + scene.gravity
        turn = (floater.moment * np.cross(moment, field) - scene.drag.angular * spin) / floater.inertia
        return [*velocity, *push, *np.cross(spin, moment), *turn]

    return rate


def test_motion_is_that_of_the_laboratory():
    """Another integrator and another frame, where nothing but the rotor's field moves."""
    flown = integrate(Flight(SCENE, TABLE, 0.06), START, 0.06)
    begin, rate = np.concatenate(START.vectors), laboratory(SCENE)
    for first, last in ((0.0, 0.02), (0.02, 0.03), (0.03, 0.05), (0.05, 0.06)):
        begin = solve_ivp(rate, (first, last), begin, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    found = np.concatenate([v[-1] for v in flown.lab.vectors])
    np.testing.assert_allclose(found, begin, rtol=1e-7, atol=1e-9)
    assert flown.ended_by == "duration"
    assert flown.energy_error < 1e-12


def test_a_cube_too():
    """A body of three moments of inertia in the same drive: energy, and that its pose is a rotation."""
    cube = Floater(0.005 * 3**0.5, 1.3, 1.0, 7500.0, None, Box((0.01,) * 3))
    scene = replace(SCENE, floater=cube, drag=NO_DRAG)
    start = replace(START, position=START.position - [0.0, 0.0, 8e-3], axes=cube.axes(START.moment))
    flown = integrate(Flight(scene, TABLE, 0.06, in_balls=False), start, 0.06)
    assert flown.ended_by == "duration"
    assert flown.energy_error < 1e-12
    axes = flown.lab.axes
    np.testing.assert_allclose(axes @ axes.swapaxes(1, 2), np.broadcast_to(np.eye(3), axes.shape), atol=1e-12)
    np.testing.assert_allclose(flown.lab.moment, axes[:, :, 2], atol=1e-12)


def test_a_shift_without_forces_changes_nothing():
    """Far from the rotor the floater falls in the laboratory, whatever that does; its origin is where it should be."""
    scene = replace(SCENE, drag=NO_DRAG)
    far = replace(START, position=np.array([0.0, 0.0, -5.0]), velocity=np.array([0.1, 0.0, 0.0]))
    flown = integrate(Flight(scene, TABLE, 0.06), far, 0.06)
    time = flown.time[:, None]
    known = far.position + far.velocity * time + scene.gravity * time**2 / 2
    np.testing.assert_allclose(flown.lab.position, known, atol=1e-10)
    center, axes = scene.pose(np.array([0.02, 0.06]))
    np.testing.assert_allclose(center, np.tile([2e-3, 0.0, 1e-3], (2, 1)), atol=1e-15)
    np.testing.assert_allclose(axes[:, :, 2], [TILTED, [0.0, 0.0, 1.0]], atol=1e-12)


def test_the_floater_follows_a_slow_rotor():
    """Lifted by 1 mm in 0.5 s it is carried along: as far below the rotor as before, within its own modes."""
    steady = replace(STEADY, frequency=130.0, drag=NO_DRAG)
    scene = replace(steady, drive=(DriveStep(None, 0.5, center=(0.0, 0.0, 1e-3)),))
    equilibrium = next(e for e in find_equilibria(steady, TABLE) if e.stable)
    flown = simulate(scene, TABLE, 0.6, [equilibrium])
    assert flown.ended_by == "duration"
    late = flown.time > 0.5
    assert flown.rotor.position[late, 2].mean() == pytest.approx(equilibrium.position[2], abs=0.1e-3)
    assert flown.lab.position[late, 2].mean() == pytest.approx(equilibrium.position[2] + 1e-3, abs=0.1e-3)
