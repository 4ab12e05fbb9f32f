"""Cylinders: their distance and overlap against exact values; which conductors are one piece of metal."""

import numpy as np
import pytest

from spinlev.geometry.magnets import Conductor
from spinlev.geometry.overlap import body_overlap, separate_pieces
from spinlev.geometry.shapes import Box, Cylinder, rotation_matrix

TURN = rotation_matrix((20.0, -35.0, 50.0))
CENTER = np.array([1e-3, -2e-3, 4e-3])
CYLINDER = Cylinder(3e-3, 10e-3, CENTER, TURN)


@pytest.mark.parametrize(
    ("body", "distance"),
    [
        ((5e-3, 0, 0), 2e-3),
        ((0, 0, 8e-3), 3e-3),
        ((6e-3, 0, -9e-3), 5e-3),
        ((0, 1e-3, 0), -2e-3),
        ((0, 0, 4e-3), -1e-3),
    ],
)
def test_distance_of_points_from_a_cylinder(body, distance):
    """Beside the mantle, over an end, off the rim (3, 4, 5), and inside."""
    assert CYLINDER.distance(CENTER + TURN @ np.array(body)) == pytest.approx(distance, abs=1e-15)


@pytest.mark.parametrize("gap", [-2e-3, -1e-9, 0.0, 1e-9, 1e-3])
def test_overlap_of_a_cylinder_with_what_it_faces(gap):
    """Its end on a face, its mantle on a face, its mantle on another's: exact, in any pose."""
    for way, reach in ((TURN[:, 2], 5e-3), (TURN[:, 0], 3e-3)):
        box = Box((8e-3, 8e-3, 8e-3), CENTER + (reach + 4e-3 + gap) * way, TURN)
        assert body_overlap(CYLINDER, box) == pytest.approx(-gap, abs=1e-15)
    other = Cylinder(
        2e-3, 6e-3, CENTER + (5e-3 + gap) * (0.6 * TURN[:, 0] + 0.8 * TURN[:, 1]) + 1e-3 * TURN[:, 2], TURN
    )
    assert body_overlap(CYLINDER, other) == pytest.approx(-gap, abs=1e-15)


def test_gap_between_a_rim_and_an_edge_is_found():
    """A rim before an edge that runs across it: a distance in a plane, found by search to its square."""
    box = Box((4e-3, 20e-3, 4e-3), (8e-3, 0.0, 10e-3))
    assert body_overlap(Cylinder(3e-3, 10e-3), box) == pytest.approx(-np.hypot(3e-3, 3e-3), rel=1e-8)


def test_touching_conductors_of_one_conductivity_are_one_piece():
    shaft = Conductor(Cylinder(2e-3, 20e-3), 1.4e6)
    flange = Conductor(Cylinder(8e-3, 2e-3, (0.0, 0.0, 11e-3)), 1.4e6)
    apart = Conductor(Cylinder(8e-3, 2e-3, (0.0, 0.0, 14e-3)), 1.4e6)
    brass = Conductor(Cylinder(8e-3, 2e-3, (0.0, 0.0, -11e-3)), 1.5e7)
    pieces = separate_pieces([shaft, apart, flange, brass])
    assert sorted(map(len, pieces)) == [1, 1, 2]
    assert {shaft, flange} in [set(piece) for piece in pieces]
    bridge = Conductor(Cylinder(1e-3, 1e-3, (0.0, 0.0, 12.5e-3)), 1.4e6)
    assert sorted(map(len, separate_pieces([shaft, apart, flange, brass, bridge]))) == [1, 4]
