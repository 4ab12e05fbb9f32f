"""The equations of motion against the same physics written again: laboratory frame, NumPy, magpylib."""

from dataclasses import replace

import heyoka as hy
import magpylib as magpy
import numpy as np
import pytest
from article import FLOATER
from scipy.integrate import solve_ivp

from spinlev.dynamics.flights.flight import Flight, integrate
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales, State, turned_about_z
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.magnets import vertical
from spinlev.geometry.scene.contents import Drag, Scene

MAGNETS = vertical(14e-3, 10e-3, 1.305, 1.0)
TABLES = {
    "dipole": RotorTable("dipole", MAGNETS, (), tuple(uniform_moments(m, 1) for m in MAGNETS)),
    "cuboid": RotorTable("cuboid", MAGNETS, MAGNETS),
}
STEP = 4e-4
EIGHTH_ORDER = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
"""Weights of central differences: with steps of 0.4 mm at 20 mm they err by 1e-11 of the gradient."""


def magpylib_rotor(model):
    """The rotor as magpylib sources."""
    if model == "dipole":
        sources = [magpy.misc.Dipole(position=m.box.center, moment=m.moment) for m in MAGNETS]
    else:
        sources = [
            magpy.magnet.Cuboid(position=m.box.center, dimension=m.box.size, polarization=m.polarization)
            for m in MAGNETS
        ]
    return magpy.Collection(*sources)


def laboratory_rates(scene, source, time, y):
    """d/dt of position, velocity, moment direction and angular velocity along the laboratory's axes."""
    angle = scene.angular_velocity * time
    r, v, m, spin = y.reshape(4, 3)
    offsets = [k * s * STEP * axis for axis in np.eye(3) for k in (1, 2, 3, 4) for s in (1, -1)]
    points = turned_about_z(r + np.array([np.zeros(3), *offsets]), -angle)
    field = turned_about_z(source.getB(points), angle)
    energy = field[1:].reshape(3, 4, 2, 3) @ (scene.floater.moment * m)
    force = (energy[:, :, 0] - energy[:, :, 1]) @ EIGHTH_ORDER / STEP
    torque = np.cross(scene.floater.moment * m, field[0]) - scene.drag.angular * spin
    acceleration = (force - scene.drag.linear * v) / scene.floater.mass + scene.gravity
    return np.concatenate([v, acceleration, np.cross(spin, m), torque / scene.floater.inertia])


def random_state(scene, generator):
    """A floater somewhere under the rotor, moving and tumbling."""
    moment = generator.normal(size=3)
    spread = np.array([2e-3, 2e-3, 3e-3])
    return State(
        position=np.array([0.0, 0.0, -24e-3]) + spread * generator.normal(size=3),
        velocity=0.3 * generator.normal(size=3),
        moment=moment / np.linalg.norm(moment),
        spin=scene.angular_velocity * generator.normal(size=3),
    )


@pytest.mark.parametrize("model", TABLES)
def test_rates_equal_independent_laboratory_frame_rates(model):
    scene = Scene(110.0, MAGNETS, FLOATER, Drag(3e-3, 2e-7), gravity=np.array([0.0, 0.0, -9.81]))
    scales, source, generator = Scales.of(scene), magpylib_rotor(model), np.random.default_rng(1)
    rates = Rates(TABLES[model])
    speed = scales.length / scales.time
    units = np.repeat([scales.length, speed, 1.0, 1 / scales.time], 3) / scales.time
    for _ in range(5):
        state = random_state(scene, generator)
        found = rates(scales.pack(state)[None], parameters(scene, scales))[0][0] * units
        rotation = np.cross([0.0, 0.0, scene.angular_velocity], np.array(state.vectors)).ravel()
        expected = laboratory_rates(scene, source, 0.0, np.concatenate(state.vectors)) - rotation
        for part in np.split(np.arange(12), 4):  # 1e-9: finite differences in the laboratory-frame rates
            np.testing.assert_allclose(found[part], expected[part], rtol=1e-9, atol=1e-9 * np.abs(expected[part]).max())


@pytest.mark.parametrize("frequency", [0.0, 110.0])
def test_flight_equals_dop853_in_the_laboratory_frame(frequency):
    """Tilted gravity, drag and the turning of the frame included."""
    scene = Scene(frequency, MAGNETS, FLOATER, Drag(3e-3, 2e-7), gravity=np.array([1.5, -0.7, -9.81]))
    start = random_state(replace(scene, frequency=110.0), np.random.default_rng(2))
    flight = integrate(Flight(scene, TABLES["cuboid"], 0.02, compact=True), start, 0.02)
    source, initial = magpylib_rotor("cuboid"), np.concatenate(start.vectors)
    scale = np.repeat([1e-2, 1.0, 1.0, 1e3], 3)
    solution = solve_ivp(
        lambda t, y: laboratory_rates(scene, source, t, y), (0, 0.02), initial, "DOP853", rtol=1e-10, atol=1e-10 * scale
    )
    end = np.concatenate([vector[-1] for vector in flight.lab.vectors])
    assert flight.ended_by == "duration"
    np.testing.assert_allclose(end / scale, solution.y[:, -1] / scale, atol=1e-8)  # DOP853's error over 2 turns
    rotor_frame = np.concatenate([vector[-1] for vector in flight.rotor.vectors])
    back = State(*np.split(rotor_frame, 4)).to_lab(scene.angular_velocity * 0.02)
    np.testing.assert_allclose(np.concatenate(back.vectors), end, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (2.0, 1.0, -9.0)])
def test_jacobi_integral_changes_by_the_power_of_drag_and_lateral_gravity_alone(gravity):
    """An identity of the expressions at any state and time: ∇J · rates = power."""
    scene = Scene(110.0, MAGNETS, FLOATER, Drag(3e-3, 2e-7), gravity=np.array(gravity))
    scales = Scales.of(scene)
    equations = equations_of_motion(TABLES["cuboid"], any(gravity[:2]))
    slopes = [hy.diff(hy.sum(list(equations.jacobi)), v) for v in equations.variables]
    terms = [a * b for a, b in zip(slopes, equations.rates, strict=True)]
    function = hy.cfunc([*terms, equations.power], list(equations.variables), compact_mode=True, opt_level=0)
    generator = np.random.default_rng(3)
    for _ in range(20):
        state = scales.pack(random_state(scene, generator))
        pars = parameters(scene, scales)[: function.nparams]
        values = function(state, pars=pars, time=1.2) if function.is_time_dependent else function(state, pars=pars)
        assert abs(values[:-1].sum() - values[-1]) < 1e-13 * np.abs(values).max()  # round-off of the terms


def test_scaled_state_returns_to_si():
    scene = Scene(110.0, MAGNETS, FLOATER, Drag(0.0, 0.0))
    state, scales = random_state(scene, np.random.default_rng(4)), Scales.of(scene)
    for before, after in zip(state.vectors, scales.unpack(scales.pack(state)).vectors, strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-15)
