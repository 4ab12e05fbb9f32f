"""Flights beside SciPy's DOP853 with magpylib's field; × real time is printed with -s."""

from dataclasses import replace
from time import process_time

import numpy as np
import pytest
from peer_flight import fly
from peers import SCENE, magpylib_rotor

from spinlev.dynamics.equilibria.search import survey, with_plate
from spinlev.dynamics.flights.batch import ensemble
from spinlev.dynamics.flights.flight import PLATE_TOLERANCE, Flight, displaced, initial_state, integrate
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import State
from spinlev.fem.plate.choice import rotor_nearby
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.contents import AbsoluteStart
from spinlev.geometry.scene.files import load_scene
from spinlev.geometry.shapes import Box, Cylinder
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation
from spinlev.studies.plan import PlatePlan

FREE = replace(SCENE, plate=None, drag=replace(SCENE.drag, linear=0.0, angular=0.0))
LONG = 20.0
"""A flight that is so long, s, has its code optimised; what is timed is flown with such code."""
TURNS = 2
"""Of the peer's flight."""
ROUNDS = 5
"""Of a sphere's and a cube's flights in turn."""
EFFECTS = ("rigid", "mutual", "metal", "mutual and metal")
PLATES = [("reduced", 3e-3), ("slab", 2e-4)]
"""Plate models and their accuracies."""


@pytest.fixture(scope="module")
def start():
    """Near the equilibrium in the closed form's field."""
    return initial_state(FREE, rotor_table(SCENE.rotor, "cuboid"))[0]


@pytest.mark.benchmark(group="a simulated second at 110 Hz")
@pytest.mark.parametrize("rtol", [1e-10, 1e-13], ids=["DOP853 + magpylib, 1e-10", "DOP853 + magpylib, 1e-13"])
def test_flight_against_scipy(benchmark, start, rtol):
    """Time a simulated second, and the error after two turns against our tightest flight."""
    exact = integrate(Flight(FREE, rotor_table(SCENE.rotor, "cuboid"), 1.0, 1e-16, False), start,
                      TURNS / FREE.frequency, None).rotor.position[-1]  # fmt: skip
    magnets = magpylib_rotor(SCENE.rotor)
    benchmark.extra_info.update(peer=rtol == 1e-13, count=TURNS / FREE.frequency)
    end = benchmark.pedantic(fly, (FREE, magnets, start, TURNS / FREE.frequency, rtol), rounds=1)
    error = float(np.abs(end[:3] - exact).max())
    benchmark.extra_info["error"] = f"{error:.1e} m in {TURNS} turns"
    print(f"\nDOP853 at {rtol:g}: error {error:.1e} m after {TURNS} turns")
    assert error < 1e-11


@pytest.mark.benchmark(group="a simulated second at 110 Hz")
@pytest.mark.parametrize("compact", [True, False], ids=["loops", "straight code"])
@pytest.mark.parametrize("model", ["dipole", "cuboid", "fem"])
def test_flight(benchmark, start, model, compact):
    """Without plate and drag; compiled as loops or as straight code, which takes longer to compile."""
    if model == "fem" and not compact:
        pytest.skip("straight code for the expansion takes minutes to compile")
    table = rotor_table(SCENE.rotor, model, nearest=SCENE.floater.radius)
    flight = Flight(FREE, table, LONG, 1e-14, compact)
    trajectory = benchmark.pedantic(lambda: integrate(flight, start, 1.0, None), rounds=3, warmup_rounds=1)
    print(f"\n{model}: compiled in {flight.compile_seconds:.1f} s, {trajectory.realtime_factor:.0f} x real time")
    benchmark.extra_info["error"] = f"energy balance {trajectory.energy_error:.0e} in 110 turns"
    assert trajectory.ended_by == "duration"


