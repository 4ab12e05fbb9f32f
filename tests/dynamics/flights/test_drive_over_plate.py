"""A rotor whose frequency changes over a plate: the memory of its currents is integrated, not followed."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS, NO_DRAG
from scipy.integrate import solve_ivp

from spinlev.dynamics.flights.batch import launched
from spinlev.dynamics.flights.flight import PLATE_TOLERANCE, SHORT_OVER_PLATE, Flight, initial_state, integrate
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.dynamics.motion.state import State, turned_about_z
from spinlev.fem.plate.slab import Slab, reaction_tensor
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import MU_0
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.scene.contents import AbsoluteStart, DriveStep, Lowering, Plate, Scene
from spinlev.geometry.shapes import Box

TABLE = rotor_table(MAGNETS, "dipole")
PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.052)), 3.5e7, Lowering(0.01, 0.05, 0.002))
REGION = Region(np.array([-4e-3, -4e-3, 0.026]), np.array([4e-3, 4e-3, 0.037]))
SCENE = Scene(110.0, MAGNETS, FLOATER, NO_DRAG, plate=PLATE)
START = initial_state(replace(SCENE, plate=None), TABLE)[0]


@pytest.fixture(scope="module")
def memory():
    return PlateMemory(PLATE, *PlateAround(PLATE, TABLE, REGION, rtol=1e-2, slab=True).tables(), "slab")


def flown(scene, memory, duration, start=START):
    state, currents = initial_state(replace(scene, start=AbsoluteStart(*start.vectors)), TABLE, memory=memory)
    flight = Flight(scene, TABLE, duration, PLATE_TOLERANCE, memory=memory)
    return currents, integrate(flight, state, duration, currents=currents)


def test_code_is_optimised_where_the_flight_is_long(memory, monkeypatch):
    levels = []
    known = "spinlev.dynamics.flights.flight.compiled"
    monkeypatch.setattr(known, lambda *_, opt_level, **options: levels.append(opt_level))
    for times in (0.9, 1.1):
        Flight(SCENE, TABLE, times * SHORT_OVER_PLATE / SCENE.frequency, memory=memory).part(0)
    assert levels == [0, 0, 1, 0]  # of motion, and of the terms of its energy


@pytest.mark.slow
def test_motion_and_motor_are_those_of_the_laboratory(memory):
    """Five turns, down and up again: SciPy, all states along the laboratory's axes."""
    scene = replace(SCENE, drive=(DriveStep(95.0, 0.02), DriveStep(130.0, 0.03)))
    currents, found = flown(scene, memory, 0.05)
    table, share, box, count = memory.table, memory.share, PLATE.box, len(memory.table.rates)

    def rates(time, y):
        place, velocity, moment, spin = y[:12].reshape(4, 3)
        angle, depth = scene.angle(time), float(PLATE.lowering.depth(time))
        axes = turned_about_z(np.eye(3), angle).T
        field, gradient = (v[0] for v in TABLE.evaluate((axes.T @ place)[None]))
        field, gradient = axes @ field, axes @ gradient @ axes.T
        flux, slope = (v[0] for v in table.multipoles.evaluate(box.to_body(place + depth * np.eye(3)[2])[None]))
        pointing, step = FLOATER.moment * box.rotation.T @ moment, 1e-5
        own = y[12 : 12 + count] - table.weights @ (flux @ pointing) - share.signals(angle, depth)
        torque = FLOATER.moment * np.cross(moment, field)
        force = FLOATER.moment * moment @ gradient
        ahead, behind = (share.signals(angle + s, depth) for s in (step, -step))
        motor = np.cross(place, force)[2] + torque[2] - own @ (ahead - behind) / (2 * step)
        strengths = own @ table.weights
        force = force + box.rotation @ np.einsum("k,a,kab->b", strengths, pointing, slope)
        torque = torque + box.rotation @ np.cross(pointing, strengths @ flux)
        accelerated = force / FLOATER.mass + scene.gravity, np.cross(spin, moment), torque / FLOATER.inertia
        return [*velocity, *np.concatenate(accelerated), *(-table.rates * own), motor, float(scene.rate(time)) * motor]

    begin = np.concatenate([*START.vectors, currents, [0.0, 0.0]])
    ends = solve_ivp(rates, (0.0, 0.05), begin, "DOP853", rtol=1e-11, atol=1e-13, max_step=1e-3).y[:, -1]
    assert found.ended_by == "duration"
    ours = np.concatenate([*(v[-1] for v in found.lab.vectors), found.given[-1]])
    np.testing.assert_allclose(ours[:3], ends[:3], atol=1e-10)
    np.testing.assert_allclose(ours[6:9], ends[6:9], atol=1e-8)
    np.testing.assert_allclose(ours[12:], ends[-2:], rtol=1e-6)  # the difference of the signals errs by 1e-10
    assert found.energy_error < 1e-8


def test_a_drive_that_holds_is_none(memory):
    """Other states, of which none is subtracted, give the same motion over a plate that goes down."""
    one, two = (flown(replace(SCENE, drive=drive), memory, 0.1)[1] for drive in ((), (DriveStep(None, 0.05),)))
    print(f"\nsteps: {one.steps} with the rotor's currents subtracted, {two.steps} with them integrated")
    assert np.abs(one.lab.position - two.lab.position).max() < 1e-11


def test_what_the_plate_takes_from_a_rotor_alone(memory):
    """The torque of a turning dipole over an infinite slab: the table, to 1 % for the floater, has 1.1 % less."""
    magnets, still = horizontal(0.0, 10e-3, 1.305, 1.0), replace(PLATE, lowering=None)
    table, floater = rotor_table(magnets, "dipole"), replace(FLOATER, remanence=1e-6)
    scene = Scene(110.0, magnets, floater, NO_DRAG, np.zeros(3), still, drive=(DriveStep(None, 0.1),))
    alone = PlateMemory(still, *PlateAround(still, table, REGION, rtol=1e-2, slab=True).tables(), "slab")
    scene = replace(scene, start=AbsoluteStart(np.array([0.0, 0.0, -19e-3]), np.zeros(3), np.eye(3)[2], np.zeros(3)))
    state, currents = initial_state(scene, table, memory=alone)
    found = integrate(Flight(scene, table, 0.1, PLATE_TOLERANCE, memory=alone), state, 0.1, currents=currents)
    tensor = reaction_tensor(Slab(PLATE.conductivity, 0.03), 0.037, SCENE.frequency)
    moment = 1.305 * 1e-6 / MU_0
    assert found.ended_by == "duration"
    assert found.given[-1, 0] / 0.1 == pytest.approx(-(moment**2) * tensor[0, 0].imag, rel=2e-2)


def test_launches_have_the_rotors_currents(memory):
    """Many at once as one by one; held at rest they begin with the currents that the first frequency leaves."""
    scene, starts = replace(SCENE, drive=(DriveStep(90.0, 0.05),)), State(*(v[None] for v in START.vectors))
    currents, alone = flown(scene, memory, 0.05)
    ends = launched(scene, TABLE, memory, starts, 0.05, 1e-12, currents=currents[None])
    assert np.abs(ends.last.position[0] - alone.rotor.position[-1]).max() < 1e-9
    held = [replace(SCENE, drive=drive) for drive in ((), (DriveStep(None, 0.02),))]
    one, two = (launched(each, TABLE, memory, starts, 0.05, 1e-12).last.position for each in held)
    assert np.abs(one - two).max() < 1e-10
