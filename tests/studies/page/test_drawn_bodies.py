"""Bodies as triangles enclose what they should."""

import numpy as np
import pytest

from spinlev.geometry.shapes import Box, Cylinder, Ring, Sphere
from spinlev.studies.page.plots import _solid

RADIUS, HEIGHT, CENTER = 5e-3, 8e-3, (1e-3, 2e-3, -3e-3)


def volume(drawn):
    """Enclosed by the triangles, mm³, from the divergence theorem."""
    corners = np.array(drawn["at"])[np.array(drawn["faces"])]
    return float(np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (Box((4e-3, 5e-3, 6e-3), CENTER), 1e-3),
        (Cylinder(RADIUS, HEIGHT, CENTER), 0.02),  # a polygon of 20 sides has 1.6 % less than its circle
        (Ring(RADIUS, RADIUS / 2, HEIGHT, CENTER), 0.02),
        (Sphere(RADIUS, CENTER), 0.06),
    ],
    ids=["box", "cylinder", "ring", "sphere"],
)
def test_a_body_has_its_volume(body, error):
    assert abs(volume(_solid(body, "red", 1.0))) == pytest.approx(1e9 * body.volume, rel=error)
