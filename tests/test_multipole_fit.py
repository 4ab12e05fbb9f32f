"""Fit of field functions by few multipoles."""

from __future__ import annotations

import numpy as np
import pytest

from spinlev.fem.field_functions import Multipoles, candidates
from spinlev.fem.multipole_fit import fit_multipoles
from spinlev.fem.plate_region import Region

REGION = Region.over_face((0.1, 0.1, 0.02), (0.015, 0.025), 0.004)
CHOICE = candidates(REGION, np.array([0.05, 0.05, 0.01]))
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
