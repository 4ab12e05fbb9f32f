"""Speed of the core, each beside a peer in the same run; pytest-benchmark prints the ratios in brackets."""

from dataclasses import replace
from time import perf_counter, process_time

import magpylib
import numpy as np
import pytest
from peer_flight import fly
from scipy.spatial.transform import Rotation

from spinlev.dynamics import equilibrium_map, find_equilibria, rotor_family
from spinlev.dynamics.balance import EVERY, Balance, solve
from spinlev.dynamics.equations import parameters
from spinlev.dynamics.flight import compile_flight
from spinlev.dynamics.integration import integrate
from spinlev.dynamics.rates import Rates
from spinlev.dynamics.simulation import PLATE_TOLERANCE, initial_state
from spinlev.dynamics.stability import modes
from spinlev.dynamics.state import Scales
from spinlev.fem import RotorTable, uniform_moments
from spinlev.fem.models import rotor_table
from spinlev.fem.plate import plate_reaction
from spinlev.fem.plate_model import plate_table
from spinlev.fem.plate_region import Region
from spinlev.geometry import load_scene
from spinlev.geometry.box import Box
from spinlev.geometry.scene import Plate
from spinlev.studies.plate_shelf import plate_memory, table_in_flight

SCENE = load_scene("scenes/horizontal.toml")
GENERATOR = np.random.default_rng(0)
WAY = GENERATOR.normal(size=(100_000, 3))
POINTS = (
    SCENE.rotor[0].box.center
    + GENERATOR.uniform(0.013, 0.04, (100_000, 1)) * WAY / np.linalg.norm(WAY, axis=1)[:, None]
)
"""All around the magnet, 13 to 40 mm from its centre."""
PLATE = Plate(Box((0.1, 0.24, 0.03)), 3.5e7)


def peer(rotor):
    """The same magnets in magpylib."""
    return magpylib.Collection(
        *[
            magpylib.magnet.Cuboid(
                polarization=m.polarization,
                dimension=m.box.size,
                position=m.box.center,
                orientation=Rotation.from_matrix(m.box.rotation),
            )
            for m in rotor
        ]
    )


@pytest.mark.benchmark(group="100 000 points: B (magpylib) against B and its gradient (tables)")
@pytest.mark.parametrize("model", ["magpylib B only", "dipole", "cuboid", "moments to 13", "fem"])
def test_evaluation(benchmark, model):
    rotor = SCENE.rotor
    if model == "magpylib B only":
        magnets = peer(rotor)
        field = benchmark(lambda: magnets.getB(POINTS))
    elif model == "moments to 13":
        table = RotorTable("moments", rotor, (), tuple(uniform_moments(m, 13) for m in rotor))
        field = benchmark(lambda: table.evaluate(POINTS))[0]
    else:
        table = rotor_table(rotor, model, nearest=SCENE.floater.radius)
        field = benchmark(lambda: table.evaluate(POINTS))[0]
    assert np.isfinite(field).all()


@pytest.mark.benchmark(group="field solve from nothing, by relative accuracy asked")
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-5])
def test_field_solve(benchmark, rtol):
    table = benchmark.pedantic(rotor_table, (SCENE.rotor, "fem", rtol), rounds=1)
    assert table.provenance["elements"] > 0


@pytest.mark.benchmark(group="all equilibria and their stability, compiled")
@pytest.mark.parametrize("model", ["dipole", "cuboid", "fem"])
def test_equilibria(benchmark, model):
    table = rotor_table(SCENE.rotor, model)
    rates = Rates(table)
    found = benchmark.pedantic(lambda: find_equilibria(SCENE, table, rates=rates), rounds=3, warmup_rounds=1)
    assert any(equilibrium.stable for equilibrium in found)


@pytest.mark.benchmark(group="one equilibrium near a guess and its stability, compiled")
@pytest.mark.parametrize("model", ["dipole", "cuboid", "fem"])
def test_one_equilibrium(benchmark, model):
    table = rotor_table(SCENE.rotor, model, nearest=SCENE.floater.radius)
    rates, scales = Rates(table), Scales.of(SCENE)
    near = next(e for e in find_equilibria(SCENE, table, rates=rates) if e.stable)
    guess = scales.pack(near.state) + 0.02
    balance = Balance(rates, parameters(SCENE, scales, frozen_spin=True), 0.0)

    def found():
        position, moment, step = solve(balance, guess[None, :3], guess[None, 6:9], EVERY)
        state = balance.states(position, moment)
        return step, modes(state[0], rates(state, balance.values)[1][0])

    step, motion = benchmark(found)
    assert step[0] < 1e-8
    assert motion.stable


@pytest.mark.benchmark(group="map of 100 x 100, all equilibria and their stability, one process")
@pytest.mark.parametrize("model", ["dipole", "cuboid", "fem"])
def test_map(benchmark, model):
    family = rotor_family(SCENE, "horizontal", model, nearest=SCENE.floater.radius)
    axes = np.linspace(50.0, 250.0, 100), np.linspace(1e-3, 8e-3, 100)
    assert family.rates is not None  # compiled
    found = benchmark.pedantic(equilibrium_map, (family, *axes), rounds=1)
    print(f"\n{model}: {len(found.row)} equilibria, {found.stable.sum()} of them stable")
    assert found.stable.any()


