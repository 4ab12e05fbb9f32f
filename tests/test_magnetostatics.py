"""The rotor's field by finite elements: exact solutions, rates, symmetries, published numbers, honest errors."""

import ngsolve as ng
import numpy as np
import pytest

from spinlev.fem.ladder import Accuracy, fem_table
from spinlev.fem.magnetostatics import magnet_moments, solve, trace_moments
from spinlev.fem.models import resolve_model, rotor_table
from spinlev.fem.multipole import MultipoleExpansion
from spinlev.fem.open_boundary import OpenBoundary
from spinlev.fem.remanent import edge_graded_gauss, remanent_h
from spinlev.fem.table import RotorTable
from spinlev.geometry.box import Box, rotation_matrix
from spinlev.geometry.magnet import Magnet
from spinlev.geometry.mesh import MeshSettings, mesh_magnets
from spinlev.geometry.rotor import horizontal, tilt, vertical

EDGE, REMANENCE = 0.01, 1.305
CUBE_RATIO = 0.98366887
"""m/(Br V/μ0) of a cube with μr = 1.05; PHYSICS.md gives 0.98367, this code's finest meshes 0.98366887(1)."""


def rotors(permeability):
    return {
        "horizontal": horizontal(0.002, EDGE, REMANENCE, permeability),
        "vertical": vertical(EDGE, EDGE, REMANENCE, permeability),
        "tilt": tilt(np.radians(12), EDGE, REMANENCE, permeability),
    }


def directions(count=150):
    vectors = np.random.default_rng(1).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def around(magnet, distance):
    """Points at a distance from the lower magnet's centre, on the floater's side."""
    vectors = directions()
    vectors[:, 2] = -np.abs(vectors[:, 2])
    return magnet.box.center + distance * vectors


def relative(values, truth):
    axes = tuple(range(1, truth.ndim))
    return np.linalg.norm(values - truth, axis=axes) / np.linalg.norm(truth, axis=axes)


def expansion_of(magnet, coefficients):
    return MultipoleExpansion(magnet.box.center, magnet.box.circumradius, coefficients)


def moment_ratio(magnet, coefficients):
    return expansion_of(magnet, coefficients).moment / np.linalg.norm(magnet.moment)


# exact solutions


@pytest.mark.parametrize("order", [2, 4, 6])
def test_open_boundary_recognises_outer_potentials(order):
    """A dipole's potential on the sphere gives the dipole back; the map is exact for every degree it holds."""
    mesh = mesh_magnets(rotors(1.05)["horizontal"], MeshSettings(hp_layers=0))
    space = ng.H1(mesh.mesh, order=order)
    potential = ng.GridFunction(space)
    radius = ng.sqrt(ng.x**2 + ng.y**2 + ng.z**2)
    potential.Set(ng.z / radius**3, definedon=mesh.mesh.Boundaries("outer"))
    found = OpenBoundary(mesh.mesh, space, mesh.ball_radius, 3, order).expansion(potential.vec.FV().NumPy())
    expected = np.zeros((4, 4), complex)
    expected[1, 0] = 1.0
    assert np.abs(found - expected).max() < {2: 1e-2, 4: 1e-3, 6: 1e-4}[order]  # interpolation on a coarse sphere


@pytest.mark.parametrize("name", ["horizontal", "vertical"])
def test_closed_form_inside_has_no_demagnetisation_beyond_a_third(name):
    """The mean of H0 in a cube, its own field alone, is -J/3."""
    rotor = rotors(1.05)[name][:1]
    points, weights = edge_graded_gauss(rotor[0].box, 24)
    mean = weights @ remanent_h(rotor, 0, points) / rotor[0].box.volume
    np.testing.assert_allclose(mean, -rotor[0].polarization_in_rotor / 3, atol=1e-12)


def test_direct_solution_reproduces_the_closed_form_for_unit_permeability():
    """μr = 1 with finite elements only: the target is 1e-5 of B and of its gradient from 15 to 50 mm."""
    rotor = rotors(1.0)["horizontal"]
    mesh = mesh_magnets(rotor, MeshSettings(ball_radius=1.15, magnet_size=0.5, air_size=0.5, hp_layers=0))
    outer = MultipoleExpansion(mesh.center, mesh.unit, trace_moments(solve(mesh, "direct", 6, boundary_degree=23)))
    table, exact = RotorTable("fem", rotor, (), (outer,)), rotor_table(rotor, "cuboid")
    for distance in (0.015, 0.02, 0.03, 0.05):
        points = rotor[0].box.center + distance * directions()
        for value, truth in zip(table.evaluate(points), exact.evaluate(points), strict=True):
            assert relative(value, truth).max() < 1e-5


@pytest.mark.slow
def test_stated_error_of_the_direct_solution_covers_the_true_one():
    """Down to where only the roundness of the meshed sphere is left (1e-8)."""
    rotor = rotors(1.0)["horizontal"]
    table, exact = fem_table(rotor, Accuracy(2e-5, 1.7), "direct"), rotor_table(rotor, "cuboid")
    for distance in (0.015, 0.02, 0.03, 0.05):
        points = rotor[0].box.center + distance * directions()
        for value, truth, error in zip(
            table.evaluate(points), exact.evaluate(points), table.relative_error(points), strict=True
        ):
            assert (relative(value, truth) <= error).all()


def test_unit_permeability_needs_no_correction():
    rotor = rotors(1.0)["horizontal"]
    solution = solve(mesh_magnets(rotor), "split", 2)
    assert np.abs(magnet_moments(solution, 5)[0]).max() == 0.0


