"""Rotor and permeable floater: closed forms of the sphere, image series, limits, both bodies meshed at once."""

import numpy as np
import pytest
from article import PERMEABLE, RADIUS
from second_opinions.both_bodies import added_to_body, solve_both_bodies
from second_opinions.magnet_elements import element_ladder
from second_opinions.permeable_sphere import inner_field
from second_opinions.two_bodies import mesh_two_bodies

from spinlev.fem.closed_forms.uniform import remanent_field
from spinlev.fem.harmonics.expansion import moments_of_magnetization, uniform_moments
from spinlev.fem.harmonics.interior import (
    Ball,
    dipole_sources,
    field_at_center,
    from_magnetization,
    moment,
    multipole_force,
    multipole_torque,
)
from spinlev.fem.harmonics.solid import derivative, outer_sums
from spinlev.fem.mutual.response import TwoBodyError, enough_degree, two_body, two_body_ladder
from spinlev.fem.mutual.table import induced_sources
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import MU_0
from spinlev.geometry.magnets import Magnet, horizontal, vertical
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Sphere

BALL = Ball(np.array([0.001, -0.002, -0.015]), RADIUS)
DIRECTION = np.array([0.48, 0.36, 0.8])
PLACE = np.array([0.0015, 0.001, -0.0145])


def floater(permeability):
    return Floater(RADIUS, 1.305, permeability, 7500.0)


def uniform(field, degree=3):
    coefficients = np.zeros((degree + 1, degree + 1), complex)
    coefficients[1, 1], coefficients[1, 0] = field[0] + 1j * field[1], -field[2]
    return coefficients


def field_of_dipoles(points, places, moments):
    """B (n, 3) of dipoles with μ0 M dV in T m³: the textbook formula, apart from the code under test."""
    total = np.zeros_like(points)
    for place, value in zip(places, moments, strict=True):
        r = points - place
        d = np.linalg.norm(r, axis=1)[:, None]
        total += (3 * r * (r @ value)[:, None] / d**5 - value / d**3) / (4 * np.pi)
    return total


def sphere_rule(center, radius, nodes):
    height, weights = np.polynomial.legendre.leggauss(nodes)
    angle = np.pi * np.arange(2 * nodes) / nodes
    across = np.sqrt(1 - height**2)[:, None]
    grid = np.broadcast_arrays(across * np.cos(angle), across * np.sin(angle), height[:, None])
    normals = np.stack(grid, -1).reshape(-1, 3)
    return center + radius * normals, normals, np.repeat(weights * np.pi / nodes, 2 * nodes) * radius**2


def maxwell_stress(field, center, radius, nodes=40):
    """Force and torque about the centre on what is inside a sphere, J. C. Maxwell's stress of B alone."""
    points, normals, areas = sphere_rule(center, radius, nodes)
    b = field(points)
    traction = (b * np.sum(b * normals, axis=1)[:, None] - normals * np.sum(b * b, axis=1)[:, None] / 2) / MU_0
    return areas @ traction, areas @ np.cross(points - center, traction)


def outer_field(sources, ball, points):
    potentials = [-derivative(sources, axis) for axis in range(3)]
    return outer_sums(potentials, (points - ball.center) / ball.radius)


# the sphere alone


@pytest.mark.parametrize("permeability", [1.0, 1.05, 1000.0])
def test_sphere_in_a_uniform_field(permeability):
    """Textbook: moment 3 V (μ-1)/(μ+2) B/μ0 + (J V/μ0) 3/(μ+2), no force, torque only on the remanent moment."""
    field, body = np.array([0.03, -0.02, 0.01]), floater(permeability)
    incident = uniform(field)
    sources = dipole_sources(body.moment * DIRECTION, BALL, 3) + induced_sources(incident, permeability)
    remanent = body.remanence * body.volume / MU_0 * 3 / (permeability + 2) * DIRECTION
    induced = 3 * body.volume * (permeability - 1) / (permeability + 2) * field / MU_0
    np.testing.assert_allclose(moment(sources, BALL), remanent + induced, rtol=1e-13)
    assert np.abs(multipole_force(incident, sources, BALL)).max() == 0.0
    np.testing.assert_allclose(multipole_torque(incident, sources, BALL), np.cross(remanent, field), rtol=1e-12)
    b, h = inner_field(field, permeability, body.remanence * DIRECTION)
    np.testing.assert_allclose((b - h) * body.volume / MU_0, remanent + induced, rtol=1e-12)


def test_inner_and_outer_field_meet_the_interface_conditions():
    field = np.array([0.03, -0.02, 0.01])
    sources = dipole_sources(PERMEABLE.moment * DIRECTION, BALL, 1) + induced_sources(uniform(field, 1), 1.05)
    points, normals, _ = sphere_rule(BALL.center, BALL.radius, 4)
    outside = field + outer_field(sources, BALL, points)
    b, h = inner_field(field, 1.05, 1.305 * DIRECTION)
    np.testing.assert_allclose(np.sum(outside * normals, axis=1), normals @ b, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.cross(normals, outside), np.cross(normals, h), rtol=0, atol=1e-13)


