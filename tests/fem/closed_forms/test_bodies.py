"""H and M inside and around bodies: against magpylib, and against finite elements where the magnets are permeable."""

from dataclasses import replace

import magpylib
import numpy as np
import pytest
from places import HORIZONTAL

import spinlev as sl
from spinlev.fem.closed_forms.moments import volume_rule
from spinlev.fem.closed_forms.uniform import closed_form_error, fields_of_magnets, fields_of_sphere
from spinlev.geometry.common import MU_0

MAGNET = sl.load_scene(HORIZONTAL).rotor[0]
AROUND = np.random.default_rng(3).uniform(-9e-3, 9e-3, size=(200, 3))
MOMENT_OF_A_CUBE = 0.98367
"""Of recoil permeability 1.05, in units of its remanent one: finite elements with another program (PHYSICS.md)."""


def theirs(fields):
    """μ0 times what magpylib gives, T: its μ0 is another in the tenth digit."""
    return magpylib.mu_0 * fields(AROUND)


def test_a_magnet_without_permeability_is_magpylibs():
    rigid = replace(MAGNET, recoil_permeability=1.0, transverse_permeability=None)
    same = magpylib.magnet.Cuboid(dimension=rigid.box.size, polarization=rigid.polarization, position=rigid.box.center)
    h, magnetization = fields_of_magnets([rigid], AROUND)
    np.testing.assert_allclose(MU_0 * h, theirs(same.getH), rtol=0, atol=1e-12)
    np.testing.assert_allclose(MU_0 * magnetization, theirs(same.getM), rtol=0, atol=1e-12)
    assert closed_form_error([rigid]) == 0.0


def test_a_sphere_is_magpylibs():
    moment, center, radius = np.array([0.3, -0.5, 0.9]), np.array([1e-3, 2e-3, -3e-3]), 6.35e-3
    polarization = MU_0 * moment / (4 / 3 * np.pi * radius**3)
    same = magpylib.magnet.Sphere(diameter=2 * radius, polarization=polarization, position=center)
    h, magnetization = fields_of_sphere(moment, center, radius, AROUND)
    inside = np.linalg.norm(AROUND - center, axis=1) < radius
    assert 10 < inside.sum() < 190
    np.testing.assert_allclose(MU_0 * h, theirs(same.getH), rtol=0, atol=1e-12)
    np.testing.assert_allclose(MU_0 * magnetization, theirs(same.getM), rtol=0, atol=1e-12)


def test_the_sphere_has_a_field_at_its_centre():
    h, magnetization = fields_of_sphere(np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.01, np.zeros((1, 3)))
    np.testing.assert_allclose(h, -magnetization / 3)


def test_the_moment_of_a_permeable_cube_is_that_of_finite_elements():
    """First order: wrong by less than the square of μr - 1, which is what the estimate allows twice over."""
    points, weights = volume_rule(MAGNET.box, (), 12)
    magnetization = fields_of_magnets([MAGNET], points)[1]
    moment = np.linalg.norm(weights @ magnetization) * MU_0
    share = moment / (np.linalg.norm(MAGNET.polarization) * np.prod(MAGNET.box.size))
    assert share == pytest.approx(MOMENT_OF_A_CUBE, abs=0.05**2)
    assert abs(share - MOMENT_OF_A_CUBE) < closed_form_error([MAGNET])


def test_the_error_outside_is_what_is_estimated():
    """Against the finite elements' table, from contact with the floater on: below the estimate, and not far below."""
    scene = sl.load_scene(HORIZONTAL)
    table = sl.rotor_table(scene, model="fem", rtol=1e-4)
    distance = np.linspace(11.5e-3, 40e-3, 20)
    points = MAGNET.box.center + np.stack([0.2 * distance, 0 * distance, -distance], axis=1)
    assert table.in_range(points).all()
    true = table.evaluate(points)[0]
    apart = np.linalg.norm(MU_0 * fields_of_magnets([MAGNET], points)[0] - true, axis=1) / np.linalg.norm(true, axis=1)
    assert apart.max() < closed_form_error([MAGNET])
    assert apart.max() > closed_form_error([MAGNET]) / 10
