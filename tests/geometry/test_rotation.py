"""Rotations about one axis have plain entries, and others are what SciPy makes of them."""

import numpy as np
from scipy.spatial.transform import Rotation

from spinlev.geometry.shapes import rotation_angles, rotation_matrix

ANGLES = np.random.default_rng(5).uniform(-180.0, 180.0, size=(300, 3))


def test_what_an_axis_leaves_alone_is_exactly_alone():
    for axis in range(3):
        for angle in ANGLES[:, axis]:
            matrix = rotation_matrix(np.eye(3)[axis] * angle)
            np.testing.assert_array_equal(matrix[axis], np.eye(3)[axis])
            np.testing.assert_array_equal(matrix[:, axis], np.eye(3)[axis])


def test_quarter_turns_are_exact():
    np.testing.assert_array_equal(rotation_matrix((0.0, 90.0, 0.0)), [[0, 0, 1], [0, 1, 0], [-1, 0, 0]])


def test_any_rotation_is_that_of_scipy_and_orthogonal_to_round_off():
    for angles in ANGLES:
        matrix = rotation_matrix(angles)
        np.testing.assert_allclose(matrix, Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), atol=4e-16)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=2e-15)


def test_the_angles_of_a_matrix_make_it_again():
    """Also a quarter turn about y, where turns about x and z are one, and close to it."""
    for angles in [*ANGLES, *[(x, y, z) for y in (90.0, -90.0, 90.0 - 1e-9, 1e-9 - 90.0) for x, _, z in ANGLES[:50]]]:
        matrix = rotation_matrix(angles)
        found = rotation_angles(matrix)
        np.testing.assert_allclose(rotation_matrix(found), matrix, atol=2e-15)
        assert abs(found[1]) <= 90.0


def test_angles_that_are_told_come_back():
    for angles in ANGLES / [1.0, 2.0, 1.0]:
        np.testing.assert_allclose(rotation_angles(rotation_matrix(angles)), angles, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(rotation_angles(rotation_matrix((30.0, 90.0, 70.0))).round(12), [0.0, 90.0, 40.0])
