"""Analytic sources: independent quadrature, curl of the potential, Laplace's equation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spinlev.fem.closed_forms.potentials import Dipole, HomogeneousField, PolarizedCuboid, Racetrack
from spinlev.fem.closed_forms.uniform import attraction, newton_potential
from spinlev.geometry.common import MU_0
from spinlev.geometry.shapes import Box

COIL = Racetrack((0.194, 0.1, 0.099), (0.2, 0.2), 0.1, 0.025, 0.05, 2742.0)
POINTS = np.array([[0.021, 0.004, -0.013], [-0.03, 0.05, 0.02], [0.0, 0.0, 0.025]])
HALF = np.array([0.005, 0.006, 0.008])


def gauss_box(half, count=24):
    """Quadrature of a box by an independent rule."""
    x, w = np.polynomial.legendre.leggauss(count)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), -1).reshape(-1, 3) * half
    return grid, (w[:, None, None] * w[:, None] * w).ravel() * np.prod(half)


def curl(potential, points, step=2e-5):
    """Central differences: relative error (step / distance)² ~ 1e-6."""
    jacobian = np.stack([(potential(points + e) - potential(points - e)) / (2 * step) for e in step * np.eye(3)], 1)
    pairs = [((i + 1) % 3, (i + 2) % 3) for i in range(3)]
    return np.stack([jacobian[:, a, b] - jacobian[:, b, a] for a, b in pairs], 1)


def test_cuboid_integrals_against_quadrature():
    nodes, weights = gauss_box(HALF)
    offset = POINTS[:, None] - nodes
    distance = np.linalg.norm(offset, axis=2)
    # Gauss with 24 points converges to round-off at these distances; 1e-10 leaves room for cancellation
    assert newton_potential(POINTS, HALF) == pytest.approx((weights / distance).sum(1), rel=1e-10)
    pull = np.einsum("q,pqi,pq->pi", weights, offset, distance**-3)
    assert attraction(POINTS, HALF) == pytest.approx(pull, rel=1e-10, abs=1e-12 * abs(pull).max())


def test_newton_potential_inside_solves_poisson():
    step, inside = 1e-4, np.array([[0.001, -0.002, 0.003]])
    shifted = [newton_potential(inside + s * step * e, HALF) for e in np.eye(3) for s in (1, -1)]
    laplacian = (sum(shifted) - 6 * newton_potential(inside, HALF)) / step**2
    assert laplacian == pytest.approx([-4 * np.pi], rel=1e-3)  # (step/half)² and round-off


def test_cuboid_far_away_is_a_dipole_and_turns_with_its_box():
    turn = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).as_matrix()
    box, polarization = Box(2 * HALF, (0.001, 0.002, 0.003), turn), np.array([0.2, -1.0, 0.7])
    dipole = Dipole(box.center, polarization * box.volume / MU_0)
    far = box.center + 100 * POINTS
    expected = dipole.vector_potential(far)
    # the box is no cube: a quadrupole-free relative difference of (a/r)² ~ 1e-5
    assert PolarizedCuboid(box, polarization).vector_potential(far) == pytest.approx(
        expected, rel=1e-4, abs=1e-4 * abs(expected).max()
    )


def test_potential_of_a_uniform_field():
    found = curl(HomogeneousField(np.array([1.0, 2.0, 3.0])).vector_potential, POINTS)
    assert found == pytest.approx(np.tile([1.0, 2.0, 3.0], (3, 1)), rel=1e-9)  # linear: differences are exact


def test_racetrack_field_is_the_curl_of_its_potential():
    points = np.array([[0.1, 0.072, 0.034], [0.25, 0.05, 0.019], [0.194, 0.1, 0.0]])
    field = COIL.flux_density(points)
    assert curl(COIL.vector_potential, points) == pytest.approx(field, rel=1e-5, abs=1e-5 * abs(field).max())


def test_racetrack_against_filaments():
    """Biot-Savart of closed polygons through Gauss points of the cross-section: an independent sum."""
    x, w = np.polynomial.legendre.leggauss(10)
    point, total = np.array([0.13, 0.072, 0.034]), np.zeros(3)
    for q, wq in zip(x, w, strict=True):
        inset = 0.0125 * (1 + q)
        turn = filament(0.1 - inset, 0.05 - inset)
        for s, ws in zip(x, w, strict=True):
            path = np.column_stack([turn + np.array([0.194, 0.1]), np.full(len(turn), 0.099 + 0.05 * s)])
            offset, step = point - (path + np.roll(path, -1, 0)) / 2, np.roll(path, -1, 0) - path
            biot = np.cross(step, offset) / np.linalg.norm(offset, axis=1)[:, None] ** 3
            total += MU_0 / (4 * np.pi) * 2742.0 * wq * ws / 4 * biot.sum(0)
    assert COIL.flux_density(point[None])[0] == pytest.approx(total, rel=1e-4)  # 0.5 mm chords


def filament(half_edge, radius):
    """Closed rounded square, counter-clockwise, in chords of some 0.5 mm: (n, 2) m."""
    middle, pieces = half_edge - radius, []
    for quarter in range(4):
        angle = quarter * np.pi / 2 + np.linspace(0, np.pi / 2, 120)
        corner = middle * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)][quarter])
        pieces.append(corner + radius * np.column_stack([np.cos(angle), np.sin(angle)]))
        following = middle * np.array([(-1, 1), (-1, -1), (1, -1), (1, 1)][quarter])
        end = following + radius * np.array([np.cos(angle[-1]), np.sin(angle[-1])])
        pieces.append(pieces[-1][-1] + np.linspace(0, 1, 240)[1:-1, None] * (end - pieces[-1][-1]))
    return np.concatenate(pieces)


def test_bad_racetrack_is_named():
    with pytest.raises(ValueError, match="Input outer_radius_m must lie between"):
        Racetrack((0, 0, 0), (0.1, 0.1), 0.1, 0.05, 0.02, 1.0)


def test_round_off_of_the_attraction_is_that_of_its_cancelling_faces():
    """Against the same in extended precision, 10 mm to 30 mm off a cuboid of some 10 mm: below 1e-12 of it."""
    places = np.random.default_rng(8).normal(size=(500, 3))
    places *= np.random.default_rng(9).uniform(15e-3, 35e-3, (500, 1)) / np.linalg.norm(places, axis=1, keepdims=True)
    half = np.array([5e-3, 4e-3, 7e-3])
    exact = attraction(places.astype(np.longdouble), half.astype(np.longdouble)).astype(float)
    missed = np.linalg.norm(attraction(places, half) - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert 0 < missed.max() < 1e-12
