"""How the time grows with the size of each job; `ratios.py` fits the exponents."""

from dataclasses import replace

import numpy as np
import pytest
from peers import PLATE, SCENE, around, moved_rotors

from spinlev.dynamics.continuation.map import equilibrium_map
from spinlev.dynamics.flights.flight import PLATE_TOLERANCE, Flight, initial_state, integrate
from spinlev.fem.closed_forms.moments import carriers_of
from spinlev.fem.closed_forms.potentials import unit_dipoles
from spinlev.fem.elements.ladder import refinement_of, solve_rotor
from spinlev.fem.plate.eddy import solve_eddy
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.meshes.magnets import MeshSettings
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation
from spinlev.studies.plan import PlatePlan

FREE = replace(SCENE, plate=None, drag=replace(SCENE.drag, linear=0.0, angular=0.0))
LONG = 20.0
"""A flight that is so long, s, has its code optimised; what is timed is flown with such code."""


@pytest.mark.benchmark(group="scaling: points of a table (finite elements)")
@pytest.mark.parametrize("points", [100, 1_000, 10_000, 100_000, 1_000_000])
def test_points(benchmark, points):
    """B and its gradient by the table of finite elements."""
    table = rotor_table(SCENE.rotor, "fem", nearest=SCENE.floater.radius)
    places = around(SCENE.rotor[0], points)
    benchmark.extra_info["size"] = points
    assert np.isfinite(benchmark.pedantic(table.evaluate, (places,), rounds=5, warmup_rounds=1)[0]).all()


@pytest.mark.benchmark(group="scaling: unknowns of the rotor's field")
@pytest.mark.parametrize("order", [3, 4, 5, 6, 7, 8])
def test_field_unknowns(benchmark, order):
    """Assembly and solution of the permeable magnets by elements of rising order."""
    carriers = carriers_of(SCENE.rotor)

    def solved():
        return solve_rotor(SCENE.rotor, refinement_of(order, MeshSettings()), "split", 6 + 4 * order, carriers=carriers)

    benchmark.extra_info["size"] = benchmark.pedantic(solved, rounds=2).unknowns


@pytest.mark.benchmark(group="scaling: unknowns of the plate's currents, one place, 100 Hz")
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_plate_unknowns(benchmark, order):
    """Assembly and solution of the eddy currents by elements of rising order."""
    body = np.array([[0.003, 0.002, 0.035]])
    mesh = plate_mesh(PLATE.body, PLATE.conductivity, body, 100.0, MeshRule())
    found = benchmark.pedantic(solve_eddy, (mesh, order, 100.0, unit_dipoles(body)), rounds=1)
    benchmark.extra_info["size"] = found.coupling_unknowns


@pytest.mark.benchmark(group="scaling: states of the plate in a flight of 0.2 s")
@pytest.mark.parametrize("rtol", [1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4])
def test_states(benchmark, rtol):
    """A flight over a plate whose network has more and more states."""
    table = rotor_table(SCENE.rotor, "cuboid", nearest=SCENE.floater.radius)
    start, _ = initial_state(FREE, table)
    memory = Levitation(SCENE, Models("cuboid")).plate_about(start.position, PlatePlan("slab", 0.0, rtol))
    flight = Flight(SCENE, table, LONG, PLATE_TOLERANCE, True, memory)
    still = np.zeros(len(memory.table.rates))
    flown = benchmark.pedantic(lambda: integrate(flight, start, 0.2, currents=still), rounds=10, warmup_rounds=1)
    benchmark.extra_info["size"] = len(still)
    assert flown.ended_by == "duration"


@pytest.mark.benchmark(group="scaling: turns of a flight (dipole)")
@pytest.mark.parametrize("turns", [100, 1_000, 10_000, 100_000])
def test_turns(benchmark, turns):
    """Flights that last longer and longer."""
    table = rotor_table(SCENE.rotor, "dipole")
    start, _ = initial_state(FREE, table)
    duration = turns / FREE.frequency
    flight = Flight(FREE, table, LONG, 1e-14, True)
    benchmark.extra_info["size"] = turns
    flown = benchmark.pedantic(lambda: integrate(flight, start, duration, None), rounds=2, warmup_rounds=0)
    assert flown.ended_by == "duration"


@pytest.mark.benchmark(group="scaling: points of a map of equilibria (dipole)")
@pytest.mark.parametrize("side", [10, 20, 40, 80])
def test_grid(benchmark, side):
    """Maps with more and more points."""
    benchmark.extra_info["size"] = side**2
    columns = moved_rotors(np.linspace(1e-3, 8e-3, side))
    found = benchmark.pedantic(equilibrium_map, (*columns, np.linspace(50.0, 250.0, side)), rounds=1)
    assert found.stable.any()
