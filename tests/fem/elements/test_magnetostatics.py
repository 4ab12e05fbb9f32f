"""The rotor's field by finite elements: exact solutions, rates, symmetries, published numbers."""

from itertools import pairwise

import ngsolve as ng
import numpy as np
import pytest
from second_opinions.elements_alone import direct_table

from spinlev.fem.closed_forms.moments import induced_moments
from spinlev.fem.elements.ladder import refinement_of, solve_rotor, trace_moments
from spinlev.fem.elements.magnetostatics import assemble, solve
from spinlev.fem.elements.spaces import OpenBoundary
from spinlev.fem.harmonics.expansion import MultipoleExpansion
from spinlev.fem.rotor.choice import resolve_model, rotor_table
from spinlev.fem.rotor.models import Accuracy, fem_table
from spinlev.geometry.magnets import Magnet, horizontal, tilt, vertical
from spinlev.geometry.meshes.magnets import MeshSettings, find_symmetry, mesh_magnets, parity_parts
from spinlev.geometry.shapes import Box, rotation_matrix

EDGE, REMANENCE = 0.01, 1.305
CUBE_RATIO = 0.98366887
"""m/(Br V/μ0) of a cube with μr = 1.05; PHYSICS.md gives 0.98367, this code's finest meshes 0.98366887(1)."""
SETTINGS = MeshSettings()


def rotors(permeability):
    return {
        "horizontal": horizontal(0.002, EDGE, REMANENCE, permeability),
        "vertical": vertical(EDGE, EDGE, REMANENCE, permeability),
        "tilt": tilt(np.radians(12), EDGE, REMANENCE, permeability),
    }


def directions(count=150):
    vectors = np.random.default_rng(1).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def relative(values, truth):
    axes = tuple(range(1, truth.ndim))
    return np.linalg.norm(values - truth, axis=axes) / np.linalg.norm(truth, axis=axes)


def moments(rotor, order, degree, use_symmetry=True):
    """Expansions of what the permeability adds, about every magnet."""
    solution = solve_rotor(rotor, refinement_of(order, SETTINGS), "split", degree, use_symmetry=use_symmetry)
    closed = [induced_moments(magnet, rotor, degree) for magnet in rotor]
    return solution.expansions([a + b for a, b in zip(closed, solution.coefficients, strict=True)])


def moment_ratio(rotor, order):
    return moments(rotor, order, 1)[0].moment / np.linalg.norm(rotor[0].moment)


# exact solutions


@pytest.mark.parametrize("order", [2, 4, 8])
@pytest.mark.parametrize("planes", [(), (0, 1, 2)])
def test_open_boundary_recognises_outer_potentials(order, planes):
    """A dipole's potential on the sphere gives the dipole back; the map is exact for every degree it holds."""
    centred = [find_symmetry(rotors(1.05)["horizontal"]).to_frame(rotors(1.05)["horizontal"][0])]
    mesh = mesh_magnets(centred, MeshSettings(hp_layers=0, curve_order=8), planes)
    space = ng.H1(mesh.mesh, order=order)
    potential = ng.GridFunction(space)
    radius = ng.sqrt(ng.x**2 + ng.y**2 + ng.z**2)
    potential.Set(ng.z / radius**3, definedon=mesh.mesh.Boundaries("outer"))
    boundary = OpenBoundary(space, mesh.ball_radius, 3, planes, (1, 1, -1)[: len(planes)])
    expected = np.zeros((4, 4), complex)
    expected[1, 0] = 1.0
    found = boundary.expansion(potential.vec.FV().NumPy())
    assert np.abs(found - expected).max() < {2: 1e-2, 4: 1e-3, 8: 1e-5}[order]  # interpolation on a coarse sphere


def test_finite_elements_alone_reproduce_the_closed_form():
    """μr = 1, no closed form: 1e-7 of B at 20 mm, and the stated error covers the true one."""
    rotor = rotors(1.0)["horizontal"]
    table, exact = direct_table(rotor, Accuracy(1e-7, 0.015)), rotor_table(rotor, "cuboid")
    for distance in (0.013, 0.015, 0.02, 0.05):
        points = rotor[0].box.center + distance * directions()
        errors = table.relative_error(points)
        for value, truth, error in zip(table.evaluate(points), exact.evaluate(points), errors, strict=True):
            assert (relative(value, truth) <= error).all()
    assert relative(table.evaluate(0.02 * directions())[0], exact.evaluate(0.02 * directions())[0]).max() < 1e-7


def test_small_susceptibility_is_first_order():
    """Limit μr → 1: ΔM → (μr - 1) H0, whose mean in a cube is -J/3; the next term is of order (μr - 1)²."""
    ratios = [moment_ratio(rotors(1 + chi)["horizontal"], 2)[0] / chi for chi in (1e-3, 1e-4)]
    assert ratios[1] == pytest.approx(-1 / 3, abs=2e-5)
    assert ratios[0] == pytest.approx(-1 / 3, abs=2e-4)


def test_anisotropic_cube_answers_along_its_easy_axis_first():
    """A cube magnetised along the easy axis: the mean field across it is zero, so that χ across acts at order χ²."""
    for along, across in ((1.05, 1.15), (1.15, 1.05)):
        magnet = Magnet(Box((EDGE, EDGE, EDGE)), (REMANENCE, 0, 0), along, across)
        ratio = moment_ratio((magnet,), 4)[0]
        alike = moment_ratio((Magnet(magnet.box, magnet.polarization, along),), 4)[0]
        assert ratio == pytest.approx(alike, rel=0.03)
        assert abs(ratio - alike) > 1e-5


# convergence rates and published numbers