@pytest.mark.benchmark(group="one second of flight at 110 Hz, tolerance 1e-14, compiled")
@pytest.mark.parametrize("compact", [True, False], ids=["loops", "straight code"])
@pytest.mark.parametrize("model", ["dipole", "cuboid", "fem"])
def test_flight(benchmark, model, compact):
    table = rotor_table(SCENE.rotor, model, nearest=SCENE.floater.radius)
    if model == "fem" and not compact:
        pytest.skip("straight code for the expansion takes minutes to compile")
    start, _ = initial_state(SCENE, table)
    flight = compile_flight(SCENE, table, 1.0, 1e-14, compact)
    trajectory = benchmark.pedantic(lambda: integrate(SCENE, flight, start, 1.0, None), rounds=3, warmup_rounds=1)
    print(f"\n{model}: compiled in {flight.compile_seconds:.1f} s, {trajectory.realtime_factor:.0f} x real time")
    assert trajectory.ended_by == "duration"


@pytest.mark.parametrize(("plate_model", "rtol"), [("reduced", 3e-3), ("slab", 2e-4)], ids=["30 states", "80 states"])
@pytest.mark.parametrize("model", ["cuboid", "fem"])
def test_flight_with_plate(model, plate_model, rtol):
    """Simulated time by processor time, of a floater that does not rest, at the tolerance that `simulate` uses."""
    table = rotor_table(SCENE.rotor, model, nearest=SCENE.floater.radius)
    start, _ = initial_state(replace(SCENE, plate=None), table)
    memory, _ = plate_memory(SCENE, SCENE.plate, plate_model, table, start.position, rtol)
    table = table_in_flight(SCENE, table, start.position, 3e-6)
    flight = compile_flight(SCENE, table, 0.5, PLATE_TOLERANCE, True, memory)
    still = np.zeros(len(memory.table.rates))
    integrate(SCENE, flight, start, 0.05, currents=still)
    began = process_time()
    flown = integrate(SCENE, flight, start, 0.5, currents=still)
    speed = 0.5 / (process_time() - began)
    print(
        f"\n{model}, {plate_model}: {len(still)} states, {len(memory.table.multipoles.kinds)} multipoles, "
        f"{len(memory.share.series) // 2} harmonics; {flown.steps / (0.5 * SCENE.frequency):.1f} steps a turn, "
        f"{speed:.1f} x real time; ledger {flown.energy_error:.0e}"
    )
    assert flown.ended_by == "duration"


def test_flight_against_scipy():
    """Wall time of a simulated second, SciPy's and ours, and the errors of both after two turns; ratio printed."""
    scene = replace(SCENE, plate=None, drag=replace(SCENE.drag, linear=0.0, angular=0.0))
    table, duration = rotor_table(scene.rotor, "cuboid"), 2 / scene.frequency
    start, _ = initial_state(scene, table)
    flights = {tol: compile_flight(scene, table, 1.0, tol, compact=False) for tol in (1e-14, 1e-16)}
    ends = {tol: integrate(scene, flight, start, duration, None).rotor for tol, flight in flights.items()}
    ours = 1 / integrate(scene, flights[1e-14], start, 2.0, None).realtime_factor
    exact = ends[1e-16].position[-1]
    error = np.abs(ends[1e-14].position[-1] - exact).max()
    magnets = peer(scene.rotor)
    for rtol in (1e-13, 1e-10):
        began = perf_counter()
        end = fly(scene, magnets, start, duration, rtol)
        theirs, wrong = (perf_counter() - began) / duration, np.abs(end[:3] - exact).max()
        print(f"\nDOP853 at {rtol:g}: {theirs:.3g} s a second, error {wrong:.1e} m")
        print(f"ours: {ours:.3g} s a second, error {error:.1e} m")
        print(f"{theirs / ours:.0f} times faster")
        assert error < wrong


@pytest.mark.benchmark(group="plate, 100 Hz, 1e-3: ten places 12 to 30 mm over the face and three directions")
def test_plate_reaction(benchmark):
    places = np.random.default_rng(1).uniform((-0.01, -0.01, 0.027), (0.01, 0.01, 0.045), (10, 3))
    found = benchmark.pedantic(plate_reaction, (PLATE, places, 100.0, 1e-3), rounds=1)
    assert found.error_estimate.max() <= 1e-3


@pytest.mark.benchmark(group="plate's table from nothing: 10 to 40 mm over the face, ±5 mm, 0.5 to 250 Hz, 1e-3")
def test_plate_table(benchmark):
    region = Region.over_face(PLATE.box.size, (0.01, 0.04), 0.005)
    table = benchmark.pedantic(plate_table, (PLATE, region, (0.5, 250.0), 1e-3), rounds=1)
    assert table.errors.total <= 1e-3
