"""Fit of field functions by few multipoles."""

from __future__ import annotations

import numpy as np
import pytest
from second_opinions.plate_tables import over_face

from spinlev.fem.plate.multipoles import Multipoles, fit_multipoles
from spinlev.fem.plate.network import candidates
from spinlev.geometry.shapes import Box

REGION = over_face((0.1, 0.1, 0.02), (0.015, 0.025), 0.004)
CHOICE = candidates(REGION, Box([0.1, 0.1, 0.02]))
DIPOLE = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1]], float)
POINTS = REGION.surface((6, 6, 6))


def fitted(choice, values, tolerance, step=1):
    ones = np.ones(len(values)), np.ones(len(POINTS))
    return fit_multipoles(choice, POINTS, values, *ones, tolerance, lambda error: True, step)


def test_fields_without_compilation_are_the_compiled_ones():
    """Two programs of the same sums, of 250 multipoles of all kinds: round-off."""
    found, compiled = CHOICE.fields(POINTS), CHOICE.evaluate(POINTS)[0]
    assert abs(found - compiled).max() < 1e-13 * abs(compiled).max()


def test_a_sum_of_candidates_is_found():
    """Three of 250 candidates give back a function that they make, to the tolerance, within ten multipoles."""
    few = CHOICE.subset([20, 77, 130])
    values = np.tensordot([2.0, -1.0, 0.5], few.fields(POINTS), (0, 1))[None]
    scale = abs(values).max()
    fit = fitted(CHOICE, values, 1e-4 * scale)
    assert len(fit.multipoles.kinds) <= 10
    rebuilt = np.tensordot(fit.weights, fit.multipoles.fields(POINTS), (1, 1))
    assert abs(rebuilt - values).max() <= 1e-4 * scale
    assert values - rebuilt == pytest.approx(fit.error, abs=1e-9 * scale)


@pytest.mark.parametrize("step", [1, 2])
def test_a_fit_ends_where_its_candidates_do(step):
    """Two candidates, each there twice, cannot make a third multipole: both are taken, and the error is told."""
    twice = CHOICE.subset([20, 77])
    choice = Multipoles(np.tile(twice.centers, (2, 1)), np.tile(twice.kinds, (2, 1)), twice.scale)
    values = CHOICE.subset([130]).fields(POINTS).swapaxes(0, 1)
    fit = fitted(choice, values, 0.0, step)
    assert len(fit.multipoles.kinds) == 2
    rebuilt = np.tensordot(fit.weights, fit.multipoles.fields(POINTS), (1, 1))
    assert values - rebuilt == pytest.approx(fit.error, abs=1e-9 * abs(values).max())


def test_no_functions_need_no_multipoles():
    assert fitted(CHOICE, np.zeros((0, len(POINTS), 3)), 1e-3).weights.shape == (0, 0)


def test_a_higher_degree_reaches_off_axis_images():
    """Mirror dipoles below a face 10 mm away, 5 mm off the axis: degree 4 ends near 3e-4, 7 below 1e-6."""
    size, column = np.array([0.1, 0.24, 0.03]), over_face((0.1, 0.24, 0.03), (0.01, 0.04), 0.005)
    points = column.surface((7, 7, 13))
    places = column.grid((2, 2, 3)) * [1, 1, -1] + [0, 0, size[2]]
    values = np.concatenate([Multipoles(np.tile(p, (3, 1)), DIPOLE, 0.01).fields(points) for p in places], axis=1)
    values = values.swapaxes(0, 1)
    values /= np.linalg.norm(values, axis=(1, 2))[:, None, None]
    near = 1 / np.sqrt(np.sum(values**2, axis=(0, 2)))
    worst = []
    for degree in (4, 7):
        choice = candidates(column, Box(size), degree)
        fit = fit_multipoles(choice, points, values, np.ones(len(values)), near, 0.0, lambda error: False)
        worst.append(np.sqrt(np.sum((fit.error * near[:, None]) ** 2, axis=(0, 2))).max())
    assert worst[0] > 1e-4
    assert worst[1] < 1e-6