def test_small_susceptibility_is_first_order():
    """Limit μr → 1: ΔM → (μr - 1) H0, whose mean in a cube is -J/3; the next term is of order (μr - 1)²."""
    ratios = []
    for susceptibility in (1e-3, 1e-4):
        rotor = rotors(1 + susceptibility)["horizontal"]
        solution = solve(mesh_magnets(rotor), "split", 2)
        ratios.append(moment_ratio(rotor[0], magnet_moments(solution, 1)[0])[0] / susceptibility)
    assert ratios[1] == pytest.approx(-1 / 3, abs=2e-5)
    assert ratios[0] == pytest.approx(-1 / 3, abs=2e-4)


# convergence rates and published numbers


def test_moment_of_a_cube_converges_with_the_order():
    rotor = rotors(1.05)["horizontal"]
    mesh = mesh_magnets(rotor)
    errors = []
    for order in (2, 3, 4):
        solution = solve(mesh, "split", order)
        errors.append(abs(1 + moment_ratio(rotor[0], magnet_moments(solution, 1)[0])[0] - CUBE_RATIO))
    assert errors[1] < errors[0] / 4
    assert errors[2] < errors[1] / 2
    assert errors[2] < 1e-7


def test_moments_of_the_magnets_and_of_the_outer_sphere_agree():
    """Two functionals of one solution: inside the magnet, and on the surface of the ball of air."""
    rotor = rotors(1.05)["tilt"]
    solution = solve(mesh_magnets(rotor), "split", 4)
    inside, outside = magnet_moments(solution, 8)[0], trace_moments(solution)
    assert np.abs(inside - outside)[:6].max() < 1e-3 * np.abs(inside).max()
    assert np.abs(inside - outside)[1].max() < 1e-5 * np.abs(inside).max()


def test_mutual_demagnetisation_of_touching_cubes():
    """PHYSICS.md: it changes B by 0.75 % on the axis, 20 mm below the lower cube's centre."""
    rotor = rotors(1.05)["vertical"]
    point = [[0.0, 0.0, -0.02]]
    together = rotor_table(rotor, "fem", 1e-3).evaluate(point)[0]
    alone = sum(fem_table((magnet,), Accuracy(1e-3)).evaluate(point)[0] for magnet in rotor)
    assert np.linalg.norm(together - alone) / np.linalg.norm(together) == pytest.approx(0.0075, abs=0.0002)


# symmetry


def test_turned_magnet_gives_the_turned_field():
    turn = rotation_matrix((15, 40, 70))
    straight = Magnet(Box((0.008, 0.01, 0.006)), (1.0, 0.3, 0.2), 1.08)
    turned = Magnet(Box((0.008, 0.01, 0.006), (0.001, 0.002, 0.0), turn), (1.0, 0.3, 0.2), 1.08)
    points = 0.015 * directions(40)
    before, after = fem_table((straight,), Accuracy(5e-4)), fem_table((turned,), Accuracy(5e-4))
    b, gradient = before.evaluate(points)
    b_turned, gradient_turned = after.evaluate(turned.box.center + points @ turn.T)
    assert relative(b_turned, b @ turn.T).max() < 1e-4  # two unlike meshes, each far better than asked
    assert relative(gradient_turned, turn @ gradient @ turn.T).max() < 5e-4


# the stated error


@pytest.fixture(scope="module", params=["horizontal", "vertical", "tilt"])
def finer(request):
    """A rotor and its field from another, finer mesh, one order higher and with all moments kept."""
    rotor = rotors(1.05)[request.param]
    mesh = mesh_magnets(rotor, MeshSettings(ball_radius=1.2, magnet_size=0.6, hp_factor=0.2))
    moments = magnet_moments(solve(mesh, "split", 4), 25)
    expansions = tuple(expansion_of(m, c) for m, c in zip(rotor, moments, strict=True))
    return rotor, RotorTable("fem", rotor, rotor, expansions)


@pytest.mark.parametrize(("model", "rtol"), [("fem", 1e-4), ("cuboid", 1e-5), ("dipole", 1e-5)])
def test_stated_error_covers_the_true_one(finer, model, rtol):
    rotor, truth = finer
    table = rotor_table(rotor, model, rtol)
    for distance in (0.013, 0.015, 0.02, 0.04):
        points = around(rotor[0], distance)
        for value, exact, error in zip(
            table.evaluate(points), truth.evaluate(points), table.relative_error(points), strict=True
        ):
            assert (relative(value, exact) <= error).all()


def test_default_table_meets_its_target(finer):
    """μr = 1.05: 1e-5 in B and 1e-4 in the gradient from 13 mm outwards."""
    rotor, truth = finer
    table = rotor_table(rotor)
    assert table.provenance["elements"] > 0
    for distance in (0.013, 0.016, 0.03):
        points = around(rotor[0], distance)
        (b, gradient), (exact_b, exact_gradient) = table.evaluate(points), truth.evaluate(points)
        assert relative(b, exact_b).max() < 1e-5
        assert relative(gradient, exact_gradient).max() < 1e-4


# the choice of the model


def test_auto_takes_the_cheapest_exact_model():
    assert resolve_model(rotors(1.0)["vertical"], "auto")[0] == "cuboid"
    assert resolve_model(rotors(1.05)["vertical"], "auto")[0] == "fem"
    assert rotor_table(rotors(1.0)["tilt"]).expansions == ()


def test_input_that_makes_no_sense_is_refused():
    rotor = rotors(1.0)["tilt"]
    with pytest.raises(ValueError, match="dipole, cuboid, fem, auto; instead received 'bem'"):
        rotor_table(rotor, "bem")
    with pytest.raises(ValueError, match="rtol must lie between"):
        rotor_table(rotor, "fem", 0.0)
    with pytest.raises(ValueError, match="nearest must exceed 1"):
        Accuracy(1e-5, 1.0)
    with pytest.raises(ValueError, match="at least one magnet"):
        rotor_table((), "dipole")
