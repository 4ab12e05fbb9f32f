"""Equilibria, their stability and maps of them, beside SciPy's least squares with magpylib's field."""

import numpy as np
import pytest
from peers import SCENE, magpylib_rotor, moved_rotors, scipy_equilibria, scipy_equilibrium

from spinlev.dynamics.continuation.map import equilibrium_map
from spinlev.dynamics.equilibria.balance import EVERY, Balance, solve
from spinlev.dynamics.equilibria.equilibrium import modes
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli.options import Models, shipped_scene
from spinlev.studies.gradient import ANSWERS, Gradient
from spinlev.studies.levitation import Levitation
from spinlev.studies.page.state import first_state
from spinlev.studies.page.work import preview

HORIZONTAL = shipped_scene("horizontal")
PEER = "least squares + magpylib, no stability"
MODELS = ["dipole", "cuboid", "fem"]
ONE, ALL, MAP = (
    "one equilibrium near a guess and its stability, compiled",
    "all equilibria of a scene from nothing and their stability, compiled",
    "map of 100 × 100, all equilibria and their stability: for each of them",
)


@pytest.mark.benchmark
@pytest.mark.parametrize("group", [ONE, MAP], ids=["one", "map"])
def test_peer(benchmark, group):
    """One equilibrium from a guess 0.02 radii away, to the same place as ours."""
    benchmark.group = group
    benchmark.extra_info["peer"] = True
    benchmark.name = PEER
    best = next(e for e in find_equilibria(SCENE, rotor_table(SCENE.rotor, "cuboid")) if e.stable)
    magnets, guess = magpylib_rotor(SCENE.rotor), best.position + 0.02 * SCENE.floater.radius
    arguments = (SCENE, magnets, guess, best.state.moment)
    found = benchmark.pedantic(scipy_equilibrium, arguments, rounds=10, warmup_rounds=1)
    # Air drag, which the peer leaves out, makes the moment lag by microradians
    assert np.abs(found - best.position).max() < 1e-8


@pytest.mark.benchmark(group=ALL)
@pytest.mark.parametrize("starts", [10, 40], ids=lambda starts: f"least squares + magpylib from {starts} places")
def test_search_by_least_squares(benchmark, starts):
    """Cuboid, as many starts as it takes; no stability."""
    magnets = magpylib_rotor(SCENE.rotor)
    found = benchmark.pedantic(scipy_equilibria, (SCENE, magnets, starts), rounds=1)
    benchmark.extra_info.update(peer=starts == 40, error=f"{len(found)} found")
    assert len(found)


@pytest.mark.benchmark(group=ALL)
@pytest.mark.parametrize("model", MODELS)
def test_equilibria(benchmark, model):
    """A search that knows nothing, for each field model; it must find the stable one."""
    table = rotor_table(SCENE.rotor, model, nearest=SCENE.floater.radius)
    rates = Rates(table)
    found = benchmark.pedantic(lambda: find_equilibria(SCENE, table, rates=rates), rounds=3, warmup_rounds=1)
    below = [equilibrium for equilibrium in found if equilibrium.position[2] < -0.011]
    benchmark.extra_info["error"] = f"{len(found)} found, {len(below)} below the rotor"
    assert any(equilibrium.stable for equilibrium in found)


@pytest.mark.benchmark(group=ALL)
@pytest.mark.parametrize("model", ["dipole", "cuboid"])
def test_gradient(benchmark, model):
    """Derivatives of all these equilibria and their modes by all numbers of the scene file."""
    levitation = Levitation(HORIZONTAL, Models(model, "none"))
    gradient, known = Gradient(levitation), levitation.equilibria
    keys = gradient.checked_keys(None)
    found = benchmark.pedantic(lambda: gradient.dataset(known, list(ANSWERS), keys), rounds=3, warmup_rounds=1)
    benchmark.extra_info["error"] = f"by {len(keys)} numbers, of {len(known)}"
    assert np.isfinite(found.distance).all()


@pytest.mark.benchmark(group=ONE)
@pytest.mark.parametrize("model", [*MODELS, "fem, mutual"])
def test_one_equilibrium(benchmark, model):
    """Newton from 0.02 radii away and the ten eigenvalues there; it must be the stable one."""
    name, _, answers = model.partition(", ")
    table = Levitation(SCENE, Models(name, "none", interaction="mutual" if answers else "rigid")).interaction
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


@pytest.mark.benchmark(
    group="a slider of the live page moves: point dipole, and finite elements with mutual magnetisation"
)
def test_slider(benchmark):
    """Equilibria and stability by both models from those of a scene nearby, and what the page shows of them."""
    state = first_state(load_scene(shipped_scene()))
    near = preview(state, patient=True).places  # the tables are in the cache from here on
    found = benchmark.pedantic(preview, (state.changed("rotor.angle_deg", 10.2), near), rounds=10, warmup_rounds=1)
    assert [one.stability for one in found.models] == ["stable", "stable"]


@pytest.mark.benchmark(group=MAP)
@pytest.mark.parametrize("model", MODELS)
def test_map(benchmark, model):
    """Frequency against displacement over the ranges of the article; time for each equilibrium found."""
    columns = moved_rotors(np.linspace(1e-3, 8e-3, 100), model)
    found = benchmark.pedantic(equilibrium_map, (*columns, np.linspace(50.0, 250.0, 100)), rounds=1)
    benchmark.extra_info["count"] = len(found.row)
    print(f"\n{model}: {len(found.row)} equilibria, {found.stable.sum()} of them stable")
    assert found.stable.any()
