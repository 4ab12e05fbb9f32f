"""Cylinders, rings and spheres: against magpylib, the exact sphere, and laws of the field."""

import heyoka as hy
import magpylib
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spinlev.fem.closed_forms.round import round_slope, round_tensor
from spinlev.fem.closed_forms.uniform import UniformField, remanent_field
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Cylinder, Sphere, ring, rotation_matrix

POLARIZATION = np.array([1.1, -0.4, 0.6])
TURN = rotation_matrix((25.0, -40.0, 10.0))
BODIES = {
    "cylinder": Cylinder(5e-3, 10e-3),
    "tilted, displaced cylinder": Cylinder(5e-3, 10e-3, (2e-3, -1e-3, 3e-3), TURN),
    "disc of 20 : 1": Cylinder(10e-3, 1e-3),
    "ring": ring(10e-3, 6e-3, 5e-3),
    "tilted, displaced ring": ring(10e-3, 6e-3, 5e-3, (-3e-3, 1e-3, 2e-3), TURN),
    "thin ring": ring(10e-3, 9.5e-3, 2e-3),
    "sphere": Sphere(9.5e-3, (1e-3, 2e-3, 0.0), TURN),
}


def of_magpylib(magnet):
    body = magnet.body
    pose = {"position": body.center, "orientation": Rotation.from_matrix(body.rotation)}
    pose["polarization"] = magnet.polarization
    if isinstance(body, Sphere):
        return magpylib.magnet.Sphere(diameter=2 * body.radius, **pose)
    if body.inner_radius:
        return magpylib.magnet.CylinderSegment(dimension=(body.inner_radius, body.radius, body.height, 0, 360), **pose)
    return magpylib.magnet.Cylinder(dimension=(2 * body.radius, body.height), **pose)


def places(body, nearest, count=3000, size=0.03):
    points = np.random.default_rng(1).uniform(-size, size, (count, 3))
    distance = body.distance(points)
    return points[distance >= nearest], points[distance < -1e-4]


@pytest.mark.parametrize("name", BODIES)
def test_outside_from_1_mm_on_the_closed_form_is_that_of_magpylib(name):
    """1e-6 is asked for; within a twentieth of the radius of the axis magpylib has a series that errs by 1e-9."""
    magnet = Magnet(BODIES[name], POLARIZATION)
    outside, _ = places(magnet.body, 1e-3)
    field = rotor_table((magnet,), "cuboid").evaluate(outside)[0]
    theirs = of_magpylib(magnet).getB(outside)
    assert error(field, theirs) < 1e-8


@pytest.mark.parametrize("name", BODIES)
def test_inside_and_on_both_sides_of_the_surface(name):
    magnet = Magnet(BODIES[name], POLARIZATION)
    points = np.random.default_rng(2).normal(size=(4000, 3))
    points = magnet.body.center + points / np.linalg.norm(points, axis=1)[:, None] * magnet.body.circumradius
    points = magnet.body.center + (points - magnet.body.center) * np.random.default_rng(3).uniform(0, 1.1, (4000, 1))
    clear = np.abs(magnet.body.distance(points)) > 1e-7
    points = points[clear]
    inside = magnet.body.distance(points) < 0
    field = remanent_field((magnet,), points) + np.where(inside[:, None], magnet.polarization_in_rotor, 0.0)
    theirs = of_magpylib(magnet).getB(points)
    assert inside.sum() > 15
    assert np.abs(field - theirs).max() < 3e-9  # T; magpylib's series at the axis, elsewhere 1e-14


@pytest.mark.parametrize("name", BODIES)
def test_the_gradient_is_that_of_the_field_symmetric_and_without_trace(name):
    body = BODIES[name]
    outside, _ = places(body, 1e-3, 400)
    slope = round_slope(body, outside) @ POLARIZATION
    assert np.abs(np.trace(slope, axis1=1, axis2=2)).max() < 1e-12 * np.abs(slope).max()
    assert np.abs(slope - np.swapaxes(slope, 1, 2)).max() < 1e-12 * np.abs(slope).max()
    step = 1e-6  # a central difference of a field known to 1e-14 errs by 1e-8 at 1 mm
    differences = [
        (round_tensor(body, outside + step * axis) - round_tensor(body, outside - step * axis)) @ POLARIZATION
        for axis in np.eye(3)
    ]
    numeric = np.stack(differences, axis=-1) / (2 * step)
    assert np.abs(slope - numeric).max() < 1e-6 * np.abs(slope).max()


@pytest.mark.parametrize("name", BODIES)
def test_the_expressions_of_the_motion_agree_with_the_quadrature(name):
    """Its segments are the same for all places; the quadrature's are dense beside each."""
    magnet = Magnet(BODIES[name], POLARIZATION)
    outside, _ = places(magnet.body, 0.5 * magnet.body.volume ** (1 / 3), 1500, 0.08)
    position = hy.make_vars("x", "y", "z")
    field, gradient = UniformField(magnet).expressions(position)
    function = hy.cfunc([*field, *(part for row in gradient for part in row)], position, opt_level=0)
    values = function(np.ascontiguousarray(outside.T)).T
    assert error(values[:, :3], exact(magnet, outside)[0]) < 3e-9  # a thin ring is a small difference of cylinders
    assert error(values[:, 3:], exact(magnet, outside)[1].reshape(-1, 9)) < 1e-7


@pytest.mark.parametrize("distance", [0.0101, 0.05, 0.3, 1.5])
@pytest.mark.parametrize("name", sorted(BODIES.keys() - {"sphere"}))
def test_beside_a_magnet_the_table_has_the_field_that_the_quadrature_has(name, distance):
    """At these distances, in radii; by one compiled rule, where the quadrature's is another in half of the plane."""
    magnet = Magnet(BODIES[name], POLARIZATION)
    radius = (1 + distance) * magnet.body.circumradius
    points = magnet.body.center + np.random.default_rng(5).uniform(-radius, radius, (100_000, 3))
    apart = magnet.body.distance(points) / magnet.body.radius
    outside = points[(apart > distance) & (apart < 1.2 * distance)]
    assert len(outside) > 30
    field, gradient = UniformField(magnet).evaluate(outside)
    size = np.array([[np.abs(part).max()] for part in exact(magnet, outside)])
    assert (np.abs(field - exact(magnet, outside)[0]) / size[0]).max() < 1e-9
    assert (np.abs(gradient - exact(magnet, outside)[1]) / size[1]).max() < 1e-9


def exact(magnet, points):
    return remanent_field((magnet,), points), round_slope(magnet.body, points) @ magnet.polarization_in_rotor


def error(given, right):
    return (np.linalg.norm(given - right, axis=1) / np.linalg.norm(right, axis=1)).max()


def test_on_the_axis_and_in_line_with_the_mantle_nothing_is_singular():
    magnet = Magnet(BODIES["cylinder"], POLARIZATION)
    points = np.array([[0, 0, 0.02], [0, 0, 0.0], [5e-3, 0, -0.012], [0, 5e-3, 0.006], [0, 0, -5.1e-3]])
    field = remanent_field((magnet,), points) + np.outer(magnet.body.distance(points) < 0, POLARIZATION)
    assert np.abs(field - of_magpylib(magnet).getB(points)).max() < 1e-12


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_at_the_mantle_the_field_of_either_side_goes_on(side):
    body, angle = BODIES["ring"], np.linspace(0.1, 3.0, 5)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    near, far = (
        round_tensor(body, np.column_stack([(body.radius + side * off) * around, np.full(5, 1e-3)])) @ POLARIZATION
        for off in (1e-11, 1e-8)
    )
    assert np.abs(near - far).max() < 1e-5
