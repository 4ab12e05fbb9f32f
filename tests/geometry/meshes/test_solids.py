"""Meshes of metal: the volume of bodies in any pose, alone and joined."""

import ngsolve as ng
import numpy as np
import pytest

from spinlev.geometry.meshes.solids import mesh_metal
from spinlev.geometry.shapes import Box, Cylinder, rotation_matrix

TURN = rotation_matrix((20.0, -35.0, 50.0))
CENTER = np.array([1e-3, -2e-3, 4e-3])


def moments(made):
    """Volume (m³) and centre of mass (3,) m."""
    volume = ng.Integrate(1.0, made.mesh, order=16)
    first = [ng.Integrate(x, made.mesh, order=16) / volume for x in (ng.x, ng.y, ng.z)]
    return volume * made.unit**3, made.to_meter(np.array([first]))[0]


@pytest.mark.parametrize("body", [Cylinder(3e-3, 10e-3, CENTER, TURN), Box((2e-3, 5e-3, 3e-3), CENTER, TURN)])
def test_a_body_keeps_its_volume_and_place(body):
    """Curved elements of degree 5 leave 1e-4 of a mantle."""
    volume, center = moments(mesh_metal([body]))
    assert volume == pytest.approx(body.volume, rel=3e-4)
    np.testing.assert_allclose(center, body.center, atol=1e-6)


def test_bodies_that_touch_are_one_mesh():
    bodies = [Cylinder(3e-3, 10e-3, CENTER, TURN), Box((8e-3, 8e-3, 2e-3), CENTER + 6e-3 * TURN[:, 2], TURN)]
    volume, center = moments(mesh_metal(bodies))
    parts = [body.volume for body in bodies]
    assert volume == pytest.approx(sum(parts), rel=3e-4)
    np.testing.assert_allclose(
        center, sum(p * b.center for p, b in zip(parts, bodies, strict=True)) / sum(parts), atol=1e-6
    )
