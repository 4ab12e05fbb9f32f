"""Every effect at once, over a plate: the ledger of energy, and Floquet's modes against the integrator."""

from dataclasses import replace

import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.equilibria.equilibrium import Survey
from spinlev.dynamics.equilibria.orbits import floquet_modes, periodic_orbit
from spinlev.dynamics.equilibria.search import survey, with_plate
from spinlev.dynamics.flights.flight import Flight, simulate
from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.effects import with_effects
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.floater_effects import FLOATER_CURRENTS, REAL_AIR
from spinlev.dynamics.motion.plate import PlateForce, PlateMemory
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import MUTUAL, ROTOR_CURRENTS, Mutual, RotorCurrents
from spinlev.dynamics.motion.state import Parameter, Scales
from spinlev.fem.mutual.making import cached_mutual_table
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor_metal import ball_losses, pieces_of
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.meshes.plate import MeshRule
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, Lowering, Plate, Scene
from spinlev.geometry.shapes import Box

MAGNETS = tuple(replace(magnet, conductivity=6.7e5) for magnet in horizontal(2e-3, 10e-3, 1.305, 1.05))
BARE = tuple(replace(magnet, conductivity=None) for magnet in MAGNETS)
PLATE = Plate(Box((0.1, 0.24, 0.03), (0.01, 0.0, -0.055)), 3.5e7)
SCENE = Scene(110.0, BARE, PERMEABLE, Drag(0.0, 0.0), plate=PLATE)
REGION = Region(np.array([-0.014, -0.004, 0.031]), np.array([-0.006, 0.004, 0.041]))
FIELD = rotor_table(BARE, "cuboid")
CURRENTS = RotorCurrents(ball_losses(pieces_of(MAGNETS, ()), degree=2))
SCALES = Scales.of(SCENE)


@pytest.fixture(scope="module")
def memory():
    """A rough plate off the axis: its table errs by some per cent, its identities do not."""
    return PlateMemory(
        PLATE, *PlateAround(PLATE, FIELD, REGION, (5.0, 250.0), 0.1, rule=MeshRule(2.0, 3.0, 3.0)).tables()
    )


@pytest.fixture(scope="module")
def braked():
    """The rotor's field and the currents in its cube, taken as a ball."""
    return Interaction(FIELD, (CURRENTS,))


@pytest.fixture(scope="module")
def rates(braked):
    return Rates(braked)


@pytest.fixture(scope="module")
def shaken(braked, memory, rates):
    alone = survey(SCENE, braked, rates=rates)
    return with_plate(SCENE, braked, Survey(alone.equilibria[:1], ()), memory, rates).equilibria[0]


@pytest.mark.slow
def test_multipliers_with_currents_in_the_rotor_are_the_growth_of_a_kicked_flight(shaken, braked, memory, rates):
    """One turn of small kicks, by the integrator, against Floquet's modes: 1e-6; the currents change them by more."""
    values = parameters(SCENE, SCALES, frozen_spin=True)
    force = PlateForce(memory, values)
    orbit = periodic_orbit(rates, values, 0.0, force, SCALES.pack(shaken.state))
    modes = floquet_modes(orbit)
    flight = Flight(SCENE, braked, 0.2, compact=True, memory=memory)
    integrator = flight.part(0).integrator
    currents = orbit.plate[0] / values[Parameter.PLATE_SHARE]
    middle = flight.begin(SCALES.unpack(orbit.states[0]), 0.2, currents).state

    def after_one_turn(state):
        integrator.time, integrator.state[:] = 0.0, state
        integrator.pars[:] = flight.values[: len(integrator.pars)]
        integrator.propagate_until(2 * np.pi)
        return integrator.state.copy()

    step, units = 1e-6, np.eye(len(middle))[:-1]
    kicks = [(after_one_turn(middle + step * u) - after_one_turn(middle - step * u))[:-1] / (2 * step) for u in units]
    multipliers = np.linalg.eigvals(np.transpose(kicks))
    for rate in modes.eigenvalues:
        assert np.abs(multipliers - np.exp(2 * np.pi * rate)).min() < 1e-6
    without = floquet_modes(periodic_orbit(Rates(FIELD), values, 0.0, force, SCALES.pack(shaken.state)))
    changes = [np.abs(modes.eigenvalues - rate).min() for rate in without.eigenvalues]
    assert max(changes) > 1e-5


@pytest.mark.slow
def test_the_ledger_closes_with_every_loss(shaken, memory):
    """Mutual magnetisation, both currents, real air and a sinking plate, after a kick: 1e-11 of the energy.

    With steps of 1e-12, as over plates by default, it is the steps' error: 1.3e-10, and 1.2e-11 with those of 1e-13.
    """
    answers = Mutual(cached_mutual_table(BARE, PERMEABLE, print)[0], PERMEABLE.moment)
    whole = Interaction(FIELD, (answers, CURRENTS))
    plate = replace(PLATE, lowering=Lowering(0.1, 0.02, 0.002))
    start = AbsoluteStart(*replace(shaken.start, velocity=shaken.start.velocity + np.array([0.01, 0.02, 0.03])).vectors)
    scene = replace(
        SCENE,
        floater=replace(PERMEABLE, conductivity=6.7e5),
        drag=replace(Drag.stokes(PERMEABLE.radius), air=True),
        plate=plate,
        start=start,
    )
    names = {effect.name for effect in with_effects(scene, whole).effects}
    assert names == {MUTUAL, ROTOR_CURRENTS, FLOATER_CURRENTS, REAL_AIR}
    flight = simulate(scene, whole, 0.3, tolerance=1e-14, memory=replace(memory, plate=plate))
    assert flight.ended_by == "duration"
    assert np.ptp(flight.lab.position[:, 2]) > 1e-4
    print(f"\n0.3 s with every loss: ledger {flight.energy_error:.1e}")
    assert flight.energy_error < 1e-11
