"""The plate in a flight: momentum and energy that it takes, against the frequency domain and over ten seconds."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS, RADIUS
from second_opinions.phasor import mean_force, mean_loss, mean_torque
from second_opinions.plate_tables import reaction_gradient

from spinlev.dynamics.equilibria.equilibrium import Survey
from spinlev.dynamics.equilibria.search import find_equilibria, with_plate
from spinlev.dynamics.flights.flight import PLATE_TOLERANCE, TOLERANCE, Flight, initial_state, integrate, starting_point
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import State
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Plate, Scene
from spinlev.geometry.shapes import Box

PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.047)), 3.5e7)
REGION = Region(np.array([-3e-3, -3e-3, 0.024]), np.array([3e-3, 3e-3, 0.031]))
SCENE = Scene(110.0, MAGNETS, FLOATER, Drag.stokes(RADIUS), plate=PLATE)


def memory_of(table):
    return PlateMemory(PLATE, *PlateAround(PLATE, table, REGION, rtol=1e-2, slab=True).tables(), "slab")


def test_what_a_steady_turn_loses_is_that_of_the_frequency_domain():
    """Weighing 800 t, the floater turns in one place: momentum, spin and energy lost in 55 turns, to 1e-5."""
    magnets = horizontal(2e-3, 10e-3, 1e-12, 1.0)
    heavy = replace(FLOATER, density=7.5e11)
    scene = replace(SCENE, rotor=magnets, floater=heavy, drag=Drag(0.0, 0.0), gravity=np.zeros(3))
    table = rotor_table(magnets, "dipole")
    memory = memory_of(table)
    place, tilt = np.array([0.0, 0.0, -0.0195]), 0.3
    moment, turning = np.array([np.sin(tilt), 0.0, np.cos(tilt)]), np.array([0.0, 0.0, scene.angular_velocity])
    start = State(place, np.zeros(3), moment, turning)
    state, currents = initial_state(replace(scene, start=AbsoluteStart(*start.vectors)), table, memory=memory)
    compiled = Flight(scene, table, 1.0, compact=True, memory=memory)
    flight = integrate(compiled, state, 1.0, currents=currents)
    first, last = np.searchsorted(flight.time, [0.5 - 1e-9, 1.0 - 1e-9])
    seconds = flight.time[last] - flight.time[first]
    assert seconds == pytest.approx(0.5, rel=1e-9)
    velocity, spin = flight.lab.velocity, flight.lab.spin
    force = heavy.mass * (velocity[last] - velocity[first]) / seconds
    torque = heavy.inertia * (spin[last] - spin[first]) / seconds
    body = PLATE.box.to_body(place)
    phasor = heavy.moment * np.sin(tilt) * np.array([1, -1j, 0])
    tensor, gradient = memory.table.reaction_tensor(body, 110.0)[0], reaction_gradient(memory.table, body, 110.0)[0]
    still = heavy.moment * np.cos(tilt) * np.array([0, 0, 1])
    lift = mean_force(gradient, phasor)[2]
    assert np.abs(memory.table.reaction_tensor(body, 0.0)[0] @ still).max() == 0  # what does not turn induces nothing
    assert force[2] == pytest.approx(lift, rel=1e-5)
    assert torque[2] == pytest.approx(mean_torque(tensor, phasor)[2], rel=1e-5)
    power = heavy.inertia * (spin[last] @ spin[last] - spin[first] @ spin[first]) / (2 * seconds)
    assert power == pytest.approx(-mean_loss(tensor, phasor, 110.0), rel=1e-5)
    assert lift > 0
    assert torque[2] < 0
    assert flight.energy_error < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [TOLERANCE, PLATE_TOLERANCE])
def test_energy_is_balanced_for_ten_seconds(tolerance):
    """Work = change of energy + loss in the plate, by drag and in the floater, after a kick: 1e-8 asked."""
    scene = replace(SCENE, floater=replace(FLOATER, conductivity=6.7e5))
    table = rotor_table(MAGNETS, "dipole")
    rates, memory = Rates(with_effects(scene, table)), memory_of(table)
    fixed = starting_point(find_equilibria(scene, table, rates=rates))
    found = with_plate(scene, table, Survey((fixed,), ()), memory, rates).equilibria[0]
    kicked = replace(found.start, velocity=found.start.velocity + np.array([0.03, 0.02, 0.05]))
    flight = Flight(scene, table, 10.0, tolerance, memory=memory)
    motion = integrate(flight, kicked, 10.0, currents=found.currents[0])
    print(f"\n10 s over a slab, {len(memory.table.rates)} states: ledger {motion.energy_error:.1e}")
    assert motion.ended_by == "duration"
    assert np.ptp(motion.lab.position[:, 2]) > 3e-4
    assert motion.energy_error < 1e-8
