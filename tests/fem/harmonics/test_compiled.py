"""What the compiler may reorder stays at round-off: compiled fields against the same fields by other ways."""

import numpy as np
import pytest

from spinlev.fem.closed_forms.uniform import UniformField
from spinlev.fem.elements.second_opinion import coulomb_field
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.harmonics.expressions import FEW, CompiledField
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box

WAY = np.random.default_rng(3).normal(size=(100, 3))
POINTS = np.linspace(0.013, 0.04, 100)[:, None] * WAY / np.linalg.norm(WAY, axis=1)[:, None]
"""Where a floater may be."""


@pytest.fixture(params=[(1.305, 0, 0), (0.3, -0.7, 1.1)])
def magnet(request):
    return Magnet(Box((0.01, 0.01, 0.01)), request.param)


def worst(values, exact, axes):
    return (np.linalg.norm(values - exact, axis=axes) / np.linalg.norm(exact, axis=axes)).max()


def both(expressions):
    """B and gradient at `POINTS` by the code for few points, and by that for many."""
    field, copies = CompiledField(expressions), FEW // len(POINTS) + 1
    yield field(POINTS)
    yield tuple(part[: len(POINTS)] for part in field(np.tile(POINTS, (copies, 1))))
    assert field._for_few is not field._for_many


def test_closed_form_is_coulombs_law_to_1e_13(magnet):
    """Against 80-bit numbers: 4e-14 was measured, with and without reordering."""
    exact = coulomb_field(magnet, POINTS)
    for field, _ in both(UniformField(magnet).expressions):
        assert worst(field, exact, 1) < 1e-13


def test_expansion_is_its_sum_to_1e_13(magnet):
    """B and gradient against NumPy, which knows another recurrence."""
    expansion = uniform_moments(magnet, 17)
    summed = expansion.evaluate(POINTS)
    for compiled in both(expansion.expressions):
        for values, exact, axes in zip(compiled, summed, (1, (1, 2)), strict=True):
            assert worst(values, exact, axes) < 1e-13