def series(permeability, distance, weight, last=400):
    """Σ t_l weight(l) (R/d)^(2l+1) / d^4: fields that a sphere's induced multipoles send back to a dipole."""
    l = np.arange(1, last)
    t = l * (permeability - 1) / (l * (permeability + 1) + 1)
    return np.sum(t * weight(l) * (RADIUS / distance) ** (2 * l + 1.0)) / distance**4


@pytest.mark.parametrize("permeability", [1.05, 5.0, 1000.0])
@pytest.mark.parametrize("distance", [0.01, 0.015, 0.03])
def test_force_between_a_dipole_and_a_permeable_sphere(permeability, distance):
    """Series of the induced multipoles: (μ0 m²/4π) Σ t_l (l+1)² (l+2) …, and l (l+1)(l+2)/2 across."""
    degree = 60  # (R/d)^(2l) of the nearest is 1e-23 there
    for axis, weight in ((2, lambda l: (l + 1.0) ** 2 * (l + 2)), (0, lambda l: l * (l + 1.0) * (l + 2) / 2)):
        value = 0.7 * np.eye(3)[axis]
        place = BALL.center + np.array([0, 0, distance])
        incident = from_magnetization(place[None], MU_0 * value[None], BALL, degree)
        found = multipole_force(incident, induced_sources(incident, permeability), BALL)
        expected = MU_0 * 0.49 / (4 * np.pi) * series(permeability, distance, weight)
        np.testing.assert_allclose(found, [0, 0, expected], rtol=1e-11, atol=1e-11 * expected)


def test_infinite_permeability_has_the_image_of_a_neutral_conductor():
    """Closed form: U = -(μ0 m²/8π) (R/d⁴) [(1+q)/(1-q)³ - 1], q = (R/d)², of a radial dipole."""
    distance, value, step = 0.01, 0.7, 1e-30

    def energy(d):
        q = (RADIUS / d) ** 2
        return -MU_0 * value**2 / (8 * np.pi) * RADIUS / d**4 * ((1 + q) / (1 - q) ** 3 - 1)

    place = BALL.center + np.array([0, 0, distance])
    incident = from_magnetization(place[None], np.array([[0, 0, MU_0 * value]]), BALL, 70)
    found = multipole_force(incident, induced_sources(incident, 1e13), BALL)
    assert found[2] == pytest.approx(energy(distance + 1j * step).imag / step, rel=1e-10)


def test_force_and_torque_against_maxwell_stress():
    """A magnetised sphere of μr = 3 in the field of two dipoles; the rule converges to round-off on its surface."""
    places, moments = BALL.center + np.array([[0.012, 0.003, 0.004], [-0.002, 0.011, -0.009]]), np.eye(3)[:2] * 1e-6
    incident = from_magnetization(places, moments, BALL, 45)
    sources = dipole_sources(floater(3.0).moment * DIRECTION, BALL, 45) + induced_sources(incident, 3.0)

    def field(points):
        return field_of_dipoles(points, places, moments) + outer_field(sources, BALL, points)

    stress = maxwell_stress(field, BALL.center, 1.2 * RADIUS, 60)
    np.testing.assert_allclose(
        multipole_force(incident, sources, BALL), stress[0], rtol=0, atol=1e-9 * np.abs(stress[0]).max()
    )
    np.testing.assert_allclose(
        multipole_torque(incident, sources, BALL), stress[1], rtol=0, atol=1e-9 * np.abs(stress[1]).max()
    )


# both bodies


@pytest.fixture(scope="module")
def rotors():
    return element_ladder(horizontal(0.002, 0.01, 1.305, 1.05), (2, 3))


@pytest.mark.slow
def test_rigid_dipole_is_the_table_of_the_rotor(rotors):
    """F = (m·∇)B and m × B with the rotor's table, made by other functionals of another solution."""
    table = rotor_table(rotors[0].magnets, "fem", 1e-6)
    b, gradient = table.evaluate(PLACE[None])
    rigid = two_body(rotors[-1], PERMEABLE, PLACE, DIRECTION).rigid
    dipole = PERMEABLE.moment * DIRECTION
    # 1e-6: both are below it, the table from 1.5 circumradii on (this is 1.67) by its request
    np.testing.assert_allclose(rigid.force, gradient[0] @ dipole, rtol=0, atol=3e-6 * np.linalg.norm(rigid.force))
    np.testing.assert_allclose(rigid.torque, np.cross(dipole, b[0]), rtol=0, atol=3e-6 * np.linalg.norm(rigid.torque))


@pytest.mark.slow
def test_both_bodies_solved_at_once_agree(rotors):
    """What the answers add, against a mesh of both bodies: 5e-4 of it, the error of order 3 elements on that mesh."""
    both, error = two_body_ladder(rotors, PERMEABLE, PLACE, DIRECTION)
    mesh = mesh_two_bodies(rotors[0].magnets, PLACE, RADIUS, 0.25)
    whole = solve_both_bodies(mesh, PERMEABLE, PLACE, DIRECTION)
    added = both.total - both.rigid
    apart = whole - both.total
    assert np.linalg.norm(apart.force) < 5e-4 * np.linalg.norm(added.force)
    assert np.linalg.norm(apart.torque) < 2e-3 * np.linalg.norm(added.torque)
    assert np.linalg.norm(error.force) < 2e-3 * np.linalg.norm(added.force)


