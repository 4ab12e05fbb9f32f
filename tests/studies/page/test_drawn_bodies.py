"""Bodies as triangles enclose what they should, and their triangles are seen from outside."""

import numpy as np
import pytest

from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring
from spinlev.studies.figures.view import arrow, near_plate, triangles

RADIUS, HEIGHT, CENTER = 5e-3, 8e-3, (1e-3, 2e-3, -3e-3)


def volume(surface):
    """Enclosed by the triangles, m³, from the divergence theorem."""
    corners = surface[0][surface[1]]
    return float(np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (Box((4e-3, 5e-3, 6e-3), CENTER), 1e-12),
        (Cylinder(RADIUS, HEIGHT, CENTER), 3e-3),  # a polygon of 48 sides has 0.3 % less than its circle
        (ring(RADIUS, RADIUS / 2, HEIGHT, CENTER), 3e-3),
        (Sphere(RADIUS, CENTER), 1e-2),
    ],
    ids=["box", "cylinder", "ring", "sphere"],
)
def test_a_body_has_its_volume(body, error):
    assert volume(triangles(body)) == pytest.approx(body.volume, rel=error)


def test_an_arrow_points_along_its_direction():
    direction = np.array([0.0, 0.6, -0.8])
    corners, faces = arrow(np.array(CENTER), direction, 2e-3)
    along = (corners - CENTER) @ direction
    assert [along.min(), along.max()] == pytest.approx([-2e-3, 2e-3])
    assert volume((corners, faces)) > 0


@pytest.mark.parametrize("height", [-0.03, -0.5])
def test_the_part_of_a_plate_that_is_shown_is_its_nearest(height):
    plate = Box((0.3, 0.3, 0.01), (0.02, 0.0, height))
    near = near_plate(plate, 0.05)
    assert near.size == pytest.approx([0.1, 0.1, 0.01])
    assert near.center == pytest.approx([0.0, 0.0, height])
