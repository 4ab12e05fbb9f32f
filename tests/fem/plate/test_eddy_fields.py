"""Fields of eddy currents: exact sphere, energy, Ampère, symmetry of the fold; tetrahedral meshes."""

from __future__ import annotations

import ngsolve
import numpy as np
import pytest
from netgen.occ import Box as OccBox, Pnt, Sphere
from second_opinions.phasor import mean_loss
from second_opinions.solids import Conductor, occ_mesh

from spinlev.fem.closed_forms.eddy_bodies import polarizability
from spinlev.fem.closed_forms.potentials import HomogeneousField, unit_dipoles
from spinlev.fem.plate.eddy import EddySpace, current_density, solve_eddy
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.geometry.shapes import Box

SIZE, SIGMA, FREQUENCY = (0.1, 0.24, 0.03), 3.5e7, 100.0
PLACE = np.array([[0.01, -0.02, 0.045]])
AMPLITUDES = np.array([1.0, -1j, 0.3])


@pytest.fixture(scope="module")
def response():
    mesh = plate_mesh(Box(SIZE), SIGMA, PLACE, FREQUENCY, MeshRule(2.0, 3.0, 3.0))
    return solve_eddy(mesh, 3, FREQUENCY, unit_dipoles(PLACE))


def applied(points):
    return sum(a * s.vector_potential(points) for a, s in zip(AMPLITUDES, unit_dipoles(PLACE), strict=True))


def test_loss_of_the_field_is_the_work_of_the_source(response):
    """Poynting's theorem holds for the discrete solution: to the direct solver's precision."""
    work = mean_loss(response.couplings, AMPLITUDES, FREQUENCY)
    assert joule_loss(response, AMPLITUDES) == pytest.approx(float(work), rel=1e-8)


def joule_loss(response, amplitudes):
    """½ω² ∫ σ|A_s + A|² dV, W, from the field itself."""
    space, total = response.space, 0.0
    trial, test = space.real.TnT()
    mass = ngsolve.BilinearForm(space.real, symmetric=True)
    mass += space.sigma * trial * test * ngsolve.dx(definedon=space.region)
    mass.Assemble()
    vector, product = mass.mat.CreateColVector(), mass.mat.CreateColVector()
    for c in response.classes.values():
        applied = np.tensordot(amplitudes, c.potentials, axes=1)
        solution, load = amplitudes @ c.solutions, amplitudes @ c.loads
        total += np.sum(space.weights[:, None] * np.abs(applied) ** 2) + 2 * np.vdot(load, solution).real
        for part in (solution.real, solution.imag):
            vector.FV().NumPy()[:] = part
            product.data = mass.mat * vector
            total += 1e-9 * ngsolve.InnerProduct(vector, product)
    return 0.5 * np.abs(response.shift) ** 2 * space.conductors.images * total


def test_current_in_all_octants_carries_the_couplings(response):
    """∫ J · A_i over the whole plate, cell by cell in all octants: the fold and its signs."""
    points = np.array([v.point for v in response.space.conductors.mesh.vertices]) * 1e-3
    rules = [whole_axis_rule(np.unique(points[:, a].round(12)), SIZE[a] / 2) for a in range(3)]
    grid = np.stack(np.meshgrid(*[nodes for nodes, _ in rules], indexing="ij"), -1).reshape(-1, 3)
    volume = np.einsum("i,j,k->ijk", *[weights for _, weights in rules]).ravel()
    current = current_density(response, applied(grid), AMPLITUDES, grid)
    found = [np.sum(volume[:, None] * current * s.vector_potential(grid)) for s in unit_dipoles(PLACE)]
    truth = response.couplings @ AMPLITUDES
    assert abs(found - truth).max() < 1e-5 * abs(truth).max()  # both Gauss rules with six points