@pytest.mark.slow
def test_dipoles_in_one_mesh_of_both_agree(rotors):
    """By the sums that serve floaters of any shape (`test_mutual`), of a sphere, whose answer is exact: to 1e-3."""
    both = two_body(rotors[-1], PERMEABLE, PLACE, DIRECTION, 0, 1e-8)
    known = both.total - both.rigid
    ball = Magnet(Sphere(RADIUS, PLACE), PERMEABLE.remanence * DIRECTION, PERMEABLE.recoil_permeability)
    apart = added_to_body(rotors[-1].magnets, ball, 0.25) - known
    force, torque = (np.linalg.norm(getattr(apart, n)) / np.linalg.norm(getattr(known, n)) for n in ("force", "torque"))
    print(f"\nforce to {force:.1e}, torque to {torque:.1e} of what is added")
    assert force < 1e-3
    assert torque < 1e-3


@pytest.mark.slow
def test_high_permeability_settles_as_well():
    """μr = 3 in both bodies: more terms, and the direct solution still agrees."""
    body = floater(3.0)
    rotor = element_ladder(horizontal(0.002, 0.01, 1.305, 3.0), (3,))[0]
    both = two_body(rotor, body, PLACE, DIRECTION)
    whole = solve_both_bodies(mesh_two_bodies(rotor.magnets, PLACE, RADIUS, 0.25), body, PLACE, DIRECTION)
    assert both.terms > 5
    assert np.linalg.norm(whole.force - both.total.force) < 3e-3 * np.linalg.norm(both.total.force)


def test_action_is_reaction(rotors):
    """Stress on a sphere about the rotor against the floater's force, with the field of all magnetisation."""
    place = np.array([0.001, 0.002, -0.021])
    both = two_body(rotors[0], PERMEABLE, place, DIRECTION)
    induced = rotors[0].induced_dipoles(both.sources, both.ball)
    ball = Ball(rotors[0].mesh.center, 0.01)
    permeable = [
        moments_of_magnetization(p, np.ones(len(p)), m, ball.center, rotors[0].mesh.unit, 40)
        for p, m in (induced, rotors[0].remanent_dipoles)
    ]
    magnet = Ball(ball.center, rotors[0].mesh.unit)
    coefficients = sum(permeable) + uniform_moments(rotors[0].magnets[0], 40).coefficients

    def field(points):
        return outer_field(coefficients, magnet, points) + outer_field(both.sources, both.ball, points)

    on_rotor, _ = maxwell_stress(field, ball.center, 0.0115, 60)
    # 1e-5: multipoles beyond degree 40 on the sphere, (8.66/11.5)^40
    np.testing.assert_allclose(on_rotor, -both.total.force, rtol=0, atol=1e-5 * np.linalg.norm(on_rotor))


def test_rigid_floater_and_rotor_of_unit_permeability():
    """μr = 1: each answer vanishes exactly, and the rigid dipole in the closed form is the whole."""
    rotor = element_ladder(vertical(0.014, 0.01, 1.305, 1.0), (2,))[0]
    both = two_body(rotor, floater(1.0), PLACE, DIRECTION)
    assert np.array_equal(both.total.force, both.rigid.force)
    assert both.terms == 1
    closed = remanent_field(rotor.magnets, PLACE[None])[0]
    np.testing.assert_allclose(field_at_center(both.incident), closed, rtol=0, atol=1e-12 * np.linalg.norm(closed))


def test_answers_are_first_order_in_the_susceptibility():
    """Limit μr → 1: what the floater's answer adds is in proportion to (μr - 1)/(μr + 2) but for higher degrees."""
    rotor = element_ladder(horizontal(0.002, 0.01, 1.305, 1.0), (2,))[0]
    added = [two_body(rotor, floater(1 + chi), PLACE, DIRECTION).floater_answer.force / chi for chi in (1e-3, 1e-6)]
    np.testing.assert_allclose(added[0], added[1], rtol=0, atol=1e-3 * np.linalg.norm(added[1]))


def test_degree_follows_the_nearest_edge(rotors):
    near, far = (enough_degree(rotors[0].magnets, Ball(np.array([0, 0, z]), RADIUS)) for z in (-0.0115, -0.05))
    assert far < 10 < 30 < near


def test_overlapping_bodies_are_refused(rotors):
    with pytest.raises(TwoBodyError, match="cuts magnet 0"):
        two_body(rotors[0], PERMEABLE, np.array([0.0, 0.0, -0.011]), DIRECTION)


def test_dipole_sources_and_moment_are_inverse():
    np.testing.assert_allclose(moment(dipole_sources(DIRECTION, BALL, 4), BALL), DIRECTION, rtol=1e-14)
