"""Expansions blended over a measure of the rotor: exact where they are polynomials of it."""

import heyoka as hy
import numpy as np
import pytest

from spinlev.dynamics.maps.family import Move, blend_tables, chebyshev_points
from spinlev.dynamics.motion.state import Parameter
from spinlev.fem.harmonics.expansion import MultipoleExpansion

RADIUS = 8e-3
CENTER = np.array([1e-3, -2e-3, 3e-3])
MEASURES = chebyshev_points(10e-3, 20e-3, 4)


def coefficients(measure):
    """A cubic polynomial of the measure."""
    rng, x = np.random.default_rng(3), measure / 15e-3
    parts = rng.normal(size=(4, 2, 4, 4))
    complex_parts = np.tril(parts[:, 0] + 1j * parts[:, 1])
    complex_parts[:, 0] = 0  # no monopole
    complex_parts[:, :, 0] = complex_parts[:, :, 0].real
    return sum(x**k * part for k, part in enumerate(complex_parts))


def tables(center=lambda measure: CENTER):
    return [(MultipoleExpansion(center(m), RADIUS, coefficients(m)),) for m in MEASURES]


def test_nodes_are_chebyshevs():
    assert np.all(np.diff(MEASURES) > 0)
    np.testing.assert_allclose(np.cos(4 * np.arccos((MEASURES - 15e-3) / 5e-3)), 0, atol=1e-12)


@pytest.mark.parametrize("measure", [10e-3, 12.3e-3, MEASURES[1], 20e-3])
def test_four_tables_give_a_cubic_exactly(measure):
    """Field and gradient to round-off: Lagrange's polynomials of four nodes hold cubics."""
    ((blend, move),) = blend_tables(tables(), MEASURES, [(CENTER, Move())])
    assert move == Move()
    variables = hy.make_vars("x", "y", "z")
    b, gradient = blend.expressions(variables)
    function = hy.cfunc([*b, *(g for row in gradient for g in row)], variables, compact_mode=True)
    points = CENTER + np.random.default_rng(0).normal(size=(20, 3)) * 2e-2 + [0, 0, -4e-2]
    pars = np.zeros((Parameter.MEASURE + 1, len(points)))
    pars[Parameter.MEASURE] = measure
    found = function(np.ascontiguousarray(points.T), pars=pars).T
    exact_b, exact_gradient = MultipoleExpansion(CENTER, RADIUS, coefficients(measure)).evaluate(points)[:2]
    np.testing.assert_allclose(found[:, :3], exact_b, rtol=0, atol=1e-12 * abs(exact_b).max())
    expected = exact_gradient.reshape(-1, 9)
    np.testing.assert_allclose(found[:, 3:], expected, rtol=0, atol=1e-12 * abs(expected).max())


def test_a_magnet_that_moves_takes_its_expansion_along():
    move = Move((0.0, 0.0, 1.0))
    ((blend, moved),) = blend_tables(tables(lambda m: CENTER + np.array([0.0, 0.0, m])), MEASURES, [(CENTER, move)])
    assert moved is move
    assert all(np.array_equal(expansion.center, CENTER) for expansion in blend.sources)


def test_magnets_cut_into_pieces_are_refused():
    with pytest.raises(ValueError, match=r"one expansion about each magnet's centre; instead it has 1 for 2 magnets"):
        blend_tables(tables(), MEASURES, [(CENTER, Move()), (CENTER, Move())])
