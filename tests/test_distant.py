"""A table for the distance at which a floater flies."""

import numpy as np
import pytest

from spinlev.fem.accuracy import Accuracy, shell, typical_field
from spinlev.fem.distant import distant
from spinlev.fem.models import rotor_table
from spinlev.fem.multipole import uniform_moments
from spinlev.geometry import horizontal

ROTOR = horizontal(2e-3, 10e-3, 1.305, 1.0)
RTOL, CONTACT, FAR = 1e-4, 6.35e-3, 12e-3


def coefficients(table):
    return sum(np.count_nonzero(e.coefficients) for e in table.expansions)


def test_fewer_coefficients_do_from_farther_on():
    """From 12 mm on to the same accuracy as the whole table, and beyond; nearer as wrong as it says."""
    whole = rotor_table(ROTOR, "moments", RTOL, CONTACT)
    table = distant(whole, Accuracy(RTOL, FAR))
    exact = uniform_moments(ROTOR[0], 49)
    assert coefficients(table) < coefficients(whole) / 2
    for offset in (CONTACT, FAR, 1.7 * FAR, 5 * FAR):
        points = shell(ROTOR, offset)
        wrong = np.linalg.norm(sum(e.evaluate(points)[0] for e in table.expansions) - exact.evaluate(points)[0], axis=1)
        error = table.absolute_error(points)[0]
        assert error == pytest.approx(wrong, rel=1e-3, abs=1e-4 * error.max())  # what is cut off is known
        if offset >= FAR:
            assert np.all(error <= RTOL * typical_field(ROTOR, points))


def test_a_closed_form_stays_as_it_is():
    table = rotor_table(ROTOR, "cuboid")
    assert distant(table, Accuracy(RTOL, FAR)) is table
