"""Periodic motions in a parameter, against motions found at single values of it; growth against kicked flights."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER

from spinlev.dynamics.continuation.boundary import DOUBLING, ORBIT_STEPS, TORUS, OrbitFamily, kind_of
from spinlev.dynamics.continuation.engine import REAL, follow_branch
from spinlev.dynamics.equilibria.equilibrium import FOLD, EquilibriumError, Survey
from spinlev.dynamics.equilibria.orbits import periodic_orbit, resampled
from spinlev.dynamics.equilibria.search import find_equilibria, survey, with_plate
from spinlev.dynamics.flights.compiled import compile_flight
from spinlev.dynamics.flights.flight import integrate
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.plate import PlateForce, PlateMemory
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Parameter, Scales
from spinlev.fem.plate.region import Region
from spinlev.fem.plate.slab_network import slab_and_rotor_table
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry import rotor
from spinlev.geometry.scene.contents import Drag, Lowering, Plate, Scene
from spinlev.geometry.shapes import Box

VERTICAL = Scene(80.0, rotor.vertical(14e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
HORIZONTAL = Scene(110.0, rotor.horizontal(2e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.056)), 3.5e7, Lowering(0.0, 0.02, 0.002))
REGION = Region(np.array([-0.004, -0.004, 0.024]), np.array([0.004, 0.004, 0.041]))


def tilted(angle):
    return replace(VERTICAL, gravity=9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)]))


@pytest.fixture(scope="module")
def leaning():
    """The vertical rotor's stable motion, followed while gravity is tilted."""
    table = rotor_table(VERTICAL.rotor, "dipole")
    rates, scales = Rates(table), Scales.of(VERTICAL)
    start = next(e for e in find_equilibria(VERTICAL, table, rates=rates) if e.stable)
    family = OrbitFamily(rates, lambda a: (parameters(tilted(a), scales, frozen_spin=True), None), 0.0, 0.1)
    states = np.tile(scales.pack(start.state), (17, 1))
    return table, rates, family, follow_branch(family, states, 0.0, 0.1, ORBIT_STEPS)


@pytest.mark.slow
def test_tilted_gravity_ends_levitation_in_a_fold(leaning):
    """0.81° is the most that the vertical rotor bears at 14 mm and 80 Hz; motions found on their own say the same."""
    table, rates, _, points = leaning
    (fold,) = [p for p in points if p.kind == FOLD]
    assert np.degrees(fold.parameter) == pytest.approx(0.81, abs=0.01)
    assert abs(fold.leaving - 1) < 1e-3
    for part, expected in ((0.999, [True]), (1.001, [])):
        found = find_equilibria(tilted(part * fold.parameter), table, rates=rates)
        assert [e.stable for e in found if abs(e.position[2] + 26.2e-3) < 0.5e-3][:1] == expected


@pytest.mark.slow
def test_beyond_the_fold_it_comes_back_to_upright_gravity_off_the_axis(leaning):
    """There the floater hangs beside the axis, in balance but unstable: flown for five turns it comes back."""
    table, _, _, points = leaning
    assert points[-1].parameter == 0.0
    start, period = Scales.of(VERTICAL).unpack(points[-1].states[0]), 1 / VERTICAL.frequency
    flown = integrate(VERTICAL, compile_flight(VERTICAL, table, 5 * period, compact=True), start, 5 * period)
    assert np.abs(flown.rotor.position[-1] - start.position).max() < 1e-9
    assert np.hypot(*flown.lab.position.mean(axis=0)[:2]) > 3e-3
    assert abs(points[-1].leaving) > 1.05


def test_a_point_of_the_branch_is_a_periodic_motion(leaning):
    _, rates, family, points = leaning
    point = next(p for p in points if p.parameter > 0.005)
    alone = periodic_orbit(rates, family.problem(point.parameter)[0], 0.0, None, point.states[0])
    np.testing.assert_allclose(resampled(point.states, len(alone.states)), alone.states, atol=1e-7)
    with pytest.raises(EquilibriumError, match="near a periodic motion"):
        follow_branch(family, point.states + 3.0, 0.0, 0.1, ORBIT_STEPS)


def test_kinds_of_loss():
    assert [kind_of(m) for m in (1.01, -1.01, 0.8 + 0.7j)] == [REAL, DOUBLING, TORUS]


@pytest.fixture(scope="module")
def over_slab():
    """The horizontal rotor over an endless plate: rates, equilibria with it, its memory, and the standing plate's."""
    table = rotor_table(HORIZONTAL.rotor, "cuboid")
    rates = Rates(table)
    share = slab_and_rotor_table(PLATE, table, REGION, rtol=3e-2)
    memory = PlateMemory(PLATE, *share, "slab")
    scene = replace(HORIZONTAL, plate=replace(PLATE, lowering=None))
    standing = PlateMemory(scene.plate, *slab_and_rotor_table(scene.plate, table, REGION, rtol=3e-2), "slab")
    known = survey(scene, table, rates=rates)
    near = [e for e in known.equilibria if e.position[2] > -32e-3 and (e.stable or e.growth_per_s < 200)]
    return scene, table, rates, memory, standing, with_plate(scene, table, Survey(tuple(near), ()), standing, rates)


@pytest.mark.slow
def test_distance_of_the_plate_as_parameter(over_slab):
    """Two millimetres away from the floater, against the motion found there directly: 1e-9 radii."""
    _, _, rates, memory, _, found = over_slab
    base, scales = parameters(HORIZONTAL, Scales.of(HORIZONTAL), frozen_spin=True), Scales.of(HORIZONTAL)

    def problem(depth):
        values = base.copy()
        values[Parameter.PLATE_DEPTH] = depth / scales.length
        return values, PlateForce(memory, values)

    start = np.tile(scales.pack(found.equilibria[0].state), (9, 1))
    points = follow_branch(OrbitFamily(rates, problem, 0.0, 5e-3), start, 0.0, 2e-3, ORBIT_STEPS)
    assert points[-1].parameter == 2e-3
    values, plate = problem(2e-3)
    alone = periodic_orbit(rates, values, 0.0, plate, start[0])
    np.testing.assert_allclose(points[-1].states.mean(axis=0), alone.states.mean(axis=0), atol=1e-9)
    assert np.abs(points[-1].states[0] - points[0].states[0]).max() > 1e-3


@pytest.mark.slow
def test_growth_with_a_plate_is_that_of_kicked_flights(over_slab):
    """One stable and one unstable equilibrium: rates measured after every turn of a flight agree to 1 %."""
    scene, table, _, _, memory, found = over_slab
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
    flight = compile_flight(scene, table, duration, compact=True, memory=memory)
    flown = integrate(scene, flight, scales.unpack(start + kick), duration, currents=equilibrium.currents[0])
    turns = np.isclose(flown.time * scene.frequency, np.round(flown.time * scene.frequency), atol=1e-7)
    away = (scales.pack(flown.rotor)[turns] - start)[20:]
    if not equilibrium.stable:
        return np.polyfit(np.arange(len(away)), np.log(np.linalg.norm(away, axis=1)), 1)[0] * scene.frequency
    directions = np.linalg.svd(away, full_matrices=False)[2][:10]
    here, ahead = away[:-1] @ directions.T, away[1:] @ directions.T
    multipliers = np.linalg.eigvals(np.linalg.lstsq(here, ahead, rcond=None)[0])
    return np.log(np.abs(multipliers).max()) * scene.frequency
