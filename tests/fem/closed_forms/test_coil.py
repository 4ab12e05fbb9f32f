"""Field of a round coil: against loops over its cross-section, its own curl, and the dipole that it is far off."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from spinlev.fem.closed_forms.coil import CoilField, Filaments, coils_field
from spinlev.fem.harmonics.solid import tensors
from spinlev.geometry.common import MU_0
from spinlev.geometry.scene.contents import Coil

COIL = Coil(np.array([0.01, -0.02, 0.005]), 0.041, 0.028, 0.052, 960.0, 1.0)
FIELD = CoilField([COIL])
PLACES = {
    "over a turn": (0.03, 0.0298),
    "at an edge": (0.0549, 0.03),
    "near the axis": (0.001, 0.04),
    "far": (0.2, 0.3),
}


def at(rho, z):
    return COIL.center + np.array([rho, 0.0, z])


@pytest.mark.parametrize("name", PLACES)
def test_potential_is_that_of_its_loops(name):
    rho, z = PLACES[name]
    nodes, weights = np.polynomial.legendre.leggauss(300)
    a, b = COIL.radius + COIL.width / 2 * nodes[:, None], COIL.height / 2 * nodes
    k = 4 * a * rho / ((a + rho) ** 2 + (z - b) ** 2)
    loops = MU_0 / np.pi * np.sqrt(a / rho / k) * ((1 - k / 2) * ellipk(k) - ellipe(k))
    expected = COIL.turns * weights @ loops @ weights / 4
    found = FIELD.vector_potential(at(rho, z))[0]
    assert found[1] == pytest.approx(expected, rel=1e-10 if rho > 0.01 else 1e-8)  # loops cancel near the axis
    assert found[[0, 2]] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("place", [*PLACES.values(), (0.041, 0.01), (0.028, 0.0)])  # also in the winding
def test_flux_density_is_the_curl(place):
    point, step = at(*place), 2e-4
    slopes = np.empty((3, 3))  # of component i along j
    for j, axis in enumerate(np.eye(3)):
        ends = FIELD.vector_potential([point + s * step * axis for s in (2, 1, -1, -2)])
        slopes[:, j] = np.array([-1, 8, -8, 1]) @ ends / (12 * step)
    curl = [slopes[2, 1] - slopes[1, 2], slopes[0, 2] - slopes[2, 0], slopes[1, 0] - slopes[0, 1]]
    size = np.linalg.norm(FIELD.flux_density(point))
    assert FIELD.flux_density(point)[0] == pytest.approx(curl, abs=1e-7 * size)


def test_on_the_axis_far_off_it_is_a_dipole():
    moment = COIL.turns * np.pi * (COIL.radius**2 + COIL.width**2 / 12)
    field = FIELD.flux_density(at(0.0, 3.0))[0]
    assert field[2] == pytest.approx(MU_0 * moment / (2 * np.pi * 3.0**3), rel=1e-3)
    assert field[:2] == pytest.approx(0.0, abs=1e-20)


def test_shares_are_currents():
    other, place = Coil(np.array([0.0, 0.0, -0.1]), 0.05, 0.01, 0.02, 10.0, 1.0), at(0.02, 0.05)
    both = CoilField([COIL, other], [2.0, -3.0]).flux_density(place)
    assert both == pytest.approx(2 * FIELD.flux_density(place) - 3 * CoilField([other]).flux_density(place))


def test_filaments_have_the_field_of_their_coils_where_a_floater_can_be():
    """1e-5 of the largest field where it touches a winding, 1e-8 three of its radii off; the gradient is its slope."""
    other, near = Coil(np.array([0.0, 0.0, -0.1]), 0.03, 0.005, 0.02, 10.0, 1.0), 6.35e-3
    coils, currents = (COIL, other), np.array([2.0, -300.0])
    known, filaments = CoilField(coils, currents.tolist()), Filaments.of(coils, near)
    points = np.random.default_rng(5).uniform(-0.1, 0.1, (400, 3)) - [0.0, 0.0, 0.05]
    points[:20, :2] = 0.0  # on an axis, where ρ has no derivative
    apart = np.min([coil.body.distance(points) for coil in coils], axis=0)
    points, apart = points[apart > near], apart[apart > near]
    b, gradient = tensors(filaments.derivatives(points, 2, currents))
    missed, largest = np.abs(b - known.flux_density(points)).max(axis=1), np.abs(b).max()
    assert missed.max() < 1e-5 * largest
    assert missed[apart > 3 * near].max() < 1e-8 * largest
    ends = [known.flux_density(points + s * 1e-4 * axis) for axis in np.eye(3) for s in (2, 1, -1, -2)]
    slopes = np.tensordot([-1, 8, -8, 1], np.reshape(ends, (3, 4, -1, 3)), (0, 1)) / 12e-4
    assert np.moveaxis(slopes, 0, -1) == pytest.approx(gradient, abs=2e-4 * np.abs(gradient).max())


def test_expressions_of_filaments_are_what_is_evaluated():
    filaments, currents = Filaments.of((replace(COIL, width=1e-3, height=1e-3),), 0.02), np.array([3.0])
    variables = hy.make_vars("x", "y", "z")
    field, gradient = filaments.expressions(variables, currents.tolist())
    function = hy.cfunc(
        [*field, *(entry for row in gradient for entry in row)], variables, compact_mode=True, opt_level=0
    )
    points = np.array([[*COIL.center[:2], 0.035], [0.05, 0.1, 0.0]])
    b, slopes = tensors(filaments.derivatives(points, 2, currents))
    expected = np.concatenate([b, slopes.reshape(-1, 9)], axis=1)
    np.testing.assert_allclose(function(np.ascontiguousarray(points.T)).T, expected, rtol=1e-12, atol=1e-18)


def test_the_field_of_coils_is_the_closed_forms_near_windings_and_that_of_filaments_far_off():
    """At both sides of the distance from which filaments are taken, and with no point at all."""
    size = max(COIL.width, COIL.height)
    away = np.array([0.0, 0.3, 0.99, 1.01, 4.0]) * size
    points = COIL.center + np.stack([COIL.radius + COIL.width / 2 + away, 0 * away, 0 * away], axis=1)
    b, slopes = coils_field([COIL], np.array([2.0]), points)
    field = CoilField([COIL], [2.0])
    np.testing.assert_allclose(b, field.flux_density(points), atol=1e-8 * np.abs(b).max())
    ends = [field.flux_density(points[1:] + s * np.array([0.0, 0.0, 1e-5])) for s in (1, -1)]
    np.testing.assert_allclose(slopes[1:, :, 2], (ends[0] - ends[1]) / 2e-5, atol=1e-5 * np.abs(slopes).max())
    assert coils_field([COIL], np.array([2.0]), points[:0])[1].shape == (0, 3, 3)
