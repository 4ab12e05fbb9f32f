"""Overlaps of bodies: exact depths, in any pose."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import linprog

from spinlev.geometry.overlap import apart, body_overlap, deepest_overlap_in_a_turn, parting, sphere_overlap
from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring, rotation_matrix
from spinlev.geometry.solids import moved

angle = st.floats(-180, 180)
length = st.floats(0.2, 3.0)
shift = st.floats(-3.0, 3.0)


def test_depth_of_boxes_along_an_axis_is_their_common_length():
    first, second = Box((2, 2, 2)), Box((2, 4, 6), (1.7, 0.3, 0.2))
    assert body_overlap(first, second) == pytest.approx(0.3, abs=1e-15)


def test_touching_boxes_overlap_by_nothing():
    assert body_overlap(Box((0.01,) * 3), Box((0.01,) * 3, (0, 0, 0.01))) == pytest.approx(0.0, abs=1e-17)


def test_edge_against_edge_needs_the_crossed_axes():
    # Two long bars crossing at right angles, each standing on its edge: only the product of edges parts them.
    first = Box((10, 1, 1), rotation=rotation_matrix((45, 0, 0)))
    second = Box((1, 10, 1), (0, 0, 1.5), rotation_matrix((0, 45, 0)))
    assert body_overlap(first, second) == pytest.approx(np.sqrt(2) - 1.5, abs=1e-12)


@settings(deadline=None)
@given(st.tuples(length, length, length), st.tuples(angle, angle, angle), st.tuples(shift, shift, shift))
def test_overlap_agrees_with_linear_programming(size, turn, center):
    # A point common to both boxes exists exactly if this linear programme is feasible.
    first, second = Box((1.0, 1.5, 2.0)), Box(size, center, rotation_matrix(turn))
    rows, bounds = [], []
    for box in (first, second):
        axes = box.rotation.T
        rows += [axes, -axes]
        bounds += [box.half_edges + axes @ box.center, box.half_edges - axes @ box.center]
    solved = linprog(np.zeros(3), A_ub=np.vstack(rows), b_ub=np.concatenate(bounds), bounds=(None, None))
    depth = body_overlap(first, second)
    if abs(depth) > 1e-7:  # within the solver's own tolerance both answers are right
        assert (depth > 0) == (solved.status == 0)


@settings(deadline=None, max_examples=30)
@given(
    st.sampled_from([Box((1.0, 1.5, 2.0)), Cylinder(0.7, 1.0), ring(0.8, 0.4, 1.0), Sphere(0.6)]),
    st.tuples(angle, angle, angle),
    st.tuples(shift, shift, shift),
    st.tuples(shift, shift, shift),
)
def test_bodies_are_parted_where_they_do_not_overlap_whichever_way_is_tried_first(body, turn, center, way):
    other = moved(Box((0.8, 1.1, 0.6)), np.array(center), rotation_matrix(turn))
    depth = body_overlap(body, other)
    first = np.array(way) / np.linalg.norm(way) if np.linalg.norm(way) > 1e-3 else None
    for tried in (None, first):
        found = parting(body, other, tried)
        if abs(depth) > 1e-7:
            assert (found is None) == (depth > 0)


def test_sphere_outside_a_face_an_edge_and_a_corner():
    box = Box((2, 2, 2))
    for point, distance in (((3, 0, 0), 2.0), ((2, 2, 0), np.sqrt(2)), ((2, 2, 2), np.sqrt(3)), ((0.5, 0, 0), -0.5)):
        assert sphere_overlap(point, 0.25, box) == pytest.approx(0.25 - distance, abs=1e-15)


def test_turning_corner_reaches_farther_than_the_face():
    # At rest the face stands 5 mm from the axis; in the turn the corner comes to 7.07 mm.
    rotor, plate = Box((10, 10, 10)), Box((2, 100, 100), (7.5, 0, 0))
    assert body_overlap(rotor, plate) < 0
    assert deepest_overlap_in_a_turn(rotor, plate) == pytest.approx(np.sqrt(50) - 6.5, abs=1e-9)


TURN = rotation_matrix((30.0, -20.0, 50.0))


@pytest.mark.parametrize(
    ("first", "second", "gap"),
    [
        (Sphere(1.0), Sphere(2.0, (0, 0, 4.0)), 1.0),
        (Sphere(1.0, (0, 0, 2.0)), Cylinder(3.0, 1.0), 0.5),
        (Sphere(1.0, (3.0, 0, 3.0)), Cylinder(2.0, 2.0), np.sqrt(5.0) - 1),  # to the edge
        (Cylinder(1.0, 4.0), Cylinder(2.0, 4.0, (4.0, 0, 1.0)), 1.0),  # mantle to mantle
        (Cylinder(1.0, 9.0), Cylinder(1.0, 9.0, (0, 0, 2.5), rotation_matrix((90.0, 0, 0))), -2.0),
        (Cylinder(1.0, 2.0), Cylinder(1.0, 2.0, (2.5, 0, 3.0)), np.hypot(0.5, 1.0)),  # edge to edge
        (
            Cylinder(1.0, 9.0, (0, 0, 0), rotation_matrix((0, 90.0, 0))),
            Cylinder(0.5, 9.0, (0, 0, 2.0), rotation_matrix((90.0, 0, 0))),
            0.5,
        ),
        (Box((2.0, 2.0, 2.0)), Cylinder(1.0, 3.0, (0, 0, 2.5), rotation_matrix((0, 90.0, 0))), 0.5),
        (Sphere(1.0), ring(4.0, 2.0, 1.0), 1.0),  # in the hole
        (Sphere(1.0, (0.5, 0, 0)), ring(4.0, 2.0, 1.0), 0.5),
        (Cylinder(1.0, 9.0, (0.25, 0, 3.0)), ring(4.0, 2.0, 1.0), 0.75),  # a shaft
        (ring(2.0, 1.0, 1.0), ring(2.0, 1.0, 1.0, (0, 0, 1.25)), 0.25),
    ],
)
def test_gaps_of_round_bodies_are_exact_in_any_pose(first, second, gap):
    for turn in (np.eye(3), TURN):
        one, other = (moved(body, turn @ body.center, turn @ body.rotation) for body in (first, second))
        assert body_overlap(one, other) == pytest.approx(-gap, abs=1e-8)
        assert body_overlap(other, one) == pytest.approx(-gap, abs=1e-8)
        assert not apart(one, other) or gap > 0
