"""Fields by NumPy and by one code for all magnets against the same fields by other ways: round-off."""

import heyoka as hy
import numpy as np
import pytest
from scipy.special import assoc_legendre_p

from spinlev.fem.closed_forms.uniform import UniformField
from spinlev.fem.elements.magnetostatics import coulomb_field
from spinlev.fem.harmonics.expansion import MultipoleExpansion, summed_derivatives, uniform_moments
from spinlev.fem.harmonics.expressions import CompiledField, regular_harmonics
from spinlev.fem.harmonics.solid import BLOCK, entries, members, outer_sums, rotated_harmonics, tensors, weighted_sums
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box, Cylinder, Sphere, rotation_matrix

WAY = np.random.default_rng(3).normal(size=(100, 3))
POINTS = np.linspace(0.015, 0.04, 100)[:, None] * WAY / np.linalg.norm(WAY, axis=1)[:, None]
"""Where a floater may be."""
TURN = rotation_matrix((25.0, -40.0, 10.0))
BODIES = [
    Box((0.01, 0.01, 0.01)),
    Box((0.01, 0.012, 0.007), (1e-3, 2e-3, 0.0), TURN),
    Cylinder(5e-3, 8e-3, (0.0, 0.0, 1e-3), TURN),
    Cylinder(6e-3, 5e-3, inner_radius=3e-3),
    Sphere(5e-3, (1e-3, 0.0, 0.0)),
]


@pytest.fixture(params=[pytest.param((1.305, 0, 0), marks=pytest.mark.slow), (0.3, -0.7, 1.1)])
def polarization(request):
    return request.param


def worst(values, exact):
    """Largest relative error of tensors (n, ...), each by its own size."""
    missed, whole = (np.linalg.norm(part.reshape(len(part), -1), axis=1) for part in (values - exact, exact))
    return (missed / whole).max()


def test_closed_form_is_coulombs_law_to_1e_13(polarization):
    """Against 80-bit numbers: 4e-14 was measured, with and without reordering."""
    magnet = Magnet(BODIES[0], polarization)
    exact = coulomb_field(magnet, POINTS)
    assert worst(UniformField(magnet).evaluate(POINTS)[0], exact) < 1e-13
    assert worst(CompiledField(UniformField(magnet).expressions)(POINTS)[0], exact) < 1e-13


@pytest.mark.parametrize("degree", [1, 5, 6, 13, 24, 25, 40])
def test_the_harmonics_of_charges_are_their_potential(degree):
    """Σ q/|r - s| of charges in a sphere, far from which the degrees left out are round-off, or as many as they are."""
    rng = np.random.default_rng(degree)
    way = rng.normal(size=(50, 3))
    sources = 0.4 * way[:20] / np.linalg.norm(way[:20], axis=1)[:, None]
    points, amounts = 4 * way / np.linalg.norm(way, axis=1)[:, None], rng.normal(size=(20, 2))
    found = outer_sums([np.conj(part) for part in weighted_sums(degree, sources, amounts)], points)
    exact = (1 / np.linalg.norm(points[:, None] - sources, axis=-1)) @ amounts
    assert np.abs(found - exact).max() < (4 * 0.1**degree + 1e-14) * np.abs(exact).max()


def test_the_code_of_all_cuboids_is_each_ones_own_closed_form():
    """All derivatives up to the third, which a search asks for."""
    form = UniformField(Magnet(BODIES[1], (0.3, -0.7, 1.1)))
    theirs = CompiledField(form.expressions).derivatives(POINTS, 4)
    for ours, own in zip(tensors(form.derivatives(POINTS, 4)), tensors(theirs), strict=True):
        assert worst(ours, own) < 1e-11  # terms of 1e-2 cancel in the third


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_each_derivative_is_that_of_the_one_before(body):
    form, step = UniformField(Magnet(body, (0.3, -0.7, 1.1))), 1e-5
    known = tensors(form.derivatives(POINTS, 4))
    for axis in range(3):
        ends = [tensors(form.derivatives(POINTS + s * step * np.eye(3)[axis], 3)) for s in (1, -1)]
        for above, below, slope in zip(*ends, known[1:], strict=True):
            difference = (above - below) / (2 * step)
            assert worst(difference, slope[..., axis]) < 1e-3  # (step/distance)²


def test_expansions_are_their_expressions_and_their_sum_to_1e_13(polarization):
    """Expressions know another recurrence; several at once share the steps of one, at few points and at many."""
    one = uniform_moments(Magnet(BODIES[1], polarization), 7)
    turned = rotated_harmonics(one.coefficients[:4, :4], TURN)
    other = MultipoleExpansion(np.array([1e-3, -1e-3, 0.0]), one.radius, turned, TURN)
    for part in (one, other):
        theirs = tensors(CompiledField(part.expressions).derivatives(POINTS, 3))
        for ours, own in zip(tensors(part.derivatives(POINTS, 3)), theirs, strict=True):
            assert worst(ours, own) < 1e-12
    many = np.tile(POINTS, (2 * BLOCK // len(POINTS) + 1, 1))
    apart = one.derivatives(many, 2) + other.derivatives(many, 2)
    for count in (1, 7, 100, len(many)):
        together = summed_derivatives((other, one, other), many[:count], 2) - other.derivatives(many[:count], 2)
        np.testing.assert_allclose(together, apart[:count], rtol=0, atol=1e-13 * np.abs(apart).max())


def test_entries_tell_a_whole_tensor():
    """Of x² - z² and of xyz: symmetric, without trace."""
    values = np.zeros((1, 15))
    values[0, 3 + entries(2).index((0, 0))] = 2.0
    values[0, 8 + entries(3).index((0, 1, 2))] = 1.0
    _, second, third = tensors(values)
    np.testing.assert_array_equal(second[0], np.diag([2.0, 0.0, -2.0]))
    assert third[0].sum() == 6.0
    assert third[0, 2, 1, 0] == 1.0


def test_regular_harmonics_are_scipys_by_few_products():
    """By associated Legendre functions, on the unit sphere, to degree 9; and a quarter of products less than before."""
    places, variables = WAY / np.linalg.norm(WAY, axis=1)[:, None], hy.make_vars("x", "y", "z")
    written = regular_harmonics(9, variables)
    found = hy.cfunc(written, variables, opt_level=0)(np.ascontiguousarray(places.T))
    angle = np.arctan2(places[:, 1], places[:, 0])
    for value, (l, m, part) in zip(found, members(9), strict=True):
        zonal = assoc_legendre_p(l, m, places[:, 2])[0]
        exact = (-1.0) ** m * zonal * (np.sin(m * angle) if part else np.cos(m * angle))
        scale = (exact @ value) / (value @ value)
        assert np.abs(scale * value - exact).max() < 2e-14 * np.abs(exact).max()
    few = regular_harmonics(4, variables)
    operations = hy.taylor_adaptive([(v, hy.sum(few[k::3])) for k, v in enumerate(variables)], compact_mode=True)
    squares = [str(e) for e, _ in operations.decomposition if str(e).count("u_") == 2 and " * " in str(e)]
    assert len(squares) == 23  # 30 by recurrences, 21 of whatever kind
