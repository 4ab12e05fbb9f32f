"""Plate tables against the full finite elements on another mesh, at places and frequencies not used in the making."""

from __future__ import annotations

import numpy as np
import pytest
from second_opinions.plate_tables import over_face

from spinlev.fem.plate.eddy import plate_reaction
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import plate_table
from spinlev.geometry.meshes.plate import MeshRule
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.shapes import Box

pytestmark = pytest.mark.slow
PLATE = Plate(Box((0.1, 0.24, 0.03)), 3.5e7)
COLUMN = over_face(PLATE.box.size, (0.01, 0.04), 0.005)
FINER, FINEST = MeshRule(1.0, 1.6, 1.4, 18.0), MeshRule(0.9, 1.5, 1.3, 18.0)
"""For the reference: other cells than the table's, and air that reaches farther."""
POINT = Region((-0.003, 0.002, 0.032), (0.003, 0.008, 0.038))


def deviation(table, region, frequencies, reference_rtol, rule):
    """Largest relative difference (Frobenius norm) from the finite elements; one place is near the nearest corner."""
    inside = np.concatenate([np.random.default_rng(11).random((4, 3)), [[0.98, 0.03, 0.02]]])
    points = region.lower + (region.upper - region.lower) * inside
    worst = 0.0
    for frequency in frequencies:
        exact = plate_reaction(PLATE, points, frequency, reference_rtol, rule).tensors
        found = table.reaction_tensor(points, frequency)
        worst = max(worst, np.max(np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))))
    print(f"\n{len(table.rates)} states, {table.weights.shape[1]} multipoles, {table.errors}, "
          f"{table.provenance['seconds']:.0f} s, deviation {worst:.1e}")  # fmt: skip
    return worst


def test_column_over_the_plate_to_a_thousandth():
    """10-40 mm, ±5 mm, 0.5-250 Hz: 1e-3 with at most 80 states; the reference adds at most 2e-4."""
    table = plate_table(PLATE, COLUMN, (0.5, 250.0), 1e-3)
    assert len(table.rates) <= 80
    assert table.errors.total <= 1e-3
    assert deviation(table, COLUMN, (2.0, 80.0, 180.0), 2e-4, FINER) <= 1e-3


def test_surroundings_of_a_point_with_few_states():
    """±3 mm about a place off the axis: 1e-3 with at most 30 states."""
    table = plate_table(PLATE, POINT, (0.5, 250.0), 1e-3)
    assert len(table.rates) <= 30
    assert deviation(table, POINT, (2.0, 130.0), 2e-4, FINER) <= 1e-3


def test_column_over_the_plate_to_a_ten_thousandth():
    """1e-4 with at most 160 states; the reference is on a finer mesh, its own estimated error 1e-4 as well."""
    table = plate_table(PLATE, COLUMN, (0.5, 250.0), 1e-4)
    assert len(table.rates) <= 160
    assert deviation(table, COLUMN, (80.0,), 1e-4, FINEST) <= 1e-4
