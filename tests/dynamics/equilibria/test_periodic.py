"""Periodic motions in tilted gravity and over a plate: where they end, and their growth against kicked flights."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER

from spinlev.dynamics.equilibria.equilibrium import Survey
from spinlev.dynamics.equilibria.search import find_equilibria, survey, with_plate
from spinlev.dynamics.flights.flight import Flight, integrate
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import horizontal, vertical
from spinlev.geometry.scene.contents import Drag, Plate, Scene
from spinlev.geometry.shapes import Box

VERTICAL = Scene(80.0, vertical(14e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
HORIZONTAL = Scene(110.0, horizontal(2e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.056)), 3.5e7)
REGION = Region(np.array([-0.004, -0.004, 0.024]), np.array([0.004, 0.004, 0.041]))


def tilted(angle):
    return replace(VERTICAL, gravity=9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)]))


@pytest.mark.slow
def test_tilted_gravity_ends_levitation_in_a_fold():
    """0.81° is the most that the vertical rotor bears at 14 mm and 80 Hz."""
    table = rotor_table(VERTICAL.rotor, "dipole")
    rates = Rates(table)
    for angle, expected in ((0.80, [True]), (0.82, [])):
        found = find_equilibria(tilted(np.radians(angle)), table, rates=rates)
        assert [e.stable for e in found if abs(e.position[2] + 26.2e-3) < 0.5e-3][:1] == expected


@pytest.fixture(scope="module")
def over_slab():
    """The horizontal rotor over an endless plate, and some of its equilibria with it."""
    table = rotor_table(HORIZONTAL.rotor, "cuboid")
    rates = Rates(table)
    scene = replace(HORIZONTAL, plate=PLATE)
    memory = PlateMemory(PLATE, *PlateAround(PLATE, table, REGION, rtol=3e-2, slab=True).tables(), "slab")
    known = survey(scene, table, rates=rates)
    near = [e for e in known.equilibria if e.position[2] > -32e-3 and (e.stable or e.growth_per_s < 200)]
    return scene, table, memory, with_plate(scene, table, Survey(tuple(near), ()), memory, rates)


@pytest.mark.slow
def test_growth_with_a_plate_is_that_of_kicked_flights(over_slab):
    """One stable and one unstable equilibrium: rates measured after every turn of a flight agree to 1 %."""
    scene, table, memory, found = over_slab
    assert {e.stable for e in found.equilibria} == {True, False}
    for equilibrium in found.equilibria:
        measured = measured_growth(scene, table, memory, equilibrium)
        assert measured == pytest.approx(equilibrium.growth_per_s, rel=0.01)


def measured_growth(scene, table, memory, equilibrium):
    """Rate at which a small kick grows or dies out in a flight, 1/s: of the map of a turn that fits the flight best.

    Ten deviations are free, since |m̂| and the body spin are kept; the plate's own have died out after some turns.
    """
    duration = 1.5 if equilibrium.stable else 8 / equilibrium.growth_per_s
    scales = Scales.of(scene)
    start = scales.pack(equilibrium.start)
    kick = (1e-6 if equilibrium.stable else 1e-8) * np.random.default_rng(4).normal(size=12)
    kick[6:] = 0.0
    flight = Flight(scene, table, duration, compact=True, memory=memory)
    flown = integrate(flight, scales.unpack(start + kick), duration, currents=equilibrium.currents[0])
    turns = np.isclose(flown.time * scene.frequency, np.round(flown.time * scene.frequency), atol=1e-7)
    away = (scales.pack(flown.rotor)[turns] - start)[20:]
    if not equilibrium.stable:
        return np.polyfit(np.arange(len(away)), np.log(np.linalg.norm(away, axis=1)), 1)[0] * scene.frequency
    directions = np.linalg.svd(away, full_matrices=False)[2][:10]
    here, ahead = away[:-1] @ directions.T, away[1:] @ directions.T
    multipliers = np.linalg.eigvals(np.linalg.lstsq(here, ahead, rcond=None)[0])
    return np.log(np.abs(multipliers).max()) * scene.frequency
