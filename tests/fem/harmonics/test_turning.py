"""Turned coefficients against values of the same field at turned points."""

import numpy as np
import pytest

from spinlev.fem.harmonics.expansion import MultipoleExpansion, uniform_moments
from spinlev.fem.harmonics.solid import rotated_harmonics
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box, rotation_matrix

RNG = np.random.default_rng(5)
WAYS = RNG.normal(size=(40, 3))
OUTSIDE = RNG.uniform(1.1, 3.0, (40, 1)) * WAYS / np.linalg.norm(WAYS, axis=1)[:, None]


@pytest.mark.parametrize("angles", [(20, 35, -50), (0, -10, 0), (180, 0, 0), (0, 90, 0), (0, 0, 30)])
def test_a_turned_field_is_the_field_at_turned_places(angles):
    axes = rotation_matrix(angles)
    moments = uniform_moments(Magnet(Box((0.01, 0.012, 0.007)), (0.3, -0.7, 1.1)), 25).coefficients
    still, turned = (MultipoleExpansion(np.zeros(3), 1.0, c) for c in (moments, rotated_harmonics(moments, axes)))
    field, slope = still.evaluate(OUTSIDE)
    there = turned.evaluate(OUTSIDE @ axes.T)
    assert np.abs(there[0] - field @ axes.T).max() < 1e-14 * np.abs(field).max()
    assert np.abs(there[1] - axes @ slope @ axes.T).max() < 1e-14 * np.abs(slope).max()


def test_there_and_back_is_nothing_at_high_degree():
    axes = rotation_matrix((70, -20, 10))
    moments = uniform_moments(Magnet(Box((0.01, 0.012, 0.007)), (0.3, -0.7, 1.1)), 49).coefficients
    back = rotated_harmonics(rotated_harmonics(moments, axes), axes.T)
    near = 1.001 * OUTSIDE / np.linalg.norm(OUTSIDE, axis=1)[:, None]
    field = MultipoleExpansion(np.zeros(3), 1.0, moments).evaluate(near)[0]
    left = MultipoleExpansion(np.zeros(3), 1.0, back - moments).evaluate(near)[0]
    assert np.abs(left).max() < 1e-13 * np.abs(field).max()
