"""The rotor's field: solving for it and evaluating it, beside scikit-fem and magpylib."""

import numpy as np
import pytest
from peers import SCENE, around, magpylib_rotor

from spinlev.fem.elements.ladder import reaction_moments
from spinlev.fem.elements.magnetostatics import assemble, magnet_dipoles, solve
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.common import MU_0
from spinlev.geometry.meshes.magnets import MeshSettings, mesh_magnets

POINTS = around(SCENE.rotor[0], 100_000)
PEER = "magpylib, B alone"


@pytest.mark.benchmark(group="100 000 points: B and its gradient")
@pytest.mark.parametrize("model", [PEER, "dipole", "cuboid", "moments to 13", "fem"])
def test_evaluation(benchmark, model):
    """The same points for all, from 13 to 40 mm about one cube; the peer gives no gradient."""
    rotor = SCENE.rotor
    benchmark.extra_info["peer"] = model == PEER
    if model == PEER:
        magnets = magpylib_rotor(rotor)
        field = benchmark(lambda: magnets.getB(POINTS))
    elif model == "moments to 13":
        table = RotorTable("moments", rotor, (), tuple(uniform_moments(m, 13) for m in rotor))
        field = benchmark(lambda: table.evaluate(POINTS))[0]
    else:
        table = rotor_table(rotor, model, nearest=SCENE.floater.radius)
        field = benchmark(lambda: table.evaluate(POINTS))[0]
    assert np.isfinite(field).all()


@pytest.mark.benchmark(group="the magnet's answer on one mesh, quadratic elements")
@pytest.mark.parametrize("library", ["scikit-fem", "spinlev"])
def test_same_mesh(benchmark, library):
    """The same problem on the same mesh, to the dipole moment that the permeability adds."""
    mesh = mesh_magnets(SCENE.rotor, MeshSettings(ball_radius=2.5, magnet_size=0.35, hp_layers=0, curve_order=1))
    benchmark.extra_info["peer"] = library == "scikit-fem"

    def ours():
        solution = solve(assemble(mesh, 2), mesh.magnets, "split", boundary_degree=1)
        return reaction_moments(solution, 1)[0]

    found = benchmark.pedantic(
        ours if library == "spinlev" else lambda: magnet_dipoles(mesh, "split"), rounds=10, warmup_rounds=1
    )
    assert np.isfinite(found).all()


@pytest.mark.benchmark(group="field solve from nothing, mesh included, by relative accuracy asked of B")
@pytest.mark.parametrize("rtol", ["scikit-fem, one mesh", 1e-3, 1e-4, 1e-5])
def test_field_solve(benchmark, rtol):
    """The error is that of the dipole moment, against a table of 1e-7."""
    exact = rotor_table(SCENE.rotor, "fem", 1e-7).moment
    if isinstance(rtol, str):
        benchmark.extra_info["peer"] = True
        settings = MeshSettings(ball_radius=2.5, magnet_size=0.35, hp_layers=0, curve_order=1)
        added = benchmark.pedantic(lambda: magnet_dipoles(mesh_magnets(SCENE.rotor, settings), "split"), rounds=5)
        moment = SCENE.rotor[0].moment + added[0] / MU_0
    else:
        moment = benchmark.pedantic(rotor_table, (SCENE.rotor, "fem", rtol), rounds=5).moment
    error = np.linalg.norm(moment - exact) / np.linalg.norm(exact)
    benchmark.extra_info["error"] = f"moment {error:.0e}"
    assert error < 1e-3