def test_moment_of_a_cube_converges_with_the_order():
    rotor = rotors(1.05)["horizontal"]
    errors = [abs(1 + moment_ratio(rotor, order)[0] - CUBE_RATIO) for order in (2, 3, 4)]
    assert all(fine < coarse / 3 for coarse, fine in pairwise(errors))
    assert errors[-1] < 1e-7


def test_moments_of_the_magnets_and_of_the_outer_sphere_agree():
    """Two functionals of one solution: inside the magnet, and on the surface of the ball of air."""
    rotor = rotors(1.05)["tilt"]
    inside = moments(rotor, 4, 8)[0].coefficients
    symmetry = find_symmetry(rotor)
    seen = [symmetry.to_frame(rotor[0])]
    signs, _ = parity_parts(seen, symmetry.planes)[0]
    system = assemble(mesh_magnets(seen, refinement_of(4, SETTINGS).mesh, symmetry.planes), 4)
    outside = trace_moments(solve(system, seen, "split", 8, signs))
    size = np.linalg.norm([np.linalg.norm(MultipoleExpansion(np.zeros(3), 1.0, outside).moment)])
    assert np.linalg.norm(MultipoleExpansion(np.zeros(3), 1.0, inside).moment) == pytest.approx(size, rel=1e-5)


def test_mutual_demagnetisation_of_touching_cubes():
    """PHYSICS.md: it changes B by 0.75 % on the axis, 20 mm below the lower cube's centre."""
    rotor = rotors(1.05)["vertical"]
    point = [[0.0, 0.0, -0.02]]
    together = rotor_table(rotor, "fem", 1e-4).evaluate(point)[0]
    alone = sum(fem_table((magnet,), Accuracy(1e-4)).evaluate(point)[0] for magnet in rotor)
    assert np.linalg.norm(together - alone) / np.linalg.norm(together) == pytest.approx(0.0075, abs=0.0002)


# symmetry


@pytest.mark.parametrize("name", ["horizontal", "vertical", "tilt"])
def test_all_rotors_of_the_article_have_three_mirror_planes(name):
    assert find_symmetry(rotors(1.05)[name]).planes == (0, 1, 2)


@pytest.mark.parametrize("name", [pytest.param("vertical", marks=pytest.mark.slow), "tilt"])
def test_one_octant_gives_the_field_of_the_whole(name):
    """To the error of the elements, of which the meshes are unlike."""
    rotor = rotors(1.05)[name]
    octant, whole = moments(rotor, 4, 7), moments(rotor, 3, 7, use_symmetry=False)
    points = np.array([0, 0, -0.02]) + 0.003 * directions(30)
    size = np.linalg.norm(rotor_table(rotor, "cuboid").evaluate(points)[0], axis=1)
    difference = sum(a.evaluate(points)[0] - b.evaluate(points)[0] for a, b in zip(octant, whole, strict=True))
    assert (np.linalg.norm(difference, axis=1) < 2e-6 * size).all()


def test_unequal_magnets_share_only_the_planes_they_have_in_common():
    large, small = Box((0.01, 0.01, 0.01)), Box((0.006, 0.006, 0.006), (0.0, 0.001, 0.008))
    pair = [Magnet(large, (1, 0, 0), 1.05), Magnet(small, (0, 0, 1), 1.05)]
    assert find_symmetry(pair).planes == (0,)
    assert len(parity_parts([find_symmetry(pair).to_frame(m) for m in pair], (0,))) == 2


def test_turned_magnet_gives_the_turned_field():
    turn = rotation_matrix((15, 40, 70))
    straight = Magnet(Box((0.008, 0.01, 0.006)), (1.0, 0.3, 0.2), 1.08)
    turned = Magnet(Box((0.008, 0.01, 0.006), (0.001, 0.002, 0.0), turn), (1.0, 0.3, 0.2), 1.08)
    points = 0.015 * directions(40)
    b, gradient = fem_table((straight,), Accuracy(1e-4)).evaluate(points)
    b_turned, gradient_turned = fem_table((turned,), Accuracy(1e-4)).evaluate(turned.box.center + points @ turn.T)
    assert relative(b_turned, b @ turn.T).max() < 2e-4  # each within 1e-4
    assert relative(gradient_turned, turn @ gradient @ turn.T).max() < 1e-3


# the choice of the model


def test_auto_takes_the_cheapest_model_that_suffices():
    assert resolve_model(rotors(1.0)["vertical"], "auto")[0] == "cuboid"
    assert resolve_model(rotors(1.05)["vertical"], "auto")[0] == "fem"
    assert resolve_model(rotors(1 + 1e-9)["horizontal"], "auto")[0] == "cuboid"
    assert resolve_model(rotors(1.0)["horizontal"], "auto", 1e-2, 0.03)[0] == "dipole"
    name, reason = resolve_model(rotors(1.0)["horizontal"], "auto", 1e-3)
    assert name == "moments"
    assert "8 mm" in reason
    assert rotor_table(rotors(1.0)["tilt"]).expansions == ()


def test_input_that_makes_no_sense_is_refused():
    rotor = rotors(1.0)["tilt"]
    with pytest.raises(ValueError, match="dipole, moments, cuboid, surface, fem, auto; instead received 'bem'"):
        rotor_table(rotor, "bem")
    with pytest.raises(ValueError, match="rtol must lie between"):
        rotor_table(rotor, "fem", 0.0)
    with pytest.raises(ValueError, match="nearest must be positive"):
        Accuracy(1e-5, 0.0)
    with pytest.raises(ValueError, match="at least one magnet"):
        rotor_table((), "dipole")
    with pytest.raises(ValueError, match="easy axis"):
        Magnet(rotor[0].box, (0, 0, 0), 1.05, 1.1)