@pytest.mark.benchmark(group="a simulated second at 110 Hz")
@pytest.mark.parametrize("compact", [True, False], ids=["fem in balls, loops", "fem in balls, straight code"])
def test_flight_in_balls(benchmark, start, compact):
    """As `simulate` flies with finite elements."""
    table = rotor_table(SCENE.rotor, "fem", nearest=SCENE.floater.radius)
    flight = Flight(FREE, table, LONG, compact=compact)
    trajectory = benchmark.pedantic(lambda: integrate(flight, start, 1.0, None), rounds=3, warmup_rounds=1)
    benchmark.extra_info["error"] = f"energy balance {trajectory.energy_error:.0e} in 110 turns"
    assert trajectory.ended_by == "duration"


@pytest.mark.benchmark(group="a simulated second at 110 Hz")
@pytest.mark.parametrize("effects", EFFECTS, ids=[f"fem in balls, {effects}" for effects in EFFECTS])
def test_flight_with_effects(benchmark, start, effects):
    """What effects cost in balls, with finite elements."""
    scene = FREE
    if "metal" in effects:
        scene = replace(FREE, rotor=tuple(replace(magnet, conductivity=6.7e5) for magnet in FREE.rotor))
    levitation = Levitation(scene, Models("fem", "none", interaction="mutual" if "mutual" in effects else "rigid"))
    flight = Flight(scene, levitation.interaction, LONG, compact=True)
    trajectory = benchmark.pedantic(lambda: integrate(flight, start, 1.0, None), rounds=3, warmup_rounds=1)
    operations = [len(part.integrator.decomposition) for part in flight.parts.values()]
    print(f"\n{effects}: {operations} operations, {trajectory.realtime_factor:.0f} x real time")
    benchmark.extra_info["error"] = f"energy balance {trajectory.energy_error:.0e} in 110 turns"
    assert trajectory.ended_by == "duration"


@pytest.mark.benchmark(group="a simulated second of a cube")
@pytest.mark.parametrize("effects", ["rigid", "mutual"])
@pytest.mark.parametrize("name", ["horizontal", "explicit-magnets", "tilt-over-plate", "vertical-24h"])
def test_flight_of_a_cube(benchmark, name, effects):
    """A cube of the sphere's volume, without plate and drag: beside the sphere, each in turn, by optimised code."""
    scene = load_scene(f"scenes/{name}.toml")
    scene = replace(scene, plate=None, drag=FREE.drag)
    edge = scene.floater.volume ** (1 / 3)
    cube = replace(scene.floater, radius=edge * 3**0.5 / 2, body=Box((edge,) * 3))
    flights = []
    for one in (scene, replace(scene, floater=cube)):
        levitation = Levitation(one, Models("fem", "none", interaction=effects))
        begun = initial_state(one, levitation.interaction, levitation.equilibria)[0]
        flights.append((Flight(one, levitation.interaction, LONG), begun))
        integrate(*flights[-1], 0.1)
    times = np.zeros((ROUNDS, 2))
    for row in times:
        for k, flight in enumerate(flights):
            before = process_time()
            integrate(*flight, 5.0)
            row[k] = process_time() - before
    trajectory = benchmark.pedantic(lambda: integrate(*flights[1], 1.0), rounds=3)
    sphere, own = times.min(axis=0) / 5.0
    operations = [len(next(iter(flight.parts.values())).integrator.decomposition) for flight, _ in flights]
    print(
        f"\n{name}, {effects}: a second of the sphere takes {1e3 * sphere:.1f} ms, of the cube {1e3 * own:.1f} ms, "
        f"{own / sphere:.2f} times as long; {operations[0]} and {operations[1]} operations, "
        f"{trajectory.steps / scene.frequency:.1f} steps a turn of the cube"
    )
    benchmark.extra_info["error"] = f"energy balance {trajectory.energy_error:.0e} in {scene.frequency:.0f} turns"
    assert trajectory.ended_by == "duration"


@pytest.mark.benchmark(group="a simulated second at 110 Hz")
def test_flights_side_by_side(benchmark, start):
    """64 flights in the lanes of one core, with finite elements."""
    table = rotor_table(SCENE.rotor, "fem", nearest=SCENE.floater.radius)
    offset = 3e-5 * np.random.default_rng(0).normal(size=(64, 3))
    turning = np.cross([0.0, 0.0, SCENE.angular_velocity], offset)
    same = (np.tile(v, (64, 1)) for v in (start.moment, start.spin))
    starts = State(start.position + offset, start.velocity + turning, *same)
    benchmark.extra_info.update(count=64.0)
    flown = benchmark.pedantic(lambda: ensemble(FREE, table, starts, 1.0), rounds=2, warmup_rounds=1)
    assert set(flown.ended_by) == {"duration"}


