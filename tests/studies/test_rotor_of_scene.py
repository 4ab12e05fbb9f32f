"""Floaters of about one size share the rotor's table, which is accurate as near as each of them comes."""

from dataclasses import replace

import numpy as np
from places import SCENES

from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation
from spinlev.studies.plan import nearest_faces

SCENE = load_scene(SCENES / "horizontal.toml")


def of_radius(radius):
    return replace(SCENE, floater=replace(SCENE.floater, radius=radius))


def test_a_table_is_made_for_the_radius_or_up_to_a_twelfth_less():
    radii = np.geomspace(1e-5, 1.0, 500)
    nearest = np.array([nearest_faces(of_radius(float(radius)).floater) for radius in radii])
    assert (nearest <= radii * (1 + 1e-9)).all()
    assert (nearest > radii * 11 / 12 * (1 - 1e-3)).all()
    steps = 8 * np.log2(nearest / 6.35e-3)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert nearest_faces(SCENE.floater) == 6.35e-3


def test_floaters_of_about_one_size_have_one_table():
    first, *more = (Levitation(of_radius(radius), Models("cuboid")) for radius in (6.0e-3, 6.3e-3, 6.4e-3))
    for one in more:
        one.share(first)
    near, same, other = (one.table for one in (first, *more))
    assert near is same
    assert near is not other