def whole_axis_rule(lines, half):
    """Gauss points and weights on every cell of one axis of the plate, both halves."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    lines = lines[lines <= half + 1e-9]
    lines = np.concatenate([-lines[:0:-1], lines])
    step = np.diff(lines)[:, None]
    return (lines[:-1, None] + step * (1 + nodes) / 2).ravel(), (step * weights / 2).ravel()


def test_current_is_zero_in_air_and_tangential_at_faces(response):
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-0.04, 0.04, 40), rng.uniform(-0.1, 0.1, 40), np.full(40, 0.0149)])
    current = current_density(response, applied(points), AMPLITUDES, points)
    assert abs(current[:, 2]).max() < 0.05 * abs(current).max()  # div J = 0 and J·n = 0 hold weakly
    above = points + np.array([0.0, 0.0, 0.01])
    assert not current_density(response, applied(above), AMPLITUDES, above).any()


def test_points_outside_the_mesh_are_named(response):
    with pytest.raises(ValueError, match="Input points_m must lie in the meshed box"):
        current_density(response, np.zeros((1, 3)), AMPLITUDES, [[9.0, 0, 0]])


@pytest.mark.slow
def test_sphere_in_a_uniform_field_on_curved_tetrahedra():
    """μ0 m² of the induced moment is the coupling of the field with itself; R/δ = 1.7."""
    radius, frequency = 0.01, 200.0
    mesh = occ_mesh({"ball": Conductor(Sphere(Pnt(0, 0, 0), 10.0), SIGMA, 8.0)}, reach=8.0)
    sources = [HomogeneousField(axis) for axis in np.eye(3)]
    found = solve_eddy(mesh, 3, frequency, sources).couplings
    exact = polarizability(radius, SIGMA, frequency)
    # the box at 8 R adds about (1/8)³ of the moment's own share
    assert np.diag(found) == pytest.approx(np.full(3, exact), rel=3e-3)
    assert abs(found - np.diag(np.diag(found))).max() < 1e-3 * abs(exact)


@pytest.mark.slow
def test_two_bodies_with_their_own_conductivity():
    """Two far boxes, one a thousand times worse: the couplings are those of the boxes alone."""
    place = [(0.0, 0.0, 0.02)]

    def box(x):
        return OccBox(Pnt(x - 10, -10, -5), Pnt(x + 10, 10, 5))

    one = solve_eddy(occ_mesh({"a": Conductor(box(0), SIGMA, 10.0)}), 2, 50.0, unit_dipoles(place)).couplings
    pair = {"a": Conductor(box(0), SIGMA, 10.0), "b": Conductor(box(80), SIGMA / 1e3, 10.0)}
    two = solve_eddy(occ_mesh(pair), 2, 50.0, unit_dipoles(place)).couplings
    assert two == pytest.approx(one, rel=2e-2, abs=1e-2 * abs(one).max())  # order 2 on two different coarse meshes


@pytest.mark.slow
def test_tetrahedra_and_hexahedra_agree():
    size, place = (0.04, 0.05, 0.02), [(0.0, 0.0, 0.025)]
    half = 500 * np.array(size)
    tets = occ_mesh({"plate": Conductor(OccBox(Pnt(*-half), Pnt(*half)), SIGMA, 9.0)}, reach=12.0)
    hexes = plate_mesh(Box(size), SIGMA, place, 100.0)
    tensors = [solve_eddy(mesh, 2, 100.0, unit_dipoles(place)).couplings for mesh in (tets, hexes)]
    assert abs(tensors[0] - tensors[1]).max() < 1e-2 * abs(tensors[1]).max()  # order 2, cells of the skin depth


@pytest.mark.parametrize("order", [2, 4, 5])
def test_values_of_a_function_from_its_coefficients_are_those_of_the_function(order):
    """Two ways of NGSolve to evaluate one function; from order 4 on hexahedra have more than 256 points."""
    space = EddySpace(
        plate_mesh(Box((0.02, 0.02, 0.01)), 3.5e7, np.array([[0.0, 0.0, 0.012]]), 50.0, MeshRule(3.0)), order
    )
    function = ngsolve.GridFunction(space.real)
    function.vec.FV().NumPy()[:] = np.random.default_rng(0).normal(size=space.real.ndof)
    expected = function(space.conductors.mesh(*(space.points * 1e3).T))
    found = space.quadrature.value_matrix(space.real, space.real.TrialFunction()) @ function.vec.FV().NumPy()
    np.testing.assert_allclose(found.reshape(-1, 3), expected, atol=1e-12 * np.abs(expected).max())
