"""A table for the distance at which a floater flies."""

import numpy as np
import pytest

from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.plate.choice import rotor_nearby
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.models import Accuracy, points_around, shortened_table, typical_field
from spinlev.fem.rotor.near_field import complete
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import horizontal

ROTOR = horizontal(2e-3, 10e-3, 1.305, 1.0)
RTOL, CONTACT, FAR = 1e-4, 6.35e-3, 12e-3


def coefficients(table):
    return sum(np.count_nonzero(e.coefficients) for e in table.expansions)


def test_fewer_coefficients_do_from_farther_on():
    """From 12 mm on to the same accuracy as the whole table, and beyond; nearer as wrong as it says."""
    whole = rotor_table(ROTOR, "moments", RTOL, CONTACT)
    table = shortened_table(whole, Accuracy(RTOL, FAR))
    exact = uniform_moments(ROTOR[0], 49)
    assert coefficients(table) < coefficients(whole) / 2
    for offset in (CONTACT, FAR, 1.7 * FAR, 5 * FAR):
        points = points_around(ROTOR, offset)
        wrong = np.linalg.norm(sum(e.evaluate(points)[0] for e in table.expansions) - exact.evaluate(points)[0], axis=1)
        error = table.absolute_error(points)[0]
        assert error == pytest.approx(wrong, rel=1e-3, abs=1e-4 * error.max())  # what is cut off is known
        if offset >= FAR:
            assert np.all(error <= RTOL * typical_field(ROTOR, points))


def test_a_closed_form_stays_as_it_is():
    table = rotor_table(ROTOR, "cuboid")
    assert shortened_table(table, Accuracy(RTOL, FAR)) is table


def test_a_flight_takes_the_table_for_its_place():
    """At 22 mm below the cube it holds from 14 mm off the faces on, next to contact from contact on."""
    whole = rotor_table(ROTOR, "moments", RTOL, CONTACT)
    far, near = (rotor_nearby(whole, ROTOR, (2e-3, 0.0, z), CONTACT, RTOL) for z in (-22e-3, -13e-3))
    points = points_around(ROTOR, 14e-3)
    assert np.all(far.absolute_error(points)[0] <= RTOL * typical_field(ROTOR, points))
    assert coefficients(far) < coefficients(near) <= coefficients(whole)
    points = points_around(ROTOR, CONTACT)
    assert np.all(near.absolute_error(points)[0] <= 1.5 * RTOL * typical_field(ROTOR, points))


def test_what_a_table_finds_has_the_shape_of_its_points():

    points = np.random.default_rng(1).uniform(-1, 1, (3, 2, 3)) * 4e-3 - [0, 0, 0.02]
    for table in (rotor_table(ROTOR, "dipole"), complete(rotor_table(ROTOR, "cuboid"))):
        field, gradient = table.evaluate(points)
        assert (field.shape, gradient.shape) == ((3, 2, 3), (3, 2, 3, 3))
        assert [part.shape for part in table.relative_error(points)] == [(3, 2), (3, 2)]
        assert table.in_range(points).all()
        one, slope = table.evaluate(points[1, 1])
        np.testing.assert_allclose(one, field[1, 1], rtol=1e-12)
        np.testing.assert_allclose(slope, gradient[1, 1], rtol=1e-12, atol=1e-12)
    with pytest.raises(InputError, match=r"shape \(..., 3\); instead received \(2,\)"):
        table.evaluate([0.0, 1.0])
