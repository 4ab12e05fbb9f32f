"""The open boundary in two ways to solve with it, and gradients of the basis at points."""

import ngsolve as ng
import numpy as np
import pytest
from second_opinions.magnet_elements import OpenFactor, lacking

from spinlev.fem.elements.spaces import OpenBoundary, solve_open, volume_points
from spinlev.geometry.meshes.magnets import MeshSettings, mesh_magnets
from spinlev.geometry.scene.files import load_scene

DEGREE, ORDER = 6, 2


@pytest.fixture(scope="module")
def system():
    """A cube's mesh in air: form, inverse, boundary, space."""
    mesh = mesh_magnets(load_scene("scenes/horizontal.toml").rotor[:1])
    space = ng.H1(mesh.mesh, order=ORDER)
    trial, test = space.TnT()
    boundary = OpenBoundary(space, mesh.ball_radius, DEGREE)
    form = ng.BilinearForm(space, symmetric=True, condense=True)
    form += ng.grad(trial) * ng.grad(test) * ng.dx + 2 / mesh.ball_radius * trial * test * ng.ds("outer")
    form.Assemble()
    return form, form.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky"), boundary, space, mesh


def test_the_factor_with_the_boundary_gives_what_iteration_gives(system):
    """The low-rank formula against conjugate gradients."""
    form, inverse, boundary, space, _mesh = system
    factor = OpenFactor(form, inverse, boundary)
    load = ng.LinearForm(space)
    load += (ng.x + 0.3 * ng.y * ng.z) * space.TestFunction() * ng.dx("magnet0")
    load.Assemble()
    given = load.vec.FV().NumPy().copy()
    (found,) = factor.solve(given[None])
    iterated = solve_open(form, inverse, space.FreeDofs(True), load, boundary).vec.FV().NumPy()
    assert np.linalg.norm(found - iterated) < 1e-10 * np.linalg.norm(iterated)
    both = factor.solve(np.stack([given, -2 * given]))
    np.testing.assert_allclose(both, [found, -2 * found], rtol=1e-12, atol=1e-12 * np.abs(found).max())


def test_its_loads_and_factors_are_its_map(system):
    """As a sum over harmonics against `apply`, which is not nothing."""
    _form, _inverse, boundary, space, _mesh = system
    loads, factors = lacking(boundary, space.ndof)
    assert len(loads) == (DEGREE + 1) ** 2 - 3  # all but the three of degree 1, for which the Robin term is exact
    assert np.all(factors != 0)
    values = np.random.default_rng(0).normal(size=space.ndof)
    by_loads = (factors * (loads @ values)) @ loads
    np.testing.assert_allclose(by_loads, boundary.apply(values), rtol=0, atol=1e-12 * np.abs(by_loads).max())
    assert np.abs(by_loads).max() > 0


@pytest.mark.parametrize("order", [ORDER, 4, pytest.param(5, marks=pytest.mark.slow)])
def test_gradients_at_points_are_those_of_the_function(order):
    """The matrix of the basis' gradients against NGSolve's own evaluation; from order 4 on elements have 64 points."""
    mesh = mesh_magnets(load_scene("scenes/horizontal.toml").rotor[:1], MeshSettings(hp_layers=0))
    space = ng.H1(mesh.mesh, order=order)
    points = volume_points(mesh.mesh, "magnet0", 2 * order - 2)
    matrix = points.value_matrix(space, ng.grad(space.TrialFunction()))
    function = ng.GridFunction(space)
    function.vec.FV().NumPy()[:] = np.random.default_rng(1).normal(size=space.ndof)
    slope = ng.grad(function)
    expected = points.sample(*(slope[axis] for axis in range(3)))
    found = (matrix @ function.vec.FV().NumPy()).reshape(-1, 3)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