@pytest.mark.parametrize("shape", ["sphere", "cylinder", "cube"])
def test_bodies_side_by_side(shape):
    """What a trajectory of an ensemble costs beside one alone, both in balls: 64 of 2 s that stay in theirs."""
    edge, body = FREE.floater.volume ** (1 / 3), None
    if shape != "sphere":
        body = Box((edge,) * 3) if shape == "cube" else Cylinder(6e-3, FREE.floater.volume / np.pi / 36e-6)
    radius = FREE.floater.radius if body is None else body.circumradius
    scene = replace(FREE, floater=replace(FREE.floater, radius=radius, body=body))
    levitation = Levitation(scene, Models("cuboid", "none", interaction="rigid"))
    begun = initial_state(scene, levitation.interaction, levitation.equilibria)[0]
    offset = 2e-5 * np.random.default_rng(0).normal(size=(64, 3))
    starts = displaced(begun, offset, scene.angular_velocity)
    told = replace(scene, start=AbsoluteStart(*starts[0].vectors))
    flight = Flight(told, levitation.interaction, 2.0, compact=True, in_balls=True)
    times = np.zeros((ROUNDS, 2))
    for row in times:
        for k, simulated in enumerate(
            (
                lambda: integrate(flight, starts[0], 2.0),
                lambda: ensemble(scene, levitation.interaction, starts, 2.0),
            )
        ):
            before = process_time()
            found = simulated()
            row[k] = process_time() - before
    alone, many = times.min(axis=0)
    print(
        f"\n{shape}: a second takes {500 * alone:.0f} ms alone, {500 * many / 64:.0f} ms as one of 64: "
        f"{64 * alone / many:.1f} times as fast; {found.changes.sum()} changes of balls; {found}"
    )
    assert set(found.ended_by) == {"duration"}
    assert 64 * alone > 2 * many


@pytest.mark.benchmark(group="a simulated second at 110 Hz")
@pytest.mark.parametrize(("plate_model", "rtol"), PLATES, ids=["network", "slab"])
@pytest.mark.parametrize("model", ["cuboid", "fem"])
def test_flight_with_plate(benchmark, start, model, plate_model, rtol):
    """A floater that hangs over the plate's currents, at the tolerance and in the fields that `simulate` uses."""
    table = rotor_table(SCENE.rotor, model, nearest=SCENE.floater.radius)
    levitation = Levitation(SCENE, Models(model, interaction="rigid"))
    memory = levitation.plate_about(start.position, PlatePlan(plate_model, 0.0, rtol))
    table = rotor_nearby(table, SCENE.rotor, tuple(start.position.tolist()), SCENE.floater.radius, 3e-6)
    equilibria = with_plate(SCENE, table, survey(SCENE, table), memory, Rates(table)).equilibria
    begun, currents = initial_state(SCENE, table, equilibria, memory)
    flight = Flight(SCENE, table, LONG, PLATE_TOLERANCE, True, memory)
    integrate(flight, begun, 0.05, currents=currents)
    fly_on = lambda: integrate(flight, begun, 0.5, currents=currents)  # noqa: E731
    flown = benchmark.pedantic(fly_on, rounds=3)
    benchmark.extra_info.update(count=0.5, error=f"energy balance {flown.energy_error:.0e}, {len(currents)} states")
    print(
        f"\n{model}, {plate_model}: {len(currents)} states, {len(memory.table.multipoles.kinds)} multipoles, "
        f"{len(memory.share.series) // 2} harmonics; {flown.steps / (0.5 * SCENE.frequency):.1f} steps a turn, "
        f"{0.5 / benchmark.stats.stats.min:.1f} x real time; energy balance {flown.energy_error:.0e}"
    )
    assert flown.ended_by == "duration"
